"""Readings in water over readings in air at the same places: what every study of the water starts from.

    y = ln(I_water / I_air) - delta = alpha - K s + ln(1 + f) + beta + eps

s is the path in water, delta what the scene's geometry and refraction change between the two media, alpha a
constant per colour (gain, n^2 of the window), beta the errors that all colours have in common: of a stay at a
distance, and of the spectra at a place (a lamp that flickers).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lightfield.arrays import Array
from lightfield.diagnosis.problem.quoted import ASSUMED_RELATIVE, own_part
from lightfield.diagnosis.problem.setup import budget_of
from lightfield.errors import MeasurementError
from lightfield.formula.closed_form import direct_field
from lightfield.formula.readout import Taken, halves, signal_of, spectra, time_factor
from lightfield.readings import Readings
from lightfield.readings.columns import PLACE_DECIMALS, WAVELENGTH_DECIMALS
from lightfield.readings.load_warning import Remarks
from lightfield.scene import Scene, Water
from lightfield.scene.acts import IN_WATER, Acts
from lightfield.scene.all_parameters import without
from lightfield.scene.parameters import fields_on, neutral_of
from lightfield.studies.attenuation.common_errors import stays
from lightfield.studies.attenuation.remark import Remark, Studied
from lightfield.studies.attenuation.seen import Seen, seen_by
from lightfield.studies.attenuation.shared_errors import (
    falls,
    of_places,
    own_share,
    sideways,
    stay_variance,
)

#: Readings below so many of their standard errors have no useful logarithm: its bias, half the squared
#: relative error, would reach the error of a stay (0.3 %).
_FAINT_SIGMA = 12.0
#: A reading is below zero, and not faint, by so many of its errors (chosen: of a thousand one by chance).
_BELOW_SIGMA = 3.0
#: Part of the brightest light that stands for none.
_NOTHING = 1e-9
#: What `Ratios` holds of each place, beside its stay.
_OF_PLACES = ("x_m", "y_m", "z_m", "path_m", "place_stderr", "geometry")
#: What `import` remarks of darks, in the head of its table.
_DARK_DOUBTS = {Remarks.NO_DARK.value, Remarks.LIT_DARK.value}
#: Entry of a table's head.
_PUBLISHED = "published_attenuation"
#: A slope needs so many distances.
FEWEST_DISTANCES = 2
#: What helps where readings are left out.
_REMEDIES = {
    Studied.FAINT: "read nearer, or longer: the errors are too large for a logarithm",
    Studied.NEGATIVE: "correct their sign, or take the dark signal off once",
    Studied.NOT_IN_AIR: "read water and air at the same places, in the same bands",
}
#: Repeats from which an error that the table does not state is taken.
_FEWEST_REPEATS = 3


@dataclass(frozen=True, eq=False)
class Ratios:
    """ln of water over air of one table, corrected for what the scene's geometry changes between them.

    Parameters
    ----------
    scene : Scene
        With bands that hold all the wavelengths.
    x_m, y_m, z_m, path_m : array, shape (n_places,), m
        Places, and the straight path in water from the lamp's window to each.
    stay : array of int, shape (n_places,)
        Distance at which each place was read: places of one share beta.
    stay_stderr : array, shape (n_stays,)
        Standard error of a stay.
    place_stderr : array, shape (n_places,)
        Standard error of the spectra of a place, beyond that of its stay and `stderr`: of what bands share,
        and of standing beside the place.
    wavelength_nm : array, shape (n_colours,), nm
    y, stderr : array, shape (n_places, n_colours)
        NaN where a colour was not read in both media.
    geometry : array, shape (n_places,)
        delta, already subtracted from y: what window and geometry make of a lamp in lossless water over air.
    reference : "air" or "formula"
        What the readings in water are divided by.
    seen : Seen
        Wavelengths that stand for each colour: itself, or those of its band.
    notes : tuple of Remark
        What was assumed or left out.
    published : tuple of (low_nm, high_nm, K in 1/m)
        What the table's head says was published of this water (`published_attenuation`), to compare with.
    """

    scene: Scene
    x_m: Array
    y_m: Array
    z_m: Array
    path_m: Array
    stay: NDArray[np.int_]
    stay_stderr: Array
    place_stderr: Array
    wavelength_nm: Array
    y: Array
    stderr: Array
    geometry: Array
    reference: str
    seen: Seen
    notes: tuple[Remark, ...] = ()
    published: tuple[tuple[float, float, float], ...] = ()

    @property
    def shared(self) -> tuple[Array, Array]:
        """How errors that all colours share act on each place, shape (n_places, n_shared), and their size.

        First those of stays, then those of places, if there are any.
        """
        H, size = stays(self.stay, len(self.stay_stderr)), self.stay_stderr
        if self.place_stderr.any():
            H = np.hstack([H, np.eye(len(self.place_stderr))])
            size = np.concatenate([size, self.place_stderr])
        return H, size

    @property
    def shared_stderr(self) -> Array:
        """Standard error that all colours share, shape (n_places,)."""
        return np.hypot(self.stay_stderr[self.stay], self.place_stderr)


def ratios_of(readings: Readings, scene: Scene, in_air: bool | None = None) -> Ratios:
    """Divide readings in water by those in air, or by what the formula says of a lamp in lossless water.

    Parameters
    ----------
    scene : Scene
        Lamp, tank and receiver; its water counts nowhere.
    in_air : bool, optional
        Divide by readings in air; default: if there are any.

    Raises
    ------
    MeasurementError
        Too few distances or media; readings that do not fit the scene.
    """
    scene = covering(scene, readings.wavelength_nm)
    table = readings.check_against(scene)
    table = table.subset((table.role == "signal") & ~table.saturated)
    where, air = readings.source or None, np.asarray(table.medium) == "air"
    if in_air is None:
        in_air = bool(air.any())
    if in_air and not air.any():
        raise MeasurementError(
            "no readings in air", where=where, rule='medium = "air" at the distances of those in water',
            remedy="measure in air, or let the formula stand for it (the beam is then the scene's)",
        )  # fmt: skip
    if not (~air).any():
        raise MeasurementError(
            "no readings in water", where=where, rule='medium = "water"', remedy="correct the column medium"
        )
    places, place = _labels(table.x_m, table.y_m, table.z_m, decimals=PLACE_DECIMALS)
    colours, colour = _labels(table.wavelength_nm, decimals=WAVELENGTH_DECIMALS)
    shape = (len(places), len(colours))
    light, slope = _light(table, scene, air, float(np.abs(readings.value).max()))
    # Of nothing there is no relative error: so little is as nothing.
    light = np.where(light == 0, _NOTHING * np.abs(light).max(), light)
    relative, notes = _relative_errors(table, light, slope, place * len(colours) + colour, air)
    common = np.nan_to_num(table.common_percent) / 100 * np.abs(table.value * slope / light)
    relative = own_part(relative, common)
    x, y, z = places.T
    lossless = without(scene, IN_WATER)
    clear = direct_field(lossless, x, y, z)
    thick = lossless.with_values({"water.absorption_per_m": 1.0}, validate=False)
    with np.errstate(invalid="ignore"):  # 0 / 0 where the receiver does not see the lamp: left out below
        path = np.log(clear / direct_field(thick, x, y, z))
    water, water_error = _means(light, relative, ~air, place, colour, shape)
    together = [_means(light, common, ~air, place, colour, shape)]
    other: Array = clear[:, None] * np.ones(shape)
    other_error: Array = np.zeros(shape)
    geometry = np.zeros(len(places))
    if in_air:
        other, other_error = _means(light, relative, air, place, colour, shape)
        together.append(_means(light, common, air, place, colour, shape))
        with np.errstate(invalid="ignore"):
            geometry = np.log(clear / direct_field(scene, x, y, z, medium=np.ones(len(places), bool)))
    bright = (
        (clear > 0)[:, None] & (water > _FAINT_SIGMA * water_error) & (other > _FAINT_SIGMA * other_error)
    )
    both = np.isfinite(water) & np.isfinite(other)
    if _DARK_DOUBTS & {*readings.metadata.get("imported", {}).get("remarks", ())}:
        notes.append(Remark(Studied.DARK_LEFT))
    if left := _left_in(scene):
        notes.append(Remark(Studied.READOUT_LEFT, why=", ".join(left)))
    below = both & ((water < -_BELOW_SIGMA * water_error) | (other < -_BELOW_SIGMA * other_error))
    left_out = {
        Studied.FAINT: (both & ~bright & ~below, int(both.sum()), _FAINT_SIGMA),
        Studied.NEGATIVE: (below, int(both.sum()), _BELOW_SIGMA),
        Studied.NOT_IN_AIR: (np.isfinite(water) & ~np.isfinite(other), None, None),
    }
    for what, (which, among, limit) in left_out.items():
        if count := int(which.sum()):
            notes.append(Remark(what, count, among, limit, first=_first(which, places, colours[:, 0])))
    with np.errstate(invalid="ignore", divide="ignore"):
        ln = np.where(bright, np.log(water / other), np.nan) - geometry[:, None]
        error = np.where(bright, np.hypot(water_error / water, other_error / other), np.nan)
    seen = seen_by(table, scene, colours[:, 0])
    if in_bands := int((seen.width_nm > 0).sum()):
        less = 100 * float(seen.hardened(Water(base="pure"), path[clear > 0]).max())
        notes.append(Remark(Studied.BANDS, in_bands, len(colours), float(seen.width_nm.max()), percent=less))
    distances, stay = np.unique(places[:, 2], return_inverse=True)
    budget = budget_of(table)
    if not budget.gain_stated:
        notes.append(Remark(Studied.GAIN_ASSUMED, percent=100 * budget.plane_gain))
    behind = scene.lamp.apparent_distance_m
    variance = stay_variance(
        table, air, distances, budget.plane_gain, budget.position_m, in_air, behind, falls(ln, path)
    )
    aside = sideways(lossless, table, air, places, place, budget.position_m, in_air)
    place_stderr = np.hypot(of_places(together), aside)
    found = Ratios(
        scene, x, y, z, path, stay, np.sqrt(variance), place_stderr, colours[:, 0], ln, error,
        geometry, "air" if in_air else "formula", seen, tuple(notes), _published(readings),
    )  # fmt: skip
    found = _enough(found, where)
    return found if np.isfinite(table.common_percent).any() else _as_bands_scatter(found)


def _as_bands_scatter(found: Ratios) -> Ratios:
    """With stated errors parted into what bands share and what is their own, where the table does not say.

    Whatever does not scatter between the bands is taken for shared: the error of each stays what was stated.
    """
    own = own_share(found.y, found.stderr, found.path_m)
    if own == 1:
        return found
    error = np.sqrt(1 - own) * found.stderr
    shared = of_places([(np.where(np.isfinite(error), 1.0, np.nan), error)])
    percent = 100 * float(np.median(shared))
    return replace(
        found,
        place_stderr=np.hypot(found.place_stderr, shared),
        stderr=np.sqrt(own) * found.stderr,
        notes=(*found.notes, Remark(Studied.SHARED_FROM_SCATTER, percent=percent)),
    )


def _left_in(scene: Scene) -> list[str]:
    """What the scene says that readings hold, and their ratio still does: paths of its parameters."""
    own = [e.name for e in scene.effect if not e.is_off and (e.stage == "readout" or e.speaks_of("time"))]
    ageing = [f"water.{name}" for name in fields_on(Water, Acts.AGEING) if name in neutral_of(Water)]
    return [path for path in ageing if scene.get(path)] + [f"effect.{name}" for name in own]


def _published(readings: Readings) -> tuple[tuple[float, float, float], ...]:
    """Bands and their attenuation in the table's head."""
    found = []
    for row in readings.metadata.get(_PUBLISHED, []):
        try:
            low, high, K = (float(v) for v in row)
        except (TypeError, ValueError):
            low = high = K = np.nan
        if not 0 < low < high < np.inf or not np.isfinite(K):
            raise MeasurementError(
                "an attenuation that was published makes no sense", where=readings.source or None,
                found=f"{_PUBLISHED}: {row}", rule="[from nm, to nm, 1/m]", remedy="correct the head",
            )  # fmt: skip
        found.append((low, high, K))
    return tuple(found)


