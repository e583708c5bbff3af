"""What a study of attenuation says, to people and to programs."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from lightfield.arrays import evenly, finite
from lightfield.studies.attenuation.apparent import Apparent
from lightfield.studies.attenuation.common_errors import POOR_FIT, misfit_factor
from lightfield.studies.attenuation.constituents import LEVELS, Constituents
from lightfield.studies.attenuation.scattered import Scattered
from lightfield.studies.attenuation.study import Attenuation, Content, beer_lambert_is_off, only_without_grey
from lightfield.wording import capital, minus

#: So many colours are printed of more than so many, in a terminal and on a page; the data hold all.
_SHOWN, _ALL = 20, 30
#: Readings that part from the scene's water by more of their errors show another.
_OTHER_WATER_SIGMA = 4.0
#: An amount that is off by more of its stated errors than this is named.
_NOTEWORTHY_SIGMA = 2.0


def as_text(found: Attenuation) -> str:
    """The answer for people."""
    lines: list[str] = []
    for one in found.apparent:
        lines += _apparent_lines(one)
    if found.scattered is not None:
        lines += ["", "What K hides:", *scattered_sentences(found.scattered)]
        lines += scene_sentences(found)
    if found.content is not None:
        lines += ["", *content_lines(found.content), *content_sentences(found.content)]
    lines += [f"note: {note}" for note in note_sentences(found)]
    return "\n".join(lines)


def as_data(found: Attenuation) -> dict[str, Any]:
    """The answer for programs: every number with its error."""
    return {
        "apparent": [_apparent_data(one) for one in found.apparent],
        "scattered_light": None if found.scattered is None else _scattered_data(found.scattered),
        "constituents": None if found.content is None else _content_data(found.content),
        "notes": note_sentences(found),
        "remarks": [note.as_data() for note in found.notes],
    }


def note_sentences(found: Attenuation) -> list[str]:
    """What was assumed or left out, each once."""
    return list(dict.fromkeys(map(str, found.notes)))


def headline(found: Attenuation) -> str:
    """One sentence: what the first table says."""
    return loss_sentence(found.apparent[0])


def loss_sentence(one: Apparent) -> str:
    """How much the water takes where it takes least."""
    if grows := one.grows_at:
        return (
            f"Light in water grows with distance at {grows} of {len(one.K_per_m)} wavelengths, which no "
            "water does: are water and air exchanged in the column medium?"
        )
    k = int(np.argmin(one.K_per_m))
    percent, error = (float(v[k]) for v in one.percent())
    least = f", the least of {len(one.K_per_m)} wavelengths" if len(one.K_per_m) > 1 else ""
    return (
        f"At {one.ratios.wavelength_nm[k]:g} nm the receiver loses {percent:.1f} ± {max(error, 0.1):.1f} % "
        f"per metre (apparent attenuation K = {one.K_per_m[k]:.4f} ± {one.K_stderr[k]:.4f} per m){least}."
    )


def table_rows(one: Apparent) -> list[list[str]]:
    """Wavelength, K, per cent per metre, and per cent over the nearest and farthest distance, as text."""
    near, far = float(one.path_m.min()), float(one.path_m.max())
    columns = [one.percent(), one.percent(near), one.percent(far)]
    return [
        [
            f"{one.ratios.wavelength_nm[k]:g}",
            f"{one.K_per_m[k]:.4f} ± {one.K_stderr[k]:.4f}",
            *(f"{p[k]:.1f} ± {max(e[k], 0.1):.1f} %" for p, e in columns),
        ]
        for k in evenly(len(one.K_per_m), _SHOWN if len(one.K_per_m) > _ALL else _ALL)
    ]


def table_head(one: Apparent) -> tuple[str, ...]:
    """Heads of `table_rows`."""
    near, far = float(one.path_m.min()), float(one.path_m.max())
    return ("nm", "K (1/m)", "lost per m", f"lost over {near:.3g} m", f"lost over {far:.3g} m")


def fit_sentence(one: Apparent) -> str:
    """Do straight lines fit, and what that means."""
    e = one.estimate
    if e.dof <= 0:
        return "Two distances: nothing is left to test the straight line with."
    places = f"Of the {one.on_line.sum()} of {len(one.on_line)} places nearest to the beam's axis: "
    without = f"Without one ratio of readings ({one.set_aside}): "
    about = places * (not one.on_line.all()) + without * bool(one.set_aside)
    chi2 = f"chi-square {e.chi2:.1f} for {e.dof} degrees of freedom (p = {one.misfit_p:.2g})"
    text = f"{about}{chi2}: straight lines "
    if one.misfit_p > POOR_FIT:
        return text + "fit. That does not show that Beer-Lambert holds: scattered light keeps them straight."
    width, bends = float(one.ratios.seen.width_nm.max()), []
    if one.ratios.scene.reflects:
        bends.append(
            "light that walls or a surface send back bends the line, as told below where it was traced"
        )
    if width:
        bends.append(
            f"over a band of {width:g} nm the line bends by itself: what is dimmed most is gone first"
        )
    bent = f" ({'; '.join(bends)})" * bool(bends)
    return (
        f"{text}do not fit. The errors are stated too small, or more than attenuation is at work{bent}: "
        f"diagnose it. All errors of K are multiplied by {e.errors_times:.2g}, the root of chi-square over "
        f"degrees of freedom.{f' Most of it is one ratio of readings: {one.stray}.' * bool(one.stray)}"
    )


def scattered_sentences(found: Scattered) -> list[str]:
    """What the receiver sees of scattered light, and what that leaves of a and b."""
    k = int(np.argmin(found.combined))
    low, high = (float(f(found.share[:, k])) for f in (np.nanmin, np.nanmax))
    colour, kappa = f"{found.wavelength_nm[k]:g} nm", float(found.kappa[k])
    lines = []
    if found.told[k]:
        lines.append(
            f"At {colour} a = {found.a[k]:.4f} ± {found.a_stderr[k]:.4f} per m and b = {found.b[k]:.4f} ± "
            f"{found.b_stderr[k]:.4f} per m: this layout parts absorption from scattering. "
            f"{round(100 * low)} to {round(100 * high)} % of the light there had been scattered or reflected."
        )
    else:
        lines += [
            "This layout does not part absorption from scattering. "
            f"At {colour} it tells a + {kappa:.2f} b = {found.combined[k]:.4f} ± "
            f"{found.combined_stderr[k]:.4f} per m, with b anywhere up to {found.largest_b:.2g} per m. "
            f"Without scattering a would be {found.absorption_alone[k]:.4f} per m.",
            f"If b is {found.b[k]:.3f} per m there, {round(100 * low)} to {round(100 * high)} % of the light "
            "that arrives had been scattered or reflected. A second receiver that sees less of it (a "
            "collimator), or readings beside the beam, would part the two.",
        ]
    if found.misfit_p <= POOR_FIT:
        lines.append(
            f"But that does not fit the readings (chi-square {found.chi2:.0f} for {found.dof} degrees of "
            f"freedom): these a and b are not to be trusted, though their errors are multiplied by "
            f"{misfit_factor(found.chi2, found.dof):.2g}."
        )
    if not found.told.all() and found.told.any():
        lines.append(f"a and b are parted at {int(found.told.sum())} of {len(found.told)} wavelengths.")
    if found.other_kappa:
        others = " and ".join(f"{value:.2f} for g = {g:g}" for g, value in found.other_kappa.items())
        lines.append(f"The factor of b hangs on the phase function: {found.kappa.mean():.2f} here, {others}.")
    return lines


def scene_sentences(found: Attenuation) -> list[str]:
    """Where the readings show another water than the scene states, which other studies believe."""
    if found.scattered is None:
        return []
    one, expected = found.apparent[0], found.scattered.expected
    off = (one.K_per_m - expected) / one.K_stderr
    if np.abs(off).max() < _OTHER_WATER_SIGMA:
        return []
    k, least, stated = int(np.argmax(np.abs(off))), int(np.argmin(one.K_per_m)), int(np.argmin(expected))
    nm = one.ratios.wavelength_nm
    where = ""
    if np.ptp(expected) > one.K_stderr.min():  # else it is alike at all of them
        where = f"; attenuation would be least at {nm[stated]:g} nm, and is at {nm[least]:g} nm"
    would = round(float(expected[k]), 4) + 0.0  # nothing has no sign
    shown = f"{one.K_per_m[k]:.4f} ± {one.K_stderr[k]:.4f}"
    return [
        f"The scene states another water than the readings show: at {nm[k]:g} nm its K would be {would:.4f} "
        f"per m, not {shown}{where}. `band`, `range` and `link` believe the scene: write into it what was "
        "found here before asking them."
    ]


def content_rows(found: Content) -> list[list[str]]:
    """A row per constituent: each model's amount with its 68 % interval, or its 95 % limit."""
    models = _models(found)
    names = list(dict.fromkeys(name for m in models for name in m.amounts))
    rows = []
    for name in names:
        first = next(m.amounts[name] for m in models if name in m.amounts)
        rows.append([f"{first.name} ({first.unit})", *(amount_text(m, name) for m in models)])
    rows.append(["chi² / dof", *(f"{m.chi2:.0f} / {m.dof} (p = {m.p:.2g})" for m in models)])
    if any(m.rejected for m in models):
        rows.append(["rejected", *(f"errors × {m.errors_times:.2g}" if m.rejected else "no" for m in models)])
    return rows


