"""What readings in water against readings in air tell of the water."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightfield.errors import MeasurementError, RenderError, SceneError
from lightfield.fitting.diffuse_light import DiffuseSource
from lightfield.progress import step
from lightfield.readings import Readings
from lightfield.scene import Scene
from lightfield.studies.attenuation.apparent import SIGMAS, Apparent, apparent_attenuation
from lightfield.studies.attenuation.constituents import (
    FEWEST_COLOURS,
    Constituents,
    OtherSlope,
    best_amounts,
    fit_constituents,
    other_slope,
    pure,
)
from lightfield.studies.attenuation.excess import no_excess
from lightfield.studies.attenuation.ratios import ratios_of
from lightfield.studies.attenuation.remark import Remark, Studied
from lightfield.studies.attenuation.scattered import Scattered, other_phases, scattered_light, traced_stack
from lightfield.studies.attenuation.stack import Stack, same_water


@dataclass(frozen=True, eq=False)
class Content:
    """Constituents by several models of the light.

    Parameters
    ----------
    traced, loose : Constituents, optional
        With scattered light, also with grey scattering left free; None without a trace.
    beer_lambert : Constituents
        As if every scattered photon were lost.
    other_phases : dict
        Amounts, by field of the water, for Henyey-Greenstein phase functions of other g.
    other_slope : OtherSlope, optional
        Of CDOM, where the first model is rejected with the scene's and fits better with another.
    """

    traced: Constituents | None
    loose: Constituents | None
    beer_lambert: Constituents
    other_phases: dict[float, dict[str, float]]
    other_slope: OtherSlope | None = None


@dataclass(frozen=True, eq=False)
class Attenuation:
    """The answer.

    Parameters
    ----------
    apparent : tuple of Apparent
        One per table.
    scattered : Scattered, optional
        Where scattered light was traced.
    content : Content, optional
        Where there are wavelengths enough.
    notes : tuple of Remark
        What was assumed or left out.
    """

    apparent: tuple[Apparent, ...]
    scattered: Scattered | None
    content: Content | None
    notes: tuple[Remark, ...]


def _refuse_twice(tables: Sequence[Readings]) -> None:
    """The same numbers once more are no second receiver: they would count twice."""
    seen: dict[bytes, Readings] = {}
    for table in tables:
        other = seen.setdefault(_numbers(table), table)
        if other is not table or sum(one is table for one in tables) > 1:
            raise MeasurementError(
                "the same readings twice", where=table.source or None, found=other.source or "one table",
                rule="a table of its own for each receiver", remedy="leave one of them out",
            )  # fmt: skip


def _numbers(table: Readings) -> bytes:
    names = ("x_m", "y_m", "z_m", "wavelength_nm", "value")
    return b"".join(np.asarray(getattr(table, name), float).tobytes() for name in names)


def attenuation(
    readings: Readings | Sequence[Readings],
    scenes: Scene | Sequence[Scene],
    trace: DiffuseSource | None = None,
    in_air: bool | None = None,
) -> Attenuation:
    """Attenuation of the water from one table of readings, or from several of the same water.

    Parameters
    ----------
    readings : Readings, or several
        Several receivers (each a table with its scene) part absorption from scattering.
    scenes : Scene, or several
        One for each table, or one for all. Lamp, tank, receiver and phase function count; the water is
        looked for.
    trace : callable, optional
        `lightfield.render.diffuse.source.response_for`: gives the scattered light that K hides.
    in_air : bool, optional
        Divide by readings in air; default: where there are any.

    Raises
    ------
    MeasurementError
        Too few distances; tables of different wavelengths; not one scene for each.
    """
    tables = [readings] if isinstance(readings, Readings) else list(readings)
    given = [scenes] if isinstance(scenes, Scene) else list(scenes)
    if len(given) == 1:
        given *= len(tables)
    if not tables or len(given) != len(tables):
        raise MeasurementError(
            "tables and scenes do not belong together",
            found=f"{len(tables)} tables, {len(given)} scenes",
            rule="one scene for each table, in the same order, or one for all",
            remedy="name the scene of each receiver",
        )
    _refuse_twice(tables)
    ratios = [ratios_of(table, scene, in_air) for table, scene in zip(tables, given, strict=True)]
    same_water(ratios)
    apparent = tuple(apparent_attenuation(r) for r in ratios)
    notes = [note for r in ratios for note in r.notes] + [n for one in apparent for n in _of_lines(one)]
    stack, others, scattered = None, {}, None
    if trace is not None:
        try:
            with step(0, 2, "scattered light"):
                stack = traced_stack(apparent, trace)
            with step(1, 2, "other phase functions"):
                others = other_phases(apparent, trace)
            scattered = scattered_light(apparent, stack, others)
        except RenderError as error:
            notes.append(Remark(Studied.NOT_TRACED, why=str(error)))
    content = None
    if len(ratios[0].wavelength_nm) < FEWEST_COLOURS:
        notes.append(Remark(Studied.FEW_COLOURS, limit=FEWEST_COLOURS))
    else:
        try:
            content = _content(apparent, stack, others)
        except SceneError as error:
            notes.append(Remark(Studied.NO_CONSTITUENTS, why=str(error)))
    return Attenuation(apparent, scattered, content, tuple(dict.fromkeys(notes)))


def _of_lines(found: Apparent) -> list[Remark]:
    """What the lines leave out, and where K is below zero beyond its errors."""
    notes, on_line = [], found.on_line
    if found.set_aside:
        notes.append(Remark(Studied.SET_ASIDE, why=found.set_aside))
    if not on_line.all():
        notes.append(Remark(Studied.BESIDE_BEAM, int(on_line.sum()), len(on_line)))
    if count := found.grows_at:
        notes.append(Remark(Studied.GROWS, count=count, among=len(found.K_per_m), limit=SIGMAS))
    return notes


def _content(apparent: Sequence[Apparent], stack: Stack | None, others: dict[float, Stack]) -> Content:
    base = pure(apparent[0].ratios.scene.water)
    plain = stack or Stack(
        [one.ratios for one in apparent], [no_excess(len(one.ratios.path_m)) for one in apparent]
    )
    formula = fit_constituents(plain, base, scattered=False)
    if stack is None:
        slope = other_slope(plain, base, formula, scattered=False) if formula.rejected else None
        return Content(None, None, formula, {}, slope)
    traced = fit_constituents(stack, base)
    return Content(
        traced,
        fit_constituents(stack, base, grey=True),
        formula,
        {g: best_amounts(other, base) for g, other in others.items()},
        other_slope(stack, base, traced) if traced.rejected else None,
    )


def beer_lambert_is_off(content: Content) -> dict[str, tuple[float, float]]:
    """By how much the formula misses the amounts that were found: relative, and in its own stated errors.

    Only those that are found with grey scattering free too: what else might scatter is no yardstick.
    """
    if content.traced is None:
        return {}
    off = {}
    for name, right in content.traced.amounts.items():
        wrong = content.beer_lambert.amounts[name]
        if right.found and name not in only_without_grey(content) and wrong.stderr > 0:
            off[name] = (wrong.value / right.value - 1, (wrong.value - right.value) / wrong.stderr)
    return off


def only_without_grey(content: Content) -> list[str]:
    """Amounts that are found only if nothing but the constituents scatters: fields of the water."""
    if content.traced is None or content.loose is None:
        return []
    loose = content.loose.amounts
    return [name for name, one in content.traced.amounts.items() if one.found and not loose[name].found]
