"""Jaz: `Jaz Data File`, columns named W D R S P (wavelength, dark, reference, signal, processed) or W S."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

from lightfield.readings.instruments.document import Document, spectrum
from lightfield.readings.instruments.spectrum import Spectrum
from lightfield.readings.problems import Problems

NAME = "Jaz"
_COLUMNS = {"D": "dark", "R": "reference", "S": "signal", "P": "processed"}


def claims(document: Document) -> bool:
    """Is this a Jaz file of counts?"""
    block = document.numbers
    lettered = block is not None and bool(block.lines) and block.lines[0][1].upper().split()[:1] == ["W"]
    return re.search(r"\bjaz\b", document.title.lower()) is not None or lettered


def read(document: Document) -> Spectrum:
    """Read it."""
    return read_lettered(document, NAME, Problems(document.where))


def read_lettered(document: Document, name: str, problems: Problems, **more: Any) -> Spectrum:
    """A spectrum whose columns are named by letters in their first line."""
    block = document.numbers
    columns = ["signal"]
    if block is not None and block.lines:
        line, names = block.lines[0]
        letters = names.upper().replace(";", " ").split()
        rest = letters[1:]
        if letters[:1] != ["W"] or "S" not in rest or not {*rest} <= {*_COLUMNS} or len({*rest}) < len(rest):
            problems.refuse(
                f"not a usable {name} file",
                "unknown column names",
                place=line,
                found=names,
                rule="W D R S P, W D S P or W S",
                remedy="export it again",
            )
        columns = [_COLUMNS[letter] for letter in rest]
        block = replace(block, lines=block.lines[1:])
    return spectrum(document, name, block, columns, problems, **more)