def _models(found: Content) -> list[Constituents]:
    """In the order of `content_head`."""
    return [m for m in (found.traced, found.loose, found.beer_lambert) if m is not None]


def content_head(found: Content) -> tuple[str, ...]:
    """Heads of `content_rows`."""
    models = ("scattered light traced", "… and grey scattering free", "plain Beer-Lambert")
    return ("", *(models if found.traced is not None else models[2:]))


def amount_text(model: Constituents, name: str) -> str:
    """An amount with its 68 % interval; where 95 % reach to nothing, their upper end."""
    amount = model.amounts.get(name)
    if amount is None:
        return "–"
    if amount.found:
        wide = max((amount.high_68 - amount.low_68) / 2, 1e-8 * amount.high_68)
        digits = max(3, 2 + int(np.ceil(np.log10(amount.high_68 / wide))))
        return f"{amount.value:.{digits}g} ({amount.low_68:.{digits}g} to {amount.high_68:.{digits}g})"
    if others := model.instead_of(name):
        return f"0 to {amount.high_95:.2g}, or {' or '.join(model.amounts[o].name for o in others)}"
    return f"none found: < {amount.high_95:.2g}"


def content_lines(found: Content) -> list[str]:
    """`content_rows` for a terminal, with a head."""
    heads, lines = content_head(found)[1:], [f"Constituents ({LEVELS}):"]
    for row in content_rows(found):
        lines.append(row[0])
        lines += [f"    {head:<32} {cell}" for head, cell in zip(heads, row[1:], strict=True)]
    return lines


