"""What every answer of the library can do: say itself briefly and in full, be drawn, tabled, made a page."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np

from lightfield.errors import UsageError
from lightfield.storage.files import write_text

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from lightfield.report.style import Axes


class Says(Protocol):
    """Details that say themselves."""

    def as_text(self) -> str: ...

    def as_data(self) -> dict[str, Any]: ...


class Words(Protocol):
    """What says details: the module with the words of a study."""

    def headline(self, found: Any, /) -> str: ...

    def as_text(self, found: Any, /) -> str: ...

    def as_data(self, found: Any, /) -> dict[str, Any]: ...


Details = TypeVar("Details")
Told = TypeVar("Told", bound=Says)

#: How names of columns end, by the unit in a data set.
_IN_NAMES = {"m": "_m", "rad": "_deg", "deg": "_deg"}
#: Rows and columns of a table that a notebook shows of an answer.
_MOST_ROWS, _MOST_COLUMNS = 12, 12
#: Characters of a `repr`.
_LONGEST = 200


class Result(ABC, Generic[Details]):
    """An answer.

    Parameters
    ----------
    details : object
        The answer as the rooms of the library know it, with everything it rests on. It is no part of what
        stays the same from version to version.
    """

    #: Of an answer that holds more than can go to another process: what goes there instead.
    _sent_instead = ""

    def __init__(self, details: Details) -> None:
        self.details = details

    def __getstate__(self) -> dict[str, Any]:
        if self._sent_instead:
            raise UsageError(
                "holds more than can be pickled", where=type(self).__name__,
                rule="what goes to another process, or into a copy, is plain data",
                remedy=f"hand over {self._sent_instead}",
            )  # fmt: skip
        return vars(self)

    @property
    @abstractmethod
    def headline(self) -> str:
        """The answer in one sentence."""

    def as_text(self) -> str:
        """The answer for people, as the command prints it."""
        return f"{self.headline}\n{self.summary().to_string(index=False)}"

    @abstractmethod
    def as_data(self) -> dict[str, Any]:
        """The answer for programs: plain values, as the command writes them to JSON."""

    @abstractmethod
    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the main figure.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where; without one in a new figure.

        Returns
        -------
        matplotlib.axes.Axes
            The same, to go on drawing in.
        """

    @abstractmethod
    def to_pandas(self) -> pd.DataFrame:
        """The numbers as a table; units are in the names of its columns."""

    def to_xarray(self) -> xr.Dataset:
        """The numbers as a data set."""
        return self.to_pandas().to_xarray()

    @abstractmethod
    def _page(self) -> str:
        """A self-contained page."""

    def report(self, path: str | PathLike[str]) -> Path:
        """Write a self-contained page.

        Parameters
        ----------
        path : path-like
            HTML file; written whole or not at all.

        Raises
        ------
        UsageError, OutputError
            It is no path; the file cannot be written.
        """
        if not isinstance(path, (str, PathLike)):
            raise UsageError(
                "not what this argument takes", where="path", found=type(path).__name__,
                rule="the path of a file",
            )  # fmt: skip
        return write_text(path, self._page())

    def summary(self) -> pd.DataFrame:
        """The few rows that a notebook shows."""
        return self.to_pandas()

    def __str__(self) -> str:
        return self.as_text()

    def __repr__(self) -> str:
        text = f"<{type(self).__name__}: {' '.join(self.headline.split())}>"
        return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 4]}...>"

    def _repr_html_(self) -> str:
        table = self.summary()
        shown = table.head(_MOST_ROWS).to_html(
            index=False, border=0, na_rep="–", max_cols=_MOST_COLUMNS, float_format="{:.4g}".format
        )
        more = len(table) - _MOST_ROWS
        rest = f"<p>and {more} more rows: <code>.to_pandas()</code></p>" if more > 0 else ""
        return f"<div><p><b>{type(self).__name__}.</b> {escape(self.headline)}</p>{shown}{rest}</div>"


class OverAxes(Result[Details]):
    """An answer that is known over axes."""

    @abstractmethod
    def to_xarray(self) -> xr.Dataset:
        """The numbers over their axes."""

    def to_pandas(self) -> pd.DataFrame:
        """A row per place on the axes of `to_xarray`; angles in degrees, units in the names."""
        data = self.to_xarray()
        units = {str(name): str(one.attrs.get("units")) for name, one in data.data_vars.items()}
        angles = {name: np.degrees(data[name]) for name, unit in units.items() if unit == "rad"}
        ends = {name: _IN_NAMES[unit] for name, unit in units.items() if unit in _IN_NAMES}
        named = {name: name if name.endswith(end) else f"{name}{end}" for name, end in ends.items()}
        return data.assign(angles).rename(named).to_dataframe().reset_index()


class ToldByDetails(Result[Told]):
    """An answer that says what its details say."""

    def as_text(self) -> str:
        return self.details.as_text()

    def as_data(self) -> dict[str, Any]:
        return self.details.as_data()


class ToldInWords(Result[Details]):
    """An answer that says what the words of its study say."""

    _words: Words

    @property
    def headline(self) -> str:
        return self._words.headline(self.details)

    def as_text(self) -> str:
        return self._words.as_text(self.details)

    def as_data(self) -> dict[str, Any]:
        return self._words.as_data(self.details)
