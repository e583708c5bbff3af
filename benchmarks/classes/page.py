"""What the two codes say about each other, and the page that tells it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from benchmarks.classes.scenes import CLASSES, SCENES, Case
from benchmarks.classes.straight import direct_light

#: A mean over a plane, and a cell, are compared where both codes know them to so much.
MEAN_KNOWN, CELL_KNOWN = 0.05, 0.10
#: Random signs of the batches, from which the chi2 that is to be expected comes.
FLIPS, FLIP_SEED = 4000, 13
#: Classes of `walk.c` that belong to each of the package's as its tally tells them, and as they are named.
AS_TALLIED = ((0,), (1,), (2, 6), (3, 7), (4,), (5,))
AS_NAMED = ((0,), (1,), (2,), (3,), (4, 6), (5, 7))
WALLS_TWICE_AND_SURFACE = [6, 7]
#: Sums of classes that are compared as well.
DIFFUSE, ALL = "diffuse", "all light"
#: Ratios and p-values that are counted.
FAR, FARTHER, SMALL_P = 2.0, 3.0, 0.01
#: Less of all light is not told; smaller errors are told with a digit more.
LEAST_SHARE, FINE = 1e-4, 2e-4
#: Shares from here on are told to 1 %, smaller ones to one digit.
TENTH = 0.095
TEXT = """\
# Class by class against walked photons

Made by `python -m benchmarks.classes`; nothing is asserted. {scenes} scenes are rendered, and walked photon
by photon by a C program (`walk.c`) that shares nothing with the package. It takes its physics from the
definitions: Beer-Lambert, Henyey-Greenstein or Fournier-Forand, Lambert, Fresnel. Its walk is that of nature,
in double precision; only absorption is a weight. Compared is irradiance for unit radiant intensity on the
axis, the mean of cells, on three planes that face the lamp, for every class of light by itself and for all
together. {walked_least:.1e} to {walked_most:.1e} photons are walked in a scene, {renders} x {traced:.1e} are
traced; errors come from {walk_batches} and {render_batches} independent batches. The walks took
{walk_minutes:.0f} minutes, the renders {render_minutes:.0f}. The sum of the rendered classes is the map of
all light to {map_error:.0e}.

- `mirrors`: light that met the surface or panes. In tanks with panes what met walls too is light of `walls`.
- `part`: of all light on the three planes, %, as walked.
- `render / walk`: of the means over the planes, with the errors of both, where both codes know them to
  {mean_known:g} %. Planes of a scene share photons, and so have errors in common.
- `chi2/n`: mean square of the differences of cells in units of both errors, and in brackets what is expected
  of two codes that are right, with errors from so many batches. `n` cells count, those that both codes know
  to {cell_known:g} %; mirror images are averaged first. `p` is the probability of a larger sum. Expectation
  and `p` come from {flips} random signs of the batches, which keep what cells and planes have in common.

## Summary

Diffuse light, all that is not direct, is off by {typical:.2f} % (median of all planes) and by {largest:.2f} %
at most; the median error of these ratios is {diffuse_error:.2f} %. The farthest from one in errors is
{worst_diffuse}. Of the single classes it is
{worst}.
{low} of {with_cells} classes with cells have p < {small:g}; {small_expected:.1f} are expected.

