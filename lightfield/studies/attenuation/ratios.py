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

from lightfield.arrays import Array, Mask
from lightfield.diagnosis.problem.quoted import own_part
from lightfield.diagnosis.problem.setup import budget_of
from lightfield.errors import MeasurementError
from lightfield.formula.closed_form import direct_field
from lightfield.readings import Readings
from lightfield.readings.load_warning import Remarks
from lightfield.scene import Scene, Water
from lightfield.scene.acts import IN_WATER, Acts
from lightfield.scene.all_parameters import without
from lightfield.scene.parameters import fields_on, neutral_of
from lightfield.studies.attenuation.common_errors import stays
from lightfield.studies.attenuation.means import (
    FAINT_SIGMA,
    PairMeans,
    Pairs,
    light_as_steady,
    relative_errors,
)
from lightfield.studies.attenuation.remark import Remark, Studied
from lightfield.studies.attenuation.seen import Seen, seen_by
from lightfield.studies.attenuation.shared_errors import falls, of_places, own_share, sideways, stay_variance

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
    scene = _covering(scene, readings.wavelength_nm)
    table = readings.check_against(scene)
    table = table.subset((table.role == "signal") & ~table.saturated)
    air = np.asarray(table.medium) == "air"
    if in_air is None:
        in_air = bool(air.any())
    where = readings.source or None
    _refuse_one_medium(air, in_air, where)
    media = (~air, air) if in_air else (~air,)
    pairs = Pairs.of(table)
    light, slope = light_as_steady(table, scene, air, float(np.abs(readings.value).max()))
    # Of nothing there is no relative error: so little is as nothing.
    light = np.where(light == 0, _NOTHING * np.abs(light).max(), light)
    relative, notes = relative_errors(table, light, slope, pairs.number, air)
    common = np.nan_to_num(table.common_percent) / 100 * np.abs(table.value * slope / light)
    relative = own_part(relative, common)
    lossless = without(scene, IN_WATER)
    clear, path, geometry = _straight(scene, lossless, pairs.places, in_air)
    water = pairs.means(light, relative, ~air)
    if in_air:
        other = pairs.means(light, relative, air)
    else:
        other = PairMeans(clear[:, None] * np.ones(pairs.shape), np.zeros(pairs.shape))
    bright, left_out = _bright(pairs, water, other, clear > 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ln = np.where(bright, np.log(water.mean / other.mean), np.nan) - geometry[:, None]
        stderr = np.where(bright, np.hypot(water.error / water.mean, other.error / other.mean), np.nan)
    seen, budget = seen_by(table, scene, pairs.wavelength_nm), budget_of(table)
    notes += [*_left_in(readings, scene), *left_out]
    if in_bands := int((seen.width_nm > 0).sum()):
        less = 100 * float(seen.hardened(Water(base="pure"), path[clear > 0]).max())
        notes.append(
            Remark(Studied.BANDS, in_bands, len(seen.width_nm), float(seen.width_nm.max()), percent=less)
        )
    if not budget.gain_stated:
        notes.append(Remark(Studied.GAIN_ASSUMED, percent=100 * budget.plane_gain))
    x, y, z = pairs.places.T
    distances, stay = np.unique(z, return_inverse=True)
    behind = scene.lamp.apparent_distance_m
    variance = stay_variance(
        table, media, distances, budget.plane_gain, budget.position_m, behind, falls(ln, path)
    )
    together = of_places([pairs.means(light, common, medium) for medium in media])
    aside = sideways(lossless, table, media, pairs.places, pairs.place, budget.position_m)
    found = Ratios(
        scene, x, y, z, path, stay, np.sqrt(variance), np.hypot(together, aside), pairs.wavelength_nm,
        ln, stderr, geometry, "air" if in_air else "formula", seen, tuple(notes), _published(readings),
    )  # fmt: skip
    found = _enough(found, where)
    return found if np.isfinite(table.common_percent).any() else _as_bands_scatter(found)


def _refuse_one_medium(air: Mask, in_air: bool, where: str | None) -> None:
    if in_air and not air.any():
        raise MeasurementError(
            "no readings in air", where=where, rule='medium = "air" at the distances of those in water',
            remedy="measure in air, or let the formula stand for it (the beam is then the scene's)",
        )  # fmt: skip
    if air.all():
        raise MeasurementError(
            "no readings in water", where=where, rule='medium = "water"', remedy="correct the column medium"
        )


def _straight(scene: Scene, lossless: Scene, places: Array, in_air: bool) -> tuple[Array, Array, Array]:
    """Of every place: the formula's light in lossless water, the straight path in water, m, and delta."""
    thick = lossless.with_values({"water.absorption_per_m": 1.0}, validate=False)
    (x, y, z), geometry = places.T, np.zeros(len(places))
    clear = direct_field(lossless, x, y, z)
    with np.errstate(invalid="ignore"):  # 0 / 0 where the receiver does not see the lamp: left out later
        path = np.log(clear / direct_field(thick, x, y, z))
        if in_air:
            geometry = np.log(clear / direct_field(scene, x, y, z, medium=np.ones(len(z), bool)))
    return clear, path, geometry


def _bright(pairs: Pairs, water: PairMeans, other: PairMeans, lit: Mask) -> tuple[Mask, list[Remark]]:
    """Pairs of place and colour that have a logarithm, and what is said of those left out."""
    bright, below = lit[:, None] & np.ones(pairs.shape, bool), np.zeros(pairs.shape, bool)
    for light in (water, other):
        bright &= light.mean > FAINT_SIGMA * light.error
        below |= light.mean < -_BELOW_SIGMA * light.error
    read, both = np.isfinite(water.mean), np.isfinite(water.mean) & np.isfinite(other.mean)
    left_out = {
        Studied.FAINT: (both & ~bright & ~below, int(both.sum()), FAINT_SIGMA),
        Studied.NEGATIVE: (both & below, int(both.sum()), _BELOW_SIGMA),
        Studied.NOT_IN_AIR: (read & ~both, None, None),
    }
    return bright, [
        Remark(what, int(which.sum()), among, limit, first=pairs.first(which))
        for what, (which, among, limit) in left_out.items()
        if which.any()
    ]


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


def _left_in(readings: Readings, scene: Scene) -> list[Remark]:
    """What readings hold beside the light, and their ratio still does: by their head, and by the scene."""
    notes = []
    if _DARK_DOUBTS & {*readings.metadata.get("imported", {}).get("remarks", ())}:
        notes.append(Remark(Studied.DARK_LEFT))
    ageing = [f"water.{name}" for name in fields_on(Water, Acts.AGEING) if name in neutral_of(Water)]
    left = [path for path in ageing if scene.get(path)]
    left += [
        f"effect.{e.name}"
        for e in scene.effect
        if not e.is_off and (e.stage == "readout" or e.speaks_of("time"))
    ]
    if left:
        notes.append(Remark(Studied.READOUT_LEFT, why=", ".join(left)))
    return notes


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


def _covering(scene: Scene, wavelength_nm: Array) -> Scene:
    """The scene with a band more where its own do not hold all the wavelengths of a table."""
    known = wavelength_nm[np.isfinite(wavelength_nm)]
    bands = scene.detector.bands_nm
    outside = [w for w in known if not any(low <= w <= high for low, high in bands)]
    if not outside:
        return scene
    low, high = float(min(outside)) - 0.5, float(max(outside)) + 0.5
    detector = scene.detector.model_copy(update={"bands_nm": (*bands, (max(low, 0.5), high))})
    return scene.model_copy(update={"detector": detector})


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