def covering(scene: Scene, wavelength_nm: Array) -> Scene:
    """The scene with a band more where its own do not hold all the wavelengths of a table."""
    known = wavelength_nm[np.isfinite(wavelength_nm)]
    bands = scene.detector.bands_nm
    outside = [w for w in known if not any(low <= w <= high for low, high in bands)]
    if not outside:
        return scene
    low, high = float(min(outside)) - 0.5, float(max(outside)) + 0.5
    detector = scene.detector.model_copy(update={"bands_nm": (*bands, (max(low, 0.5), high))})
    return scene.model_copy(update={"detector": detector})


def _labels(*columns: Array, decimals: int) -> tuple[Array, NDArray[np.int_]]:
    """Different rows of rounded columns, shape (n, n_columns), and which of them each is."""
    rows, label = np.unique(np.round(np.stack(columns, 1), decimals) + 0.0, axis=0, return_inverse=True)
    return rows, label.ravel()


def _first(which: NDArray[np.bool_], places: Array, wavelength_nm: Array) -> str:
    """Place and wavelength of the first of some pairs, shape (n_places, n_colours), in words."""
    k, colour = np.argwhere(which)[0]
    (x, y, z), at = places[k], wavelength_nm[colour]
    aside = f"x = {x:g}, y = {y:g}, " if x or y else ""
    return f"{aside}z = {z:g} m" + (f", {at:g} nm" if np.isfinite(at) else "")


