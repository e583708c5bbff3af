"""`lightfield import`: instrument files and an index into one reading table."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from lightfield.api.given import import_
from lightfield.commands.shared.options import add_option, given
from lightfield.errors import UsageError
from lightfield.readings import write_table
from lightfield.readings.importing import places
from lightfield.storage.files import output_file

#: What the instrument's files do not say.
_STATED = (
    "quantity", "units", "saturation_level", "plane_gain_percent", "position_mm", "tolerance_percent",
    "outlier_percent", "calibration_percent",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `lightfield import`."""
    parser.add_argument(
        "index",
        metavar="INDEX.csv",
        help="columns file, medium, x_m, y_m, z_m, time_s, role "
        "(signal, dark, reference, ignore), integration_time_s, spectrum (which one of a file of several); "
        "only file and z_m are required. With --column z_m=... a table of your own that has the places in it",
    )
    parser.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="MEANING=NAME",
        help="which column is what, by its name or number; may be given again. In files of plain columns: "
        "wavelength_nm, value, dark, reference. In a table of your own: z_m, x_m, y_m, time_s, "
        "integration_time_s, medium, role, value (or columns named by wavelengths)",
    )
    asked = parser.add_argument_group("what the instrument's files do not say")
    asked.add_argument("--quantity", help="irradiance, scalar_irradiance or radiance")
    asked.add_argument(
        "--units", help="of the numbers in the files: counts, counts/s, relative, or 'uW cm^-2 nm^-1' ..."
    )
    asked.add_argument(
        "--band", action="append", default=[], metavar="LOW:HIGH", help="in nm; may be given again"
    )
    asked.add_argument(
        "--saturation-level", type=float, metavar="N", help="full scale, in the unit of the files"
    )
    budget = parser.add_argument_group("error budget, for the head of the table")
    budget.add_argument(
        "--plane-gain-percent", type=float, metavar="P", help="repeatability of a visit to a plane"
    )
    budget.add_argument("--position-mm", type=float, metavar="MM", help="error of the detector's position")
    budget.add_argument("--tolerance-percent", type=float, metavar="P", help="smooth misfit of no interest")
    budget.add_argument("--outlier-percent", type=float, metavar="P", help="part of readings spoilt by slips")
    budget.add_argument(
        "--calibration-percent", type=float, metavar="P", help="error of an absolute calibration"
    )
    add_option(parser, "--output", type=str, metavar="READINGS.csv", help="the reading table to write")


def run(args: argparse.Namespace) -> int:
    """Import, write, and say what was found."""
    if not args.output:
        raise UsageError("no output file", remedy="say where to write the reading table with -o READINGS.csv")
    output_file(args.output, args.index)
    readings = import_(
        args.index,
        column=_columns(args.column),
        band=[_band(text) for text in args.band],
        **given(args, *_STATED),
    )
    named = readings.metadata["instrument"]["files"]
    output_file(args.output, args.index, *(Path(args.index).parent / file for file in named))
    write_table(readings, args.output)
    files = len(named)
    formats = ", ".join(readings.metadata["instrument"]["formats"])
    what = f"{files} rows" if formats == places.NAME else f"{files} file{'s' * (files > 1)}"
    print(f"{what} ({formats}) -> {len(readings)} readings of {readings.quantity} in {readings.units}")
    for warning in readings.warnings:
        print(f"  note: {warning}")
    print(args.output)
    return 0


def _columns(texts: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for meaning, name in map(_column, texts):
        if meaning in found:
            raise UsageError(
                "two columns of one meaning", where="--column", found=f"{meaning}={found[meaning]}, {name}",
                rule="one column for each meaning", remedy="leave one of them out",
            )  # fmt: skip
        found[meaning] = name
    return found


def _column(text: str) -> tuple[str, str]:
    meaning, equals, name = text.partition("=")
    if not (meaning and equals and name):
        raise UsageError(
            "not a column", found=text, rule="MEANING=NAME", remedy="for example --column 'z_m=distance (cm)'"
        )
    return meaning.strip(), name.strip()


def _band(text: str) -> tuple[float, float]:
    low, _, high = text.partition(":")
    try:
        return float(low), float(high)
    except ValueError:
        raise UsageError(
            "not a band", found=text, rule="LOW:HIGH in nm", remedy="for example --band 500:550"
        ) from None
