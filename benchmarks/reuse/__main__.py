"""Re-used traces against fresh ones: in five tanks, everything that a sweep weighs anew instead of tracing.

    python -m benchmarks.reuse [--photons N] [--page FOLDER]

Nothing is asserted; the page says where the stated errors do not cover the difference.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from benchmarks.reuse import drawn as drawn_tanks
from benchmarks.reuse.fits import compare
from lightfield.render.diffuse.dense_water import CLEAR_PER_M
from lightfield.render.diffuse.source import REFERENCE_ALBEDO
from lightfield.render.maps import render_scene
from lightfield.render.response.grid import reference_of
from lightfield.scene import Scene
from lightfield.storage.files import write_text
from lightfield.sweep.sharing import MOST_SPREAD

HERE = Path(__file__).resolve().parent
PLANES = [2.0, 4.0, 6.0]
DETECTOR = {"planes_m": PLANES, "width_m": 1.0, "pixels": 9}
TANKS: dict[str, dict[str, Any]] = {
    "open water": {"lamp": {"hwhm_deg": 4.0}},
    "tow tank": {"lamp": {"hwhm_deg": 4.0}, "tank": {"surface": "flat", "wall_albedo": 0.3}},
    "narrow bright tank": {
        "lamp": {"hwhm_deg": 8.0},
        "tank": {"width_m": 1.2, "depth_m": 1.2, "length_m": 8.0, "wall_albedo": 0.8},
    },
    "shallow tank, mirror": {
        "lamp": {"hwhm_deg": 6.0},
        "tank": {"width_m": 3.0, "depth_m": 1.2, "length_m": 8.0, "surface": "flat"},
    },
    "short tank, wide lamp": {
        "lamp": {"hwhm_deg": 25.0},
        "tank": {"width_m": 2.0, "depth_m": 2.0, "length_m": 7.0, "wall_albedo": 0.6},
    },
}
WATER = {"absorption_per_m": 0.08, "scattering_per_m": 0.3, "phase": {"type": "henyey-greenstein", "g": 0.9}}
TEXT = """\
# Re-used traces

Made by `python -m benchmarks.reuse`. A sweep traces once and weighs the photons anew for other waters, walls
and surfaces; how far it may go is in `lightfield/sweep/sharing.py`. Here every weighed map stands beside a
fresh trace with other seeds, at the end of the allowed range, in five tanks: scattering down to the least
that shares a trace, absorption by 0.5 per metre, black walls and no surface from bright ones, colour.

`mean` is the mean ratio of diffuse light, weighed over fresh, with its error, plane by plane (2, 4, 6 m);
`stated` the median relative error that the weighed map states; `chi2/n` the mean square of the differences in
units of both stated errors (errors from ten batches: 1.3 is expected), and `p` the probability of a larger.

| tank | re-used | mean at 2, 4, 6 m | stated | chi2/n | p |
|---|---|---|---:|---:|---:|
{rows}

{photons:.0e} photons a trace. Of {n} comparisons {low} have p < 0.01.

## Fits

A fit traces once, with walls of {albedo:g} in water of b = {clear:g} per metre, and asks that trace for all
walls, waters and surfaces. `ratio` is its diffuse light over that of a fresh trace, the mean over five by
five places on each plane, with the error of the fresh trace; `stated` what the fit says of this mean.

| tank | asked | ratio at 2, 4, 6 m | stated |
|---|---|---|---|
{fits}

Of {n_fits} ratios {over} part from one by more than twice the stated error and the fresh trace's together.

## Tanks at random

{drawn} tanks with their lamps (off the axis, tilted, behind the window, with a window), floors, ends,
surfaces (with waves), gradients and views, all drawn at random: the light that a diagnosis ends with, traced
where the scene is, beside a fresh render of {photons:.0e} photons; means over twelve places on each of three
planes. Of {n_planes} means {two} are off by more than two of the stated errors and the render's together, and
{three} by more than three ({two_expected:.0f} and {three_expected:.1f} would be by chance, were these all of
chance); their root mean square is {rms:.2f}. Half of all means are off by less than {half:.1f} %.
{worst}
"""
#: Tanks for fits: walls everywhere.
FOR_FITS = {
    **{name: parts for name, parts in TANKS.items() if "tank" in parts},
    "small pool": {
        "lamp": {"hwhm_deg": 4.0},
        "tank": {"width_m": 2.5, "depth_m": 1.5, "length_m": 7.0, "surface": "flat", "wall_albedo": 0.7},
    },
    "pale floor, four times the walls": {
        "lamp": {"hwhm_deg": 8.0},
        "tank": {
            "width_m": 2.0,
            "depth_m": 1.5,
            "length_m": 7.5,
            "wall_albedo": 0.2,
            "floor_over_walls": 4.0,
        },
    },
    "short tank, black end": {
        "lamp": {"hwhm_deg": 8.0},
        "tank": {"width_m": 2.0, "depth_m": 1.5, "length_m": 7.0, "wall_albedo": 0.7, "end_over_walls": 0.0},
    },
}


def changes(scene: Scene) -> dict[str, dict[str, float]]:
    """What is re-used, and the values that a sweep would evaluate from the scene's own trace."""
    b = scene.water.scattering_per_m
    least = b - np.sqrt(MOST_SPREAD * b / max(PLANES))
    found = {
        "scattering, least": {"water.scattering_per_m": float(max(least, 0.02))},
        "absorption + 0.5": {"water.absorption_per_m": scene.water.absorption_per_m + 0.5},
        "dissolved matter": {"water.cdom_440_per_m": 1.0},
    }
    if scene.reflectances[0]:
        found["black walls"] = {"tank.wall_albedo": 0.0}
    if scene.reflectances[1]:
        found["no surface"] = {"tank.surface_reflectance": 0.0}
    return found