def content_sentences(found: Content) -> list[str]:
    """What Beer-Lambert gets wrong, and what the phase function is worth."""
    traced, wrong = found.traced, found.beer_lambert
    if traced is None:
        rejected = " It does not fit the readings: its amounts are not to be trusted." * wrong.rejected
        return [
            f"Without a trace only Beer-Lambert is left: it takes every scattered photon for lost.{rejected}",
            *_slope_sentences(found),
        ]
    lines = []
    if traced.rejected:
        lines.append(
            "Scattered light does not make these constituents fit the readings (chi-square / dof "
            f"{traced.chi2 / traced.dof:.2f}, p = {traced.p:.2g}): the fit is rejected, and these amounts "
            f"are not to be trusted, though the errors behind their intervals are multiplied by "
            f"{traced.errors_times:.2g}."
        )
    lines += _slope_sentences(found)
    lines += _not_told_apart(found)
    off = {k: v for k, v in beer_lambert_is_off(found).items() if abs(v[1]) > _NOTEWORTHY_SIGMA}
    if off:
        words = [
            f"{traced.amounts[name].name} {abs(100 * relative):.0f} % {'low' if relative < 0 else 'high'}, "
            f"{abs(sigma):.1f} of its stated errors"
            for name, (relative, sigma) in off.items()
        ]
        fits = "but it does not fit the readings" if wrong.rejected else "and it fits the readings"
        lines.append(
            f"Beer-Lambert finds {'; '.join(words)}; {fits} (chi-square / dof {wrong.chi2 / wrong.dof:.2f})."
        )
    for g, amounts in found.other_phases.items():
        values = ", ".join(
            f"{traced.amounts[name].name} {round(value, 4):.2g}" for name, value in amounts.items()
        )
        lines.append(f"With a phase function of g = {g:g} it would be {values}.")
    return lines


def _slope_sentences(found: Content) -> list[str]:
    """What another slope of CDOM would make of a model that does not fit."""
    other = found.other_slope
    if other is None:
        return []
    would = "it would fit" if other.fits else "it would fit better, not well"
    return [
        f"CDOM is taken to fall by {other.held_per_nm:g} per nm, as the scene says "
        f"(water.cdom_slope_per_nm); by {other.slope_per_nm:.4f} per nm {would} (chi-square "
        f"{other.chi2:.0f} of {other.dof}): measure it in filtered water, or state that."
    ]


