"""Which band serves best, as a page: signal and attenuation over wavelength, and what each band is worth."""

from __future__ import annotations

from matplotlib.figure import Figure

from lightfield.report.page import Section, Table, page_figure, study_page
from lightfield.report.style import (
    FORMULA,
    GOOD,
    MUTED,
    RENDER,
    SERIES,
    label,
    legend_under,
    panels,
    percent_axis,
)
from lightfield.studies.band.study import FLAT, WRONG, Bands
from lightfield.studies.band.text import (
    headline,
    of_the_scene,
    origin,
    rows,
    untold_sentences,
    water_sentence,
)


def band_figure(found: Bands, narrow: bool = False) -> Figure:
    """Left: what is left of the lamp's light and K. Right: what a band of that width is worth, far away."""
    at, z = found.spectrum.wavelength_nm.values, found.spectrum.z_m.values
    with panels(2, 4.6, narrow=narrow, each=3.8) as (fig, (left, right)):
        left.axvspan(*found.scene_band_nm, color=MUTED, alpha=0.15, linewidth=0)
        for k, far in enumerate(z):
            left.plot(
                at,
                found.spectrum.signal.values[k],
                color=SERIES[k % len(SERIES)],
                label=f"signal at {far:g} m",
            )
        K = found.spectrum.attenuation.values[-1]
        if not found.is_grey and K.min() > 0:
            left.plot(at, K.min() / K, color=MUTED, linestyle=(0, (2, 2)), label="least K over K")
        left.set_ylim(0, 1.05)
        percent_axis(left.yaxis)
        label(left, "wavelength (nm)", "of the largest", "What the detector sees of the lamp")
        row = found.bands.isel(z_m=-1)
        middle = 0.5 * (row.low_nm.values + row.high_nm.values)
        right.axvspan(*found.scene_band_nm, color=MUTED, alpha=0.15, linewidth=0)
        K = row.attenuation.values
        for values, shade, words in (
            *([] if found.is_grey or not K.min() > 0 else [(K.min() / K, FORMULA, "least attenuation")]),
            (row.signal.values, RENDER, "signal"),
            (row.information.values / row.information.values.max(), GOOD, "information about range"),
        ):
            right.plot(middle, values, color=shade, label=words)
            best = int(values.argmax())
            right.plot(middle[best], values[best], "o", color=shade)
        right.set_ylim(0, 1.08)
        percent_axis(right.yaxis)
        title = f"What a band of {found.width_nm:g} nm is worth at {z[-1]:g} m"
        label(right, "middle of the band (nm)", "of the best", title)
        for axes in (left, right):
            legend_under(axes)
    return fig


def band_page(found: Bands) -> str:
    """The page."""
    told = origin(found)
    grey = told.replace("as in", "the band of")
    drawing = page_figure(
        "band",
        f"Grey: {of_the_scene(found)}, {grey}. Dots: the best by each rule.",
        "Signal and attenuation over wavelength, and the worth of bands", band_figure, found,
    )  # fmt: skip
    low, high = found.flat_nm()
    row = found.bands.isel(
        z_m=-1, low_nm=int(abs(found.bands.low_nm.values - found.scene_band_nm[0]).argmin())
    )
    near = f"At {found.spectrum.z_m.values[0]:g} m attenuation"
    flat = f"{near} is within {100 * (FLAT - 1):.0f} % of its least from {low:g} to {high:g} nm."
    text = (
        water_sentence(found),
        *([] if found.is_grey else [flat]),
        *untold_sentences(found),
        f"With an attenuation {100 * WRONG:.0f} % wrong, a distance of {float(row.z_m):g} m read from the "
        f"size of a signal from {float(row.low_nm):g} to {float(row.high_nm):g} nm is "
        f"{abs(float(row.range_error_m)):.2f} m off.",
    )
    table = Table(
        f"{of_the_scene(found)}, {told}, against the best band (for attenuation: the least over its own).",
        ("at", "rule", "best band", "{:g}–{:g} nm has".format(*found.scene_band_nm)), rows(found), (1,),
    )  # fmt: skip
    title = f"{found.scene.name or 'Water'}: bands of {found.width_nm:g} nm"
    return study_page(
        title, headline(found), (), [Section("Bands", (drawing,), text, (table,))], found.scene.to_toml()
    )