def compared(name: str, what: str, scene: Scene, other: Scene, photons: float) -> dict[str, Any]:
    """Weighed against fresh maps of the diffuse light, plane by plane."""
    at = np.array([525.0])
    known = dict(rel_error=1e-4, max_photons=photons, cache=False)
    shared = render_scene(other, reference=reference_of(scene), seed=1, **known)
    fresh = render_scene(other, seed=2, **known)
    (m1, e1), (m2, e2) = ((v[0] for v in r.relative_maps(at, "diffuse")) for r in (shared, fresh))
    ratios, errors = [], []
    for plane in range(len(PLANES)):
        one, two = m1[plane].sum(), m2[plane].sum()
        spread = np.hypot(
            np.hypot.reduce(e1[plane], axis=None) / one, np.hypot.reduce(e2[plane], axis=None) / two
        )
        ratios.append(one / two)
        errors.append(spread)
    pulls = (m1 - m2) / np.hypot(e1, e2)
    chi2, n = float((pulls**2).mean()), pulls.size
    p = float(stats.chi2.sf(chi2 / 1.29 * n, n))  # ten batches: t of nine degrees, variance 9/7
    stated = float(np.median(e1 / m1))
    return {
        "tank": name,
        "what": what,
        "ratios": ratios,
        "errors": errors,
        "stated": stated,
        "chi2": chi2,
        "p": p,
    }


def main() -> int:
    """Compare everywhere and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.reuse", description=__doc__)
    parser.add_argument("--photons", type=float, default=2e6, help="of every trace")
    parser.add_argument("--tanks", type=int, default=120, help="drawn at random")
    parser.add_argument("--page", type=Path, default=HERE)
    args = parser.parse_args()
    rows = []
    for name, parts in TANKS.items():
        scene = Scene.from_dict({"water": WATER, "detector": DETECTOR, **parts})
        for what, values in changes(scene).items():
            rows.append(compared(name, what, scene, scene.with_values(values), args.photons))
            print(rows[-1], file=sys.stderr)
    lines = [
        f"| {r['tank']} | {r['what']} | "
        + ", ".join(f"{v:.3f} ± {e:.3f}" for v, e in zip(r["ratios"], r["errors"], strict=True))
        + f" | {100 * r['stated']:.1f} % | {r['chi2']:.2f} | {r['p']:.2g} |"
        for r in rows
    ]
    fits, over = [], []
    for name, parts in FOR_FITS.items():
        scene = Scene.from_dict({"water": WATER, "detector": DETECTOR, **parts})
        for one in compare(name, scene, PLANES, args.photons):
            ratios = ", ".join(f"{v:.3f} ± {e:.3f}" for v, e in zip(one.ratio, one.fresh, strict=True))
            stated = ", ".join(f"{100 * v:.1f}" for v in one.stated)
            fits.append(f"| {one.tank} | {one.asked} | {ratios} | {stated} % |")
            over += list(np.abs(one.ratio - 1) > 2 * np.hypot(one.fresh, one.stated))
            print(fits[-1], file=sys.stderr)
    drawn = []
    for number in range(args.tanks):
        if (one := drawn_tanks.compare(number, args.photons)) is not None:
            drawn.append(one)
            print(number, one.off, one.error, file=sys.stderr)
    off = np.concatenate([one.off for one in drawn])
    pulls = np.abs(off / np.concatenate([one.error for one in drawn]))
    worst = [
        f"- {one.what}: {100 * v:+.1f} ± {100 * e:.1f} %"
        for one in drawn
        for v, e in zip(one.off, one.error, strict=True)
        if abs(v) > 3 * e
    ]
    text = TEXT.format(
        drawn=len(drawn), n_planes=len(pulls), two=(pulls > 2).sum(), three=(pulls > 3).sum(),
        two_expected=2 * stats.norm.sf(2) * len(pulls), three_expected=2 * stats.norm.sf(3) * len(pulls),
        rms=np.sqrt((pulls**2).mean()), half=100 * np.median(np.abs(off)), worst="\n".join(["", *worst]),
        rows="\n".join(lines), photons=args.photons, n=len(rows), low=sum(r["p"] < 0.01 for r in rows),
        fits="\n".join(fits), n_fits=len(over), over=sum(over), albedo=REFERENCE_ALBEDO, clear=CLEAR_PER_M,
    )  # fmt: skip
    args.page.mkdir(parents=True, exist_ok=True)
    write_text(args.page / "README.md", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
