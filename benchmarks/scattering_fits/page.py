"""The page of the benchmark: how true what was found is, and how true its errors."""

from __future__ import annotations

import numpy as np

from benchmarks.scattering_fits.cases import (
    ABSORPTION_PER_M,
    BELIEVED_PER_M,
    CASES,
    COLOURS,
    DARK,
    HWHM_DEG,
    HWHM_IN_TANK_DEG,
    PHOTONS,
    PLANES_M,
    RELATIVE,
    RINGS_M,
    STAY,
    TANK_M,
    WIDER,
    Case,
)

MODES = ("search", "diagnose")
FOUND = (
    "water.scattering_per_m", "water.phase.g", "water.absorption_per_m", "lamp.hwhm_deg",
    "lamp.apparent_distance_m", "tank.wall_albedo", "water.cdom_440_per_m",
)  # fmt: skip
#: Stated, and were what is named all that acts.
ERRORS = ("error", "error of set")
INTRODUCTION = f"""\
# What is found in scattering water

Made by `python -m benchmarks.scattering_fits`; nothing is asserted. Readings on a scan through the axis in
{len(PLANES_M)} planes ({PLANES_M[0]} to {PLANES_M[-1]} m, to {RINGS_M[-1]} m aside), their scattered light
walked photon by photon (`walk.c`, {PHOTONS:.0e} photons) by code that shares nothing with the package;
errors of {100 * RELATIVE:g} % of a reading, {100 * DARK:g} % of the largest, {100 * STAY:g} % of a stay.
True are a half width of {HWHM_DEG:g} degrees and an absorption of {ABSORPTION_PER_M:g} per m; the
experimenter believes in {WIDER * HWHM_DEG:.1f} and {BELIEVED_PER_M:g}, and in no scattering.
Rows with walls are of a tank {TANK_M[0]:g} m wide, {TANK_M[1]:g} m deep and {TANK_M[2] + TANK_M[3]:g} m long,
taken for black, and of a lamp of {HWHM_IN_TANK_DEG:g} degrees
({", ".join(f"{c.photons:.0e} photons with walls of {c.walls:g}" for c in CASES if c.walls)}).
With CDOM (its absorption at 440 nm in 1/m) every place is read at
{", ".join(f"{at:g}" for at, _ in COLOURS)} nm, in water whose colour is known but for the dissolved matter.

`search`: all light from one trace in other water, reweighed (`diffuse=response_for`). `diagnose`: the same,
then settled with light that is followed without photons, times a traced ratio. Pull: found less true over the
stated error; its root mean square over the seeds should be near one. Within 1 and 2: how often the true b
lies within so many stated errors, with the binomial error of that part (Agresti and Coull 1998); all: the
same of all numbers that were fitted, which hang together: their parts are known about as well as those of b.
Named: what is hidden and nothing else; the numbers of a row are of these sets.
A seed is that of the readings' noise and of the traces that settle a fit.

Stated errors are averages over models: they know of effects that are too small to be named, of which there
are none here, and are too wide for it. Of set: the same part of all numbers by the errors that hold if what
is named is all that acts (`stderr_of_set`).

Noise: the variance of the readings' errors as judged over the stated one, mean of the sets; the stated is
right.

Between walls scattering is hardly told from absorption: walls alone, more absorption and a wider beam meet
the readings too. The simpler model is named, for sure. Its errors reach what its values would be with
scattering of the scene's phase function, and a warning says so; the values themselves stay those without.

| truth, 1/m | light | n | named | b | stated | scatter | pull | rms | in 1 | in 2 | all | of set | noise |
|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|
"""


def page(rows: list[dict[str, str]]) -> str:
    """The page of the benchmark."""
    lines = INTRODUCTION.splitlines()
    for case in CASES:
        for mode in MODES:
            lines.append(_line(case, mode, _of(rows, case, mode), "water.scattering_per_m"))
    lines += ["", *_otherwise(rows)]
    lines += [
        "",
        "Pulls of every number, of all rows, and how often the truth lies within one and two errors (68 and",
        "95 % if errors are right), with the binomial error of that part; at the end of all numbers, with",
        "the error that the scatter between sets tells. Sets named otherwise are in the list above alone.",
        "",
        "| parameter | light | n | pull, mean | pull, rms | within 1 | within 2 |",
        "|---|---|---:|---:|---:|---:|---:|",
    ]
    for path in FOUND:
        for mode in MODES:
            pulls = np.concatenate([_pulls(c, _named(c, _of(rows, c, mode)), path) for c in CASES])
            if len(pulls):
                inside = [_share(np.abs(pulls) < k) for k in (1, 2)]
                lines.append(
                    f"| `{path}` | {mode} | {len(pulls)} | {pulls.mean():+.2f} | "
                    f"{np.sqrt(np.mean(pulls**2)):.2f} | {inside[0]} | {inside[1]} |"
                )
    lines += [
        _together(rows, mode, error, name)
        for error, name in zip(ERRORS, ("all", "all, by errors of set"), strict=True)
        for mode in MODES
        if any(_named(c, _of(rows, c, mode)) for c in CASES)
    ]
    lines += [
        "",
        "Processor time of a diagnosis without advice, s, median (a first one also traces for the search):",
        "",
    ]
    for mode in MODES:
        spent = [float(r["seconds"]) for r in rows if r["mode"] == mode]
        if spent:
            lines.append(f"- {mode}: {np.median(spent):.1f} (largest {max(spent):.0f})")
    return "\n".join(lines) + "\n"


