"""What a study of attenuation says, to people and to programs."""

from __future__ import annotations

from typing import Any

import numpy as np

from lightfield.arrays import Array
from lightfield.studies.attenuation.apparent import Apparent
from lightfield.studies.attenuation.study import Attenuation

#: So many colours are printed; the data hold all.
SHOWN = 12
#: Straight lines with a smaller probability than this do not fit.
POOR_FIT = 0.01


def as_text(found: Attenuation) -> str:
    """The answer for people."""
    lines: list[str] = []
    for one in found.apparent:
        lines += _apparent_lines(one)
    lines += [f"note: {note}" for note in found.notes]
    return "\n".join(lines)


def as_data(found: Attenuation) -> dict[str, Any]:
    """The answer for programs: every number with its error."""
    return {"apparent": [_apparent_data(one) for one in found.apparent], "notes": list(found.notes)}


def headline(one: Apparent) -> str:
    """One sentence: how much the water takes where it takes least."""
    k = int(np.argmin(one.K_per_m))
    percent, error = (float(v[k]) for v in one.percent())
    least = f", the least of {len(one.K_per_m)} wavelengths" if len(one.K_per_m) > 1 else ""
    return (
        f"At {one.ratios.wavelength_nm[k]:g} nm the receiver loses {percent:.1f} ± {error:.1f} % per metre "
        f"(apparent attenuation K = {one.K_per_m[k]:.4f} ± {one.K_stderr[k]:.4f} per m){least}."
    )


def table_rows(one: Apparent, most: int = SHOWN) -> list[list[str]]:
    """Wavelength, K, per cent per metre, and per cent over the nearest and farthest distance, as text."""
    near, far = float(one.ratios.path_m.min()), float(one.ratios.path_m.max())
    columns = [one.percent(), one.percent(near), one.percent(far)]
    return [
        [
            f"{one.ratios.wavelength_nm[k]:g}",
            f"{one.K_per_m[k]:.4f} ± {one.K_stderr[k]:.4f}",
            *(f"{p[k]:.1f} ± {e[k]:.1f} %" for p, e in columns),
        ]
        for k in some(len(one.K_per_m), most)
    ]


def table_head(one: Apparent) -> tuple[str, ...]:
    """Heads of `table_rows`."""
    near, far = float(one.ratios.path_m.min()), float(one.ratios.path_m.max())
    return ("nm", "K (1/m)", "lost per m", f"lost over {near:g} m", f"lost over {far:g} m")


def some(count: int, most: int) -> list[int]:
    """Indices of at most so many, evenly chosen, the first and the last among them."""
    return [int(i) for i in np.unique(np.linspace(0, count - 1, min(count, most)).round())]


def fit_sentence(one: Apparent) -> str:
    """Do straight lines fit, and what that means."""
    e = one.estimate
    if e.dof <= 0:
        return "Two distances: nothing is left to test the straight line with."
    text = f"chi-square {e.chi2:.1f} for {e.dof} degrees of freedom (p = {one.misfit_p:.2g}): straight lines "
    text += "fit. " if one.misfit_p > POOR_FIT else "do not fit at the stated errors. "
    return text + "A straight line does not show that Beer-Lambert holds: scattered light keeps it straight."


def _apparent_lines(one: Apparent) -> list[str]:
    r = one.ratios
    mean, error = one.mean()
    single, _ = one.one_distance()
    shift = np.nanmean(single - one.K_per_m, axis=1)
    return [
        f"{r.scene.detector.quantity}, {len(r.path_m)} places, {len(one.K_per_m)} wavelengths, against "
        + ("readings in air" if r.reference == "air" else "the formula in lossless water"),
        headline(one),
        "  ".join(f"{head:>17}" for head in table_head(one)),
        *("  ".join(f"{cell:>17}" for cell in row) for row in table_rows(one)),
        f"mean of all wavelengths {mean:.4f} ± {error:.4f} per m; of each error up to "
        f"{one.shared_stderr.max():.4f} per m is common to all wavelengths",
        fit_sentence(one),
        "from one distance alone, gain and window uncorrected: K off by "
        + ", ".join(
            f"{_signed(float(shift[at]))} per m at {r.path_m[at]:g} m"
            for at in (int(np.argmin(r.path_m)), int(np.argmax(r.path_m)))
        ),
    ]


def _signed(value: float) -> str:
    return f"{value:+.3f}"


def _apparent_data(one: Apparent) -> dict[str, Any]:
    data = one.dataset()
    return {
        "quantity": one.ratios.scene.detector.quantity,
        **{str(name): _list(values.values) for name, values in data.data_vars.items()},
        **{str(name): _list(values.values) for name, values in data.coords.items()},
        **data.attrs,
        "misfit_p": _number(one.misfit_p),
        "mean_attenuation": list(one.mean()),
    }


def _list(values: Array) -> Any:
    return np.where(np.isfinite(values), values, np.nan).tolist()


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
