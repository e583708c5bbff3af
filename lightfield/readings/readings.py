"""The reading table: what a detector read, where, when, and how well that is known."""

from __future__ import annotations

from dataclasses import fields, replace
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightfield.errors import MeasurementError
from lightfield.readings.blindness import load_warnings
from lightfield.readings.checks import against_scene, check_values
from lightfield.readings.columns import COLUMNS, DEFAULTS, TERMS, TEXT_COLUMNS, ErrorBudget
from lightfield.readings.unchecked import Unchecked

if TYPE_CHECKING:
    import pandas as pd

    from lightfield.scene import Scene


class Readings(Unchecked):
    __doc__ = Unchecked.__doc__  # its fields are what a table holds; what is made here passed the checks

    @classmethod
    def from_arrays(cls, *, z_m: ArrayLike, value: ArrayLike, **given: Any) -> Readings:
        """A table from arrays, checked like a file.

        Parameters
        ----------
        z_m, value : array, shape (n,), m and `units`
        **given
            Any other field of Readings; one number or text holds for all readings. What is left out takes the
            default of the file format. The error budget's terms may be given by name.

        Raises
        ------
        MeasurementError
            Whatever a file with these readings would be refused for.
        """
        given = {"z_m": z_m, "value": value, **given}
        size = np.size(value)
        columns: dict[str, Any] = {n: _column(n, given.pop(n, None), size) for n in COLUMNS}
        terms = {name: _term(name, given.pop(name)) for name in TERMS if name in given}
        budget = replace(given.pop("budget", ErrorBudget()), **terms)
        extra = {
            name: np.array([str(cell) for cell in np.broadcast_to(np.asarray(cells), (size,))], dtype=np.str_)
            for name, cells in dict(given.pop("extra", {})).items()
        }
        if unknown := sorted(set(given) - {field.name for field in fields(Unchecked)}):
            raise MeasurementError(
                "a reading table has no such column",
                found=", ".join(unknown),
                rule=", ".join((*COLUMNS, *TERMS)),
                remedy="columns of your own go into extra = {name: values}",
            )
        readings = cls(**columns, budget=budget, extra=extra, **given)
        check_values(readings)
        readings = readings.saturated_by_level()
        return replace(readings, warnings=(*readings.warnings, *load_warnings(readings)))

    def saturated_by_level(self) -> Readings:
        """The same; what reaches the level of the budget, if it states one, counts as saturated."""
        level = self.budget.saturation_level
        return self if level is None else replace(self, saturated=self.saturated | (self.value >= level))

    def __repr__(self) -> str:
        planes = np.unique(self.z_m).size
        return f"<Readings: {len(self)} at {planes} distances, {self.quantity or 'quantity not stated'}>"

    def to_pandas(self) -> pd.DataFrame:
        """The table: a row per reading, columns as in the file, those without any value left out."""
        import pandas as pd

        table = pd.DataFrame({name: getattr(self, name) for name in COLUMNS} | dict(self.extra))
        return table.dropna(axis="columns", how="all")

    def subset(self, chosen: ArrayLike) -> Readings:
        """The chosen readings (mask or indices), with warnings made anew.

        Warnings about the file itself are kept.
        """
        index = np.asarray(chosen)
        if index.dtype != bool:
            index = index.astype(int)
        part = replace(
            self,
            **{name: getattr(self, name)[index] for name in COLUMNS},
            extra={name: cells[index] for name, cells in self.extra.items()},
            line=None if self.line is None else self.line[index],
            warnings=(),
        )
        codes = {w.code for w in load_warnings(self)}
        return replace(
            part, warnings=(*(w for w in self.warnings if w.code not in codes), *load_warnings(part))
        )

    def usable(self) -> Readings:
        """The readings that are not saturated."""
        return self.subset(~self.saturated)

    def check_against(self, scene: Scene) -> Readings:
        """These readings with the scene's band filled in where none is given.

        Parameters
        ----------
        scene : Scene
            Its tank (None: unbounded water) bounds the positions, its detector the quantity and wavelengths.

        Raises
        ------
        MeasurementError
            Positions outside the tank, wavelengths outside the bands, another quantity; all at once.
        """
        return against_scene(self, scene)


def _term(name: str, given: Any) -> float | None:
    """A term of the error budget."""
    if given is None:
        return None
    if isinstance(given, bool) or not isinstance(given, Real):
        raise MeasurementError(f"{name} is no number", found=given, remedy="give a number, or None")
    return float(given)


def _column(name: str, given: Any, size: int) -> NDArray[Any]:
    kind: Any = np.str_ if name in TEXT_COLUMNS else np.bool_ if name == "saturated" else np.float64
    if np.ma.is_masked(given):
        raise MeasurementError(
            f"{name} is masked in places", rule="plain arrays", remedy="leave the masked readings out"
        )
    values = np.asarray(DEFAULTS.get(name, np.nan) if given is None else given)
    if kind is np.float64 and values.dtype.kind in "bc":
        raise MeasurementError(
            f"{name} does not hold numbers", found=f"an array of {values.dtype}", rule="real numbers",
            remedy="give numbers",
        )  # fmt: skip
    if values.ndim > 1 or values.size not in (1, size):
        raise MeasurementError(
            f"{name} has shape {values.shape}",
            rule=f"one number, or {size} like the values",
            remedy="flatten it",
        )
    try:
        return np.array(np.broadcast_to(values.astype(kind), (size,)))
    except (TypeError, ValueError) as error:
        raise MeasurementError(
            f"{name} does not hold numbers", found=str(error), remedy="give numbers"
        ) from error