def _of(rows: list[dict[str, str]], case: Case, mode: str) -> list[dict[str, str]]:
    """What was found in one case one way."""
    return [r for r in rows if (r["case"], r["mode"]) == (case.name, mode)]


def _known(rows: list[dict[str, str]], path: str, error: str = "error") -> tuple[np.ndarray, np.ndarray]:
    """Values and errors of what has both."""
    pairs = [(r[path], r[f"{path} {error}"]) for r in rows if r.get(path) and r.get(f"{path} {error}")]
    found = np.array(pairs, float).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _pulls(case: Case, rows: list[dict[str, str]], path: str, error: str = "error") -> np.ndarray:
    if path not in case.truth:
        return np.zeros(0)
    value, sigma = _known(rows, path, error)
    return (value - case.truth[path]) / sigma


def _all_pulls(case: Case, rows: list[dict[str, str]], error: str) -> np.ndarray:
    """Of all that is known of a case."""
    return np.concatenate([_pulls(case, rows, path, error) for path in case.truth])


def _share(inside: np.ndarray) -> str:
    """Part of the pulls that are inside, with its binomial standard error (of two more of either kind)."""
    near, n = (float(np.sum(inside)) + 2) / (len(inside) + 4), len(inside) + 4
    return f"{100 * np.mean(inside):.0f} ± {100 * np.sqrt(near * (1 - near) / n):.0f} %"


def _named(case: Case, rows: list[dict[str, str]]) -> list[dict[str, str]]:
    """Where what is hidden was named, and nothing else."""
    return [r for r in rows if set(r["effects"].split(" + ")) == case.hidden]


def _otherwise(rows: list[dict[str, str]]) -> list[str]:
    """What was named in place of what is hidden, and how far its numbers are from the truth."""
    lines = []
    for case in CASES:
        for mode in MODES:
            other = [r for r in _of(rows, case, mode) if r not in _named(case, [r])]
            for name in sorted({r["effects"] for r in other}):
                here = [r for r in other if r["effects"] == name]
                sure = sum(r["verdict"] == "identified" for r in here)
                pulls = ((path, _pulls(case, here, path)) for path in case.truth)
                off = ", ".join(
                    f"`{path}` {np.mean(_known(here, path)[0]):.3g} (pull {p.mean():+.1f})"
                    for path, p in pulls
                    if len(p)
                )
                lines.append(
                    f"- {case.name}, {mode}: {len(here)} named `{name or 'nothing'}`, {sure} for sure; "
                    f"mean {off or 'of nothing'}."
                )
    return ["Named otherwise:", "", *(lines or ["- none"])]


def _together(rows: list[dict[str, str]], mode: str, error: str, name: str) -> str:
    """Pulls of all numbers of all sets, those of one set as often as they hang together."""
    sets = [
        np.abs(_all_pulls(case, [r], error)) for case in CASES for r in _named(case, _of(rows, case, mode))
    ]
    every = np.concatenate(sets)
    inside = []
    for k in (1, 2):
        parts = np.array([np.mean(pulls < k) for pulls in sets])
        inside.append(f"{100 * parts.mean():.0f} ± {100 * parts.std(ddof=1) / np.sqrt(len(parts)):.0f} %")
    rms = np.sqrt(np.mean(every**2))
    return f"| {name} | {mode} | {len(every)} of {len(sets)} sets | | {rms:.2f} | {inside[0]} | {inside[1]} |"


def _line(case: Case, mode: str, found: list[dict[str, str]], path: str) -> str:
    rows = _named(case, found)
    (value, error), pulls = _known(rows, path), _pulls(case, rows, path)
    head = f"| {case.name} | {mode} | {len(found)} | {len(rows)} |"
    if not len(value):
        return f"{head} | | | | | | | | | |"
    scatter = f"{value.std(ddof=1):.3f}" if len(value) > 1 else ""
    parts = " | ".join(
        f"{100 * np.mean(every < 1):.0f}, {100 * np.mean(every < 2):.0f} %"
        for every in (np.abs(_all_pulls(case, rows, error)) for error in ERRORS)
    )
    noise = [float(r["noise"]) for r in rows if r.get("noise")]
    return (
        f"{head} {value.mean():.3f} | {error.mean():.3f} | {scatter} | {pulls.mean():+.1f} | "
        f"{np.sqrt(np.mean(pulls**2)):.1f} | {_share(np.abs(pulls) < 1)} | {_share(np.abs(pulls) < 2)} | "
        f"{parts} | " + (f"{np.mean(noise):.2f} |" if noise else "|")
    )