In the table: how many ratios there are, how many differ from one by more than two and three of their errors
(expected of Student's t), the root mean square of these differences in errors, the weighted mean of ratios
less one, the median error of a ratio, and cells as above.

| class | ratios | > 2 | > 3 | rms | mean - 1 | error | chi2/n | n | p |
|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|
{summary}

## Every class

| scene | class | part | render / walk | chi2/n | n | p |
|---|---|---|---|---:|---:|---:|
{rows}

Planes:

{planes}

## Direct light without photons

Direct light is also integrated over the cells (`straight.py`): inverse square and Beer-Lambert, by Gauss's
rule. It tells which code is off where they differ. Here are means over planes over this integral, of the
render less one in millionths, and the mean square of the differences of cells in units of each code's own
error; {expected_render:.2f} and {expected_walk:.2f} are expected of normal errors from so many batches.

| scene | render / integral - 1, 1e-6 | chi2/n | walk / integral | chi2/n |
|---|---|---:|---|---:|
{direct}

## Walls twice and the surface

In a tank of walls and a surface, without panes, a tally keeps two reflections of each history: of light that
met walls twice or more it does not keep that it met the surface too. Such light counts with that of walls
alone. The table above compares like with like: walked light that met walls twice and the surface is counted
with walls. By the name of the classes it belongs to mirrors. Here it does, and rendered classes are off by
what they lack or have too much. All light together does not change; a trace that is weighed anew for another
surface does.

| scene | class | part | render / walk | chi2/n | n | p |
|---|---|---|---|---:|---:|---:|
{strict}
"""


@dataclass(frozen=True)
class Light:
    """The light of one scene by both codes.

    Parameters
    ----------
    walked, rendered : array, shape (n_batches, n_classes, n_planes, n, n), 1/m^2
        For unit on-axis radiant intensity; more classes of the walk.
    map_error : float
        Largest relative difference of the rendered classes' sum and the map.
    walk_s, render_s : float
        Time that they took.
    """

    case: Case
    walked: np.ndarray
    rendered: np.ndarray
    map_error: float
    walk_s: float
    render_s: float


@dataclass(frozen=True)
class Row:
    """One class of light of one scene.

    Parameters
    ----------
    share : array, shape (n_planes,)
        Of all light.
    ratio, stderr, freedom : array, shape (n_planes,)
        Mean over a plane, rendered over walked; its error and this one's degrees of freedom. NaN where too
        little is known.
    chi2, expected, p : float
        Mean square of the differences of cells in units of both errors, the same if both codes were right,
        and the probability of a larger. NaN without cells.
    cells : int
    flipped : array, shape (FLIPS,)
        Sums of squares if both codes were right.
    """

    scene: str
    kind: str
    share: np.ndarray
    ratio: np.ndarray
    stderr: np.ndarray
    freedom: np.ndarray
    chi2: float
    expected: float
    p: float
    cells: int
    flipped: np.ndarray

    @property
    def sigmas(self) -> np.ndarray:
        """Differences from one in units of their errors, shape (n_planes,)."""
        return (self.ratio - 1) / self.stderr

    def told(self) -> str:
        """The row as the page has it."""
        share = ", ".join(_percent(v) for v in self.share)
        pairs = zip(self.ratio, self.stderr, strict=True)
        ratios = ", ".join(_with_error(v, e) for v, e in pairs)
        return f"| {self.scene} | {self.kind} | {share} | {ratios} | {self.fit} |"

    @property
    def fit(self) -> str:
        """What cells say."""
        if not self.cells:
            return "– | 0 | –"
        return f"{self.chi2:.2f} ({self.expected:.2f}) | {self.cells} | {self.p:.2g}"


def _percent(share: float) -> str:
    if share < LEAST_SHARE:
        return f"< {100 * LEAST_SHARE:g}" if share else "0"
    return f"{100 * share:.0f}" if share >= TENTH else f"{100 * share:.1g}"


def _with_error(value: float, stderr: float) -> str:
    digits = 4 if stderr >= FINE else 5
    return f"{value:.{digits}f} ± {stderr:.{digits}f}" if np.isfinite(value) else "–"


def _in_millionths(value: float, stderr: float) -> str:
    return f"{1e6 * (value - 1):+.1f} ± {1e6 * stderr:.1f}"


def _of_batches(n: int) -> float:
    """Mean square of Student's t with n - 1 degrees of freedom."""
    return (n - 1) / (n - 3)


def folded(batches: np.ndarray, mirrored: tuple[str, ...]) -> np.ndarray:
    """Cells averaged with their mirror images, of which one half is kept.

    Parameters
    ----------
    batches : array, shape (..., n_y, n_x)
    mirrored : tuple of str
        Axes, "x" or "y".
    """
    for axis in (-1 if name == "x" else -2 for name in mirrored):
        mean = 0.5 * (batches + np.flip(batches, axis))
        batches = np.take(mean, np.arange((batches.shape[axis] + 1) // 2), axis)
    return batches


def _moments(batches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean over the first axis and its variance."""
    return batches.mean(axis=0), batches.var(axis=0, ddof=1) / len(batches)


def _known(batches: np.ndarray, limit: float) -> np.ndarray:
    """Where a mean over batches is known to so much."""
    mean, variance = _moments(batches)
    return (mean > 0) & (np.sqrt(variance) < limit * mean)


def _flipped(batches: np.ndarray, signs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means, and their variances, of deviations of batches with random signs; shape (n_signs, n)."""
    n = len(batches)
    apart = (batches - batches.mean(axis=0)) * np.sqrt(n / (n - 1))
    mean = signs @ apart / n
    return mean, np.maximum((apart**2).mean(axis=0) - mean**2, 0) / (n - 1)


def compare(case: Case, kind: str, walk: np.ndarray, render: np.ndarray, whole: np.ndarray) -> Row:
    """Compare one class of light.

    Parameters
    ----------
    walk, render : array, shape (n_batches, n_planes, n, n), 1/m^2
    whole : array, shape (n_planes,), 1/m^2
        All light.
    """
    one, two = (v.mean(axis=(2, 3)) for v in (render, walk))
    (mean_1, var_1), (mean_2, var_2) = _moments(one), _moments(two)
    unknown = np.full(mean_1.shape, np.nan)
    good = _known(one, MEAN_KNOWN) & _known(two, MEAN_KNOWN)
    ratio = np.divide(mean_1, mean_2, where=good, out=unknown.copy())
    part_1 = np.divide(var_1, mean_1**2, where=good, out=unknown.copy())
    part_2 = np.divide(var_2, mean_2**2, where=good, out=unknown.copy())
    # Welch and Satterthwaite.
    freedom = (part_1 + part_2) ** 2 / (part_1**2 / (len(one) - 1) + part_2**2 / (len(two) - 1))
    stderr = ratio * np.sqrt(part_1 + part_2)
    told = case.name, kind, mean_2 / whole, ratio, stderr, freedom
    cells_1, cells_2 = (folded(v, case.mirrored).reshape(len(v), -1) for v in (render, walk))
    lit = _known(cells_1, CELL_KNOWN) & _known(cells_2, CELL_KNOWN)
    n = int(lit.sum())
    if not n:
        return Row(*told, np.nan, np.nan, np.nan, 0, np.zeros(FLIPS))
    cells_1, cells_2 = cells_1[:, lit], cells_2[:, lit]
    (m1, v1), (m2, v2) = _moments(cells_1), _moments(cells_2)
    total = float(((m1 - m2) ** 2 / (v1 + v2)).sum())
    # The same signs for all classes of a scene, whose photons are the same.
    rng = np.random.default_rng([FLIP_SEED, SCENES.index(case)])
    (f1, w1), (f2, w2) = (
        _flipped(cells, rng.choice([-1.0, 1.0], (FLIPS, len(cells)))) for cells in (cells_1, cells_2)
    )
    flipped = ((f1 - f2) ** 2 / (w1 + w2)).sum(axis=1)
    return Row(*told, total / n, float(flipped.mean()) / n, _beyond(flipped, total), n, flipped)


def _beyond(flipped: np.ndarray, total: float) -> float:
    """Probability of a larger sum."""
    return float((1 + (flipped >= total).sum()) / (1 + FLIPS))


def compared(light: Light, classes: tuple[tuple[int, ...], ...] = AS_TALLIED) -> list[Row]:
    """Every class that the scene has, then diffuse light, and all.

    Parameters
    ----------
    classes : tuple of tuple of int
        Classes of the walk that belong to each of the package's.
    """
    case, mean = light.case, light.walked.sum(axis=1).mean(axis=(0, 2, 3))
    walked = [light.walked[:, list(own)].sum(axis=1) for own in classes]
    rendered = [light.rendered[:, k] for k in range(len(CLASSES))]
    names = [*CLASSES, DIFFUSE, ALL]
    for parts in (walked, rendered):
        diffuse = np.sum(parts[1:], axis=0)
        parts += [diffuse, parts[0] + diffuse]
    return [
        compare(case, name, walk, render, mean)
        for name, walk, render in zip(names, walked, rendered, strict=True)
        if walk.any() or render.any()
    ]


def _pooled(name: str, rows: list[Row]) -> str:
    """A line of the summary: ratios beyond their errors, and cells."""
    sigmas = np.concatenate([r.sigmas for r in rows])
    freedom = np.concatenate([r.freedom for r in rows])
    known = np.isfinite(sigmas)
    counts = ""
    for limit in (FAR, FARTHER):
        expected = 2 * stats.t.sf(limit, freedom[known]).sum()
        counts += f" {int((np.abs(sigmas[known]) > limit).sum())} ({expected:.1f}) |"
    best = np.concatenate([r.stderr for r in rows])[known]
    mean = np.average(np.concatenate([r.ratio for r in rows])[known], weights=best**-2)
    apart, n = np.sqrt(np.mean(sigmas[known] ** 2)), sum(r.cells for r in rows)
    total = sum(r.chi2 * r.cells for r in rows if r.cells)
    flipped = np.sum([r.flipped for r in rows], axis=0)
    return (
        f"| {name} | {known.sum()} |{counts} {apart:.2f} | {100 * (mean - 1):+.3f} % | "
        f"{100 * np.median(best):.2f} % | {total / n:.2f} ({flipped.mean() / n:.2f}) | {n} | "
        f"{_beyond(flipped, total):.2g} |"
    )


def _farthest(rows: list[Row]) -> str:
    """The ratio farthest from one in units of its error."""
    row = max(rows, key=lambda r: np.nanmax(np.abs(r.sigmas), initial=0.0))
    k = int(np.nanargmax(np.abs(row.sigmas)))
    return (
        f"{_with_error(row.ratio[k], row.stderr[k])} ({abs(row.sigmas[k]):.1f} errors; {row.scene}, "
        f"{row.kind}, plane {k + 1})"
    )


def _against_integral(light: Light) -> str:
    """Direct light of both codes over that without photons."""
    true = direct_light(light.case)
    whole, told = true.mean(axis=(1, 2)), []
    for direct in (light.rendered[:, 0], light.walked[:, 0]):
        mean, variance = _moments(direct.mean(axis=(2, 3)))
        pairs = list(zip(mean / whole, np.sqrt(variance) / whole, strict=True))
        told.append(", ".join(_with_error(v, e) if told else _in_millionths(v, e) for v, e in pairs))
        cells, exact = (folded(v, light.case.mirrored) for v in (direct, true))
        (m, v), lit = _moments(cells), _known(cells, CELL_KNOWN)
        told.append(f"{float(((m - exact)[lit] ** 2 / v[lit]).mean()):.2f}")
    return f"| {light.case.name} | {' | '.join(told)} |"


def page(lights: list[Light], rows: list[Row], factor: float, renders: int, photons: float) -> str:
    """The page of the benchmark.

    Parameters
    ----------
    rows : list of Row
        Of all lights.
    factor : float
        On all numbers of photons.
    renders : int
        Of every scene.
    photons : float
        Traced in every render.
    """
    single = [r for r in rows if r.kind in CLASSES]
    diffuse = [r for r in rows if r.kind == DIFFUSE]
    summary = [_pooled(name, [r for r in rows if r.kind == name]) for name in (*CLASSES, DIFFUSE, ALL)]
    both = [light for light in lights if light.walked[:, WALLS_TWICE_AND_SURFACE].any()]
    strict = [r for light in both for r in compared(light, AS_NAMED) if r.kind in CLASSES[2:]]
    off = np.concatenate([np.abs(r.ratio - 1) for r in diffuse])
    walked = [light.case.photons * factor for light in lights]
    with_cells = sum(r.cells > 0 for r in single)
    planes = [f"- {v.case.name}: {', '.join(f'{z:g}' for z in v.case.planes_m)} m" for v in lights]
    return TEXT.format(
        rows="\n".join(r.told() for r in rows),
        summary="\n".join(summary),
        strict="\n".join(r.told() for r in strict),
        planes="\n".join(planes),
        scenes=len(lights),
        walked_least=min(walked),
        walked_most=max(walked),
        walk_batches=len(lights[0].walked),
        render_batches=len(lights[0].rendered),
        renders=renders,
        traced=photons,
        mean_known=100 * MEAN_KNOWN,
        cell_known=100 * CELL_KNOWN,
        low=sum(r.p < SMALL_P for r in single),
        with_cells=with_cells,
        small=SMALL_P,
        small_expected=SMALL_P * with_cells,
        worst=_farthest(single),
        worst_diffuse=_farthest(diffuse),
        typical=100 * float(np.median(off)),
        largest=100 * float(off.max()),
        diffuse_error=100 * float(np.median(np.concatenate([r.stderr for r in diffuse]))),
        map_error=max(light.map_error for light in lights),
        flips=FLIPS,
        walk_minutes=sum(light.walk_s for light in lights) / 60,
        render_minutes=sum(light.render_s for light in lights) / 60,
        direct="\n".join(_against_integral(light) for light in lights),
        expected_walk=_of_batches(len(lights[0].walked)),
        expected_render=_of_batches(len(lights[0].rendered)),
    )