def _light(table: Readings, scene: Scene, air: NDArray[np.bool_], full: float) -> tuple[Array, Array]:
    """The light that was read as if the lamp were steady, and its derivative by the reading.

    Without what the scene says of background, planes' gains, saturation, stray light and second order.
    """
    spectrum = spectra(table.x_m, table.y_m, table.z_m, air, table.time_s)
    overlap = halves(spectrum, table.wavelength_nm)
    taken = Taken(air, spectrum, table.time_s, overlap, table.z_m, table.wavelength_nm)
    light, slope = signal_of(scene, table.value, full, taken)
    if np.isnan(light).any():
        raise MeasurementError(
            "readings are larger than this instrument shows", where=table.source or None,
            found=f"{int(np.isnan(light).sum())} of {len(light)}",
            rule="what detector.saturation leaves of any light",
            remedy="correct detector.saturation, or mark what saturates in the column saturated",
        )  # fmt: skip
    steady = time_factor(scene, table.time_s)
    return light / steady, slope / steady


def _relative_errors(
    table: Readings, light: Array, slope: Array, group: NDArray[np.int_], air: NDArray[np.bool_]
) -> tuple[Array, list[Remark]]:
    """Standard error over the light of each reading, from the table, from repeats, or assumed; and what was
    assumed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        stated = np.abs(table.stderr * slope / light)
    missing = ~(np.isfinite(stated) & (table.stderr > 0))
    if not missing.any():
        return stated, []
    _, label, count = np.unique(2 * group + air, return_inverse=True, return_counts=True)
    label = label.ravel()
    mean = np.bincount(label, light) / count
    squared = np.bincount(label, (light - mean[label]) ** 2)
    # What lies within its own scatter around nothing has no relative error: an absolute one, of all such.
    dark = mean**2 * count * (count - 1) < _FAINT_SIGMA**2 * squared
    free = np.where(dark, 0, count - 1)
    if count.max() >= _FEWEST_REPEATS and free.sum() > 0:
        scatter = float(np.sqrt((squared[~dark] / mean[~dark] ** 2).sum() / free.sum()))
        studied = Studied.STDERR_FROM_REPEATS
    else:
        scatter, studied = ASSUMED_RELATIVE, Studied.STDERR_ASSUMED
    error = np.full(len(light), scatter)
    if dark.any():
        absolute = np.sqrt(squared[dark].sum() / (count - 1)[dark].sum())
        with np.errstate(divide="ignore"):
            error = np.where(dark[label], absolute / np.abs(light), scatter)
    note = Remark(studied, int(missing.sum()), percent=100 * scatter)
    return np.where(missing, error, stated), [note]


def _means(
    light: Array,
    relative: Array,
    chosen: NDArray[np.bool_],
    place: NDArray[np.int_],
    colour: NDArray[np.int_],
    shape: tuple[int, int],
) -> tuple[Array, Array]:
    """Mean of the repeats of every place and colour, and its standard error; NaN where there are none."""
    flat, size = (place * shape[1] + colour)[chosen], shape[0] * shape[1]
    count = np.bincount(flat, minlength=size)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(flat, light[chosen], size) / count
        error = np.sqrt(np.bincount(flat, (relative * light)[chosen] ** 2, size)) / count
    return mean.reshape(shape), error.reshape(shape)


def _enough(found: Ratios, where: str | None) -> Ratios:
    """Only colours that were read at several distances."""
    known = np.isfinite(found.y)
    distances = np.array([len(np.unique(found.stay[column])) for column in known.T])
    keep = distances >= FEWEST_DISTANCES
    if not keep.any():
        left = [note for note in found.notes if note.studied in _REMEDIES]
        raise MeasurementError(
            "attenuation needs several distances", where=where,
            found="; ".join(
                [
                    f"{int(distances.max(initial=0))} with readings in water"
                    + (" and in air at the same places and wavelengths" if found.reference == "air" else ""),
                    *map(str, left),
                ]
            ),
            rule=f"at least {FEWEST_DISTANCES}, per wavelength",
            remedy="; ".join(_REMEDIES[note.studied] for note in left) or "read at more distances",
        )  # fmt: skip
    places = known[:, keep].any(axis=1)
    dropped = int((~keep).sum())
    more = (Remark(Studied.FEW_DISTANCES, dropped, limit=FEWEST_DISTANCES),) if dropped else ()
    used, stay = np.unique(found.stay[places], return_inverse=True)
    return replace(
        found,
        **{name: getattr(found, name)[places] for name in _OF_PLACES},
        stay=stay,
        stay_stderr=found.stay_stderr[used],
        wavelength_nm=found.wavelength_nm[keep],
        seen=found.seen.of(keep),
        y=found.y[np.ix_(places, keep)],
        stderr=found.stderr[np.ix_(places, keep)],
        notes=(*found.notes, *more),
    )
