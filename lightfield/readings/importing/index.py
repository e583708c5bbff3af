"""The index of a measurement: which file was taken where, when, and as what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from os.path import normpath
from pathlib import Path

from lightfield.readings import text
from lightfield.readings.columns import MEDIA
from lightfield.readings.problems import Problems
from lightfield.readings.sheet import UNITS, look_alike, read_sheet
from lightfield.storage.inputs import INDEX

ROLES = ("signal", "dark", "reference", "ignore")
_NUMBERS = ("x_m", "y_m", "z_m", "time_s", "integration_time_s")
COLUMNS = ("file", "medium", *_NUMBERS, "role", "spectrum")
_NAN = float("nan")
_NO_INDEX = (
    "name the file of each spectrum in it; of a table with the places in it say which column is z: "
    "column z_m=NAME"
)


@dataclass(frozen=True)
class IndexLine:
    """One line of an index.

    Parameters
    ----------
    file : str
        As written; `path` is where it is, relative to the index.
    x_m, y_m, z_m, time_s, integration_time_s : float
        nan where not given; x and y are 0.
    spectrum : str
        Which one of the file's spectra, by its label; "" where it has one, or several of one label.
    number : int
        Of several spectra that are taken from one file, from 1; 0 of a single one.
    """

    line: int
    file: str
    path: Path
    medium: str
    role: str
    x_m: float
    y_m: float
    z_m: float
    time_s: float
    integration_time_s: float
    spectrum: str = ""
    number: int = 0

    @property
    def called(self) -> str:
        """The file, and which of its spectra, as tables and messages have it."""
        return f"{self.file}[{self.number}]" if self.number else self.file


def read_index(path: str | PathLike[str], problems: Problems) -> tuple[list[IndexLine], tuple[str, ...]]:
    """Read an index CSV with the columns of COLUMNS.

    Only `file` is required, and z_m for what is neither dark nor ignored. Columns that mean nothing here come
    beside the lines.

    Raises
    ------
    MeasurementError
        The file cannot be read; everything else that is wrong goes to `problems`.
    """
    where = fspath(path)
    sheet = read_sheet(text.read_text(where, INDEX), problems, COLUMNS, ("file",), _NUMBERS, _NO_INDEX)
    place = {name: c for c, name in enumerate(sheet.names)}
    unknown = [name for name in sheet.names if name not in COLUMNS]
    if "file" not in place:
        return [], ()
    _refuse_look_alikes(unknown, [n for n in COLUMNS if n not in place], sheet.name_line, problems)
    entries, used = [], dict[tuple[str, str], int]()
    for line, cells in sheet.rows:
        row = dict.fromkeys(COLUMNS, "") | {name: cells[c].strip() for name, c in place.items()}
        row["role"], row["medium"] = row["role"].lower() or "signal", row["medium"].lower() or "water"
        before = len(problems.found)
        values = {name: _number(name, row[name], sheet.mark, line, problems) for name in _NUMBERS}
        _check_line(line, row, values, problems)
        if not row["file"]:
            problems.add("no file is named", place=line, remedy="name the spectrum's file")
        elif (same := (normpath(row["file"]), row["spectrum"])) in used:
            problems.add(
                f"the same file as line {used[same]}",
                place=line,
                found=row["file"],
                rule="one line for each spectrum",
                remedy="leave out one of the lines",
            )
        used.setdefault((normpath(row["file"]), row["spectrum"]), line)
        if len(problems.found) == before:
            values |= {name: 0.0 for name in ("x_m", "y_m") if row[name] == ""}
            entries.append(
                IndexLine(
                    line, row["file"], Path(where).parent / row["file"], row["medium"], row["role"], **values,
                    spectrum=row["spectrum"], number=0,
                )
            )  # fmt: skip
    if not any(entry.role in ("signal", "reference") for entry in entries) and not problems:
        problems.add(
            "no spectrum has the role signal or reference", remedy="add the lines of the measurement"
        )
    return entries, tuple(filter(None, unknown))


def _refuse_look_alikes(
    unknown: Sequence[str], missing: Sequence[str], line: int, problems: Problems
) -> None:
    """Columns that seem to mean one that is missing."""
    for name in missing:
        other = look_alike(name, unknown)
        if other:
            unit = UNITS.get(name.rsplit("_", 1)[-1])
            problems.add(
                f"the column {other} is not known",
                place=line,
                rule=", ".join(COLUMNS),
                remedy=f"name it {name}" + (f", and give {unit}" if unit else ""),
            )


def _check_line(line: int, row: Mapping[str, str], values: Mapping[str, float], problems: Problems) -> None:
    role, medium, z_m, seconds = row["role"], row["medium"], values["z_m"], values["integration_time_s"]
    if role not in ROLES:
        problems.add(
            "unknown role", place=line, found=role, rule=", ".join(ROLES),
            remedy="write signal for the light of the lamp, dark where it was covered",
        )  # fmt: skip
    if medium not in MEDIA:
        problems.add(
            "unknown medium", place=line, found=medium, rule=" or ".join(MEDIA), remedy="write one of them"
        )
    if role not in ("dark", "ignore"):
        if row["z_m"] == "":
            problems.add("z_m is missing", place=line, rule=f"required for the role {role}")
        elif z_m <= 0:
            problems.add("z_m is an impossible position", place=line, found=z_m, rule="z_m > 0")
    if seconds <= 0:
        problems.add("integration_time_s is not positive", place=line, found=seconds)


def _number(name: str, cell: str, mark: str, line: int, problems: Problems) -> float:
    if cell == "":
        return _NAN
    try:
        return text.parsed_number(cell, mark)
    except ValueError as error:
        problems.add(
            f"{name} {error}", place=line, found=cell, remedy="correct it, or leave it blank for not known"
        )
        return _NAN
