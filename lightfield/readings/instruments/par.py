"""PAR loggers (LI-COR, Campbell and others): one number for 400-700 nm a row, in photons, no spectrum."""

from __future__ import annotations

import re

import numpy as np

from lightfield.readings.instruments.document import Document
from lightfield.readings.instruments.number_block import NumberBlock
from lightfield.readings.instruments.oddity import Odd, Oddity
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "PAR logger"
_UNUSABLE = f"not a usable {NAME} file"
#: Photosynthetically active radiation, by definition.
_BAND_NM = (400.0, 700.0)
_NAMED = re.compile(r"(?<![a-z])(par|ppfd|pfd|qntm|quantum)(?![a-z])|[uµμ]mol", re.IGNORECASE)
_CLOCK = re.compile(r"\d{1,2}:\d{2}(:\d{2})?")


def claims(document: Document) -> bool:
    """Is this a table with a column of photosynthetically active radiation?"""
    table = document.columns()
    return table is not None and bool(_columns(table))


def _columns(table: NumberBlock) -> list[int]:
    return [
        k
        for k, (name, unit) in enumerate(zip(table.names, table.units, strict=True))
        if _NAMED.search(name.replace("_", " ")) or _NAMED.search(unit)
        if not table.across() and not _CLOCK.search(table.cells[0][k])
    ]


def read(document: Document) -> list[Spectrum]:
    """One number for the band of each row; the column's name is the label."""
    problems = Problems(document.where)
    table = document.columns(problems)
    chosen = _columns(table) if table is not None else []
    if table is None or not chosen:
        named = "a name like PAR, PPFD or quantum, or a unit in umol"
        problems.refuse(_UNUSABLE, "no column of PAR", rule=named)
    values = {k: table.column(k, problems) for k in chosen}
    problems.raise_any(_UNUSABLE)
    header = {"title": document.title, **table.header}
    when = next((k for k, cell in enumerate(table.cells[0]) if _CLOCK.search(cell)), None)
    return [
        Spectrum(
            source=document.where,
            format=NAME,
            wavelength_nm=np.array(_BAND_NM),
            columns={"value": np.full(2, values[k][row])},
            header={**header, "unit": table.units[k]},
            date=_date(table.cells[row][when]) if when is not None else "",
            label=table.names[k],
            band_nm=_BAND_NM,
            photons=True,
            notes=(Oddity(Odd.PHOTONS),),
        )
        for k in chosen
        for row in range(len(table.cells))
        if np.isfinite(values[k][row])
    ]


def _date(cell: str) -> str:
    """A date that can be told, or "": of 03/04/20 nobody can say which is the month."""
    return cell if re.match(r"\d{4}-\d{2}-\d{2} \d{2}:\d{2}:\d{2}", cell) else ""
