"""Pages of poses and of their bias."""

from __future__ import annotations

import numpy as np

from lightfield.report.follower.page import light_in_words, page, section
from lightfield.report.follower.pose_figures import bias_figure, plane_figure, sequence_figure
from lightfield.report.page import page_figure
from lightfield.studies.follower.bias import BiasStudy, told_bias
from lightfield.studies.follower.calibration import CLEAR_PER_M
from lightfield.studies.follower.estimation.sequence import Poses
from lightfield.studies.follower.frames import in_degrees
from lightfield.studies.follower.information import is_told
from lightfield.wording import capital, minus, with_error

#: Samples that a table shows.
_MOST_ROWS = 40


def bias_page(study: BiasStudy) -> str:
    """Page of `pose bias`."""
    axis = study.axis
    rows = []
    for b in axis.scattering_per_m.values:
        for name in axis.calibration.values:
            one = axis.sel(scattering_per_m=b, calibration=name)
            cells = [
                minus(f"{round(1e3 * v):+d} ± {1e3 * s:.0f} ± {1e3 * t:.0f}")
                if is_told("z", max(abs(v), s))
                else "not determined"
                for v, s, t in zip(one.bias_z.values, one.sigma_z.values, one.trace_z.values, strict=True)
            ]
            rows.append([f"b = {b:g}", str(name), *cells, f"{one.misfit.values.max():.1f}"])
    own = study.scene.water.scattering_per_m
    verdict = _bias_headline(study)
    sections = [
        section(
            "Along the beam, in ever more turbid water",
            [
                page_figure(
                    "bias",
                    "Above zero the follower believes to be farther away than it is, and comes too near. "
                    "Bars: two standard deviations of the noise of one reading. Grey: 0.3 m.",
                    "Bias against scattering", bias_figure, study,
                )
            ],
            "Believed less true distance on the axis, mm, ± noise of one reading ± error of the trace. "
            "Last: how badly the formula explains the readings, chi2 per degree of freedom without noise; "
            "below 1 nobody notices.",
            ["water", "calibration", *(f"z = {z:g} m" for z in axis.z_m.values), "misfit"],
            rows,
        ),
        section(
            f"Over the formation space, b = {own:g} per metre",
            [
                page_figure(
                    "plane",
                    "From above, lamp below. Every arrow begins where the follower is and ends where it "
                    "believes to be.",
                    "Map of the bias", plane_figure, study,
                )
            ],
        ),
    ]  # fmt: skip
    lead = [
        "Readings without noise of the true light, explained by Gaussian beam, inverse square and "
        "Beer-Lambert. The formula is calibrated in four ways: with the true c = a + b; with K fitted on the "
        f"axis in this water; with K and gain from water of b = {CLEAR_PER_M:g} per metre; and with relative "
        "readings only."
    ]
    return page(
        "Bias of the formula",
        verdict,
        lead,
        sections,
        study.scene,
        [("light", light_in_words(study.traced))],
    )


def _bias_headline(study: BiasStudy) -> str:
    """The worst and the best calibration in the scene's own water, each with the trace's error there."""
    worst: dict[str, tuple[float, float]] = {}
    for name in study.plane.calibration.values:
        plane = study.plane.sel(calibration=name)
        bias = np.abs(told_bias(plane, "z").fillna(0.0).values).ravel()
        at = int(bias.argmax())
        worst[str(name)] = float(bias[at]), float(plane.trace_z.values.ravel()[at])
    most, least = max(worst, key=lambda k: worst[k][0]), min(worst, key=lambda k: worst[k][0])
    own = study.scene.water.scattering_per_m
    return (
        f"In water that scatters {own:g} per metre a follower that believes the formula is up to "
        f"{_with_trace(*worst[most])} wrong along the beam ({most}), at best {_with_trace(*worst[least])} "
        f"({least})."
    )


def _with_trace(bias_m: float, trace_m: float) -> str:
    """A bias with its error; what the trace does not tell from none is less than two of its errors."""
    if trace_m > 0 and bias_m < 2 * trace_m:
        return f"less than {max(2 * trace_m + bias_m, 0.01):.2f} m"
    return f"{bias_m:.2f}{f' ± {max(trace_m, 0.01):.2f}' if trace_m > 0 else ''} m"


def poses_page(poses: Poses) -> str:
    """Page of `pose estimate`."""
    rows = []
    for k, one in enumerate(poses.estimates[:_MOST_ROWS]):
        if one.lost or one.total is None:
            rows.append([f"{poses.time_s[k]:.2f}", *["–"] * len(poses.names), "light lost"])
            continue
        values = dict(zip(("x", "y", "z", "yaw", "pitch", "roll"), in_degrees(one.pose), strict=True))
        cells = [
            minus(with_error(values[n], s if n in "xyz" else np.degrees(s))) if is_told(n, s) else "unknown"
            for n, s in one.total.sigma.items()
        ]
        state = one.status
        state += ", ambiguous" * one.ambiguous
        state += f", {len(one.rivals)} rival{'s' * (len(one.rivals) > 1)}" if one.rivals else ""
        rows.append([f"{poses.time_s[k]:.2f}", *cells, f"{state} ({one.chi2:.0f})"])
    there = len(poses.estimates)
    cut = f" The first {_MOST_ROWS} of {there} readings; the figure shows all." if there > _MOST_ROWS else ""
    fit = (
        "all fit the light that is believed in"
        if not poses.lost + poses.misfits
        else f"{poses.lost} without light, {poses.misfits} that do not fit the light that is believed in"
    )
    if poses.ambiguous:
        fit += f"; {poses.ambiguous} ambiguous: another pose explains them as well"
    verdict = f"{poses.last_known}{there} readings: {fit}."
    followed = " Line and band: the filter, with two standard deviations of all that is not known."
    strange = " Red: light lost, or readings that do not fit."
    caption = "Points: every reading by itself, with its noise."
    caption += " Hollow: another pose does as well." * bool(poses.ambiguous)
    caption += followed * (poses.tracked is not None) + strange * bool(poses.lost + poses.misfits)
    sections = [
        section(
            "The way",
            [page_figure("way", caption, "Poses over time", sequence_figure, poses)],
            "Pose, with one standard deviation of all that is not known (noise, gain, water)." + cut,
            ["time (s)", *(f"{n} ({'m' if n in 'xyz' else 'deg'})" for n in poses.names), "fit (chi2)"],
            rows,
            (1 + len(poses.names),),
        )
    ]  # fmt: skip
    lead = [f"{capital(str(one))}." for one in poses.losses]
    lead += [f"{capital(poses.doubts)}."] if poses.doubts else []
    return page("Pose", verdict, lead, sections, poses.scene, [("light", light_in_words(poses.traced))])