def _not_told_apart(found: Content) -> list[str]:
    """Amounts that stand for each other, and what that makes of those that are found without the other."""
    lines = []
    for head, model in zip(content_head(found)[1:], _models(found), strict=True):
        for one in model.alternatives:
            names = " or ".join(model.amounts[name].name for name in one.names)
            lines.append(
                f"{capital(names)}: these readings cannot tell them apart ({head}). Each alone "
                f"may be nothing; all of them cannot: chi-square would rise by {one.rise:.3g}."
            )
    if found.traced is not None and (only := only_without_grey(found)):
        names = " and ".join(found.traced.amounts[name].name for name in only)
        lines.append(
            "The numbers of the first model hold only if nothing but the constituents scatters: its "
            f"{names} {'are' if len(only) > 1 else 'is'} no yardstick for Beer-Lambert."
        )
    return lines


def published_sentences(one: Apparent) -> list[str]:
    """What was published beside what is read here."""
    lines = []
    for low, high, K in one.ratios.published:
        mean, error = one.over(low, high)
        if np.isfinite(mean):
            lines.append(
                f"Published between {low:g} and {high:g} nm: K = {K:g} per m, "
                f"{100 * -np.expm1(-K):.1f} % per metre; here {mean:.4f} ± {error:.4f} per m, "
                f"{minus(f'{(mean - K) / error:+.1f}')} standard errors away."
            )
    return lines


def _apparent_lines(one: Apparent) -> list[str]:
    r = one.ratios
    mean, error = one.mean()
    colours, rows = len(one.K_per_m), table_rows(one)
    return [
        f"{r.scene.detector.quantity}, {len(r.path_m)} places, {colours} wavelength{'s' * (colours > 1)}, "
        + ("against readings in air" if r.reference == "air" else "against the formula in lossless water"),
        loss_sentence(one),
        "  ".join(f"{head:>17}" for head in table_head(one)),
        *("  ".join(f"{cell:>17}" for cell in row) for row in rows),
        *([f"({len(rows)} of {colours} wavelengths are shown)"] if len(rows) < colours else []),
        f"mean of all wavelengths {mean:.4f} ± {error:.4f} per m; of each error up to "
        f"{one.shared_stderr.max():.4f} per m is common to all wavelengths",
        fit_sentence(one),
        *published_sentences(one),
        *_one_distance_lines(one),
    ]


def _one_distance_lines(one: Apparent) -> list[str]:
    """What a single distance would have said; nothing where gains are unknown from the start."""
    r = one.ratios
    if r.reference != "air":
        return []
    shift, path_m = np.nanmean(one.one_distance() - one.K_per_m, axis=1)[one.on_line], one.path_m
    shown = ", ".join(
        f"{shift[at]:+.3f} per m at {path_m[at]:.3g} m"
        for at in (int(np.argmin(path_m)), int(np.argmax(path_m)))
    )
    return [f"from one distance alone, gain and window uncorrected: K off by {shown}"]


def _apparent_data(one: Apparent) -> dict[str, Any]:
    data = one.dataset()
    return {
        "quantity": one.ratios.scene.detector.quantity,
        **{str(name): values.values.tolist() for name, values in data.data_vars.items()},
        **{str(name): values.values.tolist() for name, values in data.coords.items()},
        **data.attrs,
        "misfit_p": finite(one.misfit_p),
        "mean_attenuation": list(one.mean()),
    }


def _scattered_data(found: Scattered) -> dict[str, Any]:
    names = (
        "wavelength_nm", "a", "a_stderr", "b", "b_stderr", "told", "kappa", "combined", "combined_stderr",
        "absorption_alone", "expected",
    )  # fmt: skip
    return {
        **{name: getattr(found, name).tolist() for name in names},
        "largest_b": found.largest_b,
        "share": found.share.tolist(),
        "chi2": found.chi2,
        "degrees_of_freedom": found.dof,
        "misfit_p": finite(found.misfit_p),
        "kappa_of_other_g": {f"{g:g}": value for g, value in found.other_kappa.items()},
    }


def _content_data(found: Content) -> dict[str, Any]:
    models = {"traced": found.traced, "grey_scattering_free": found.loose, "beer_lambert": found.beer_lambert}
    return {
        **{
            name: {
                "amounts": {k: asdict(v) | {"distinguished": v.found} for k, v in model.amounts.items()},
                "alternatives": [asdict(one) for one in model.alternatives],
                "chi2": model.chi2,
                "degrees_of_freedom": model.dof,
                "p": finite(model.p),
                "rejected": model.rejected,
                "errors_times": model.errors_times,
            }
            for name, model in models.items()
            if model is not None
        },
        "other_g": {f"{g:g}": amounts for g, amounts in found.other_phases.items()},
        "other_slope": None if found.other_slope is None else asdict(found.other_slope),
    }
