"""What a study of the link says, to people and to programs."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lightfield.arrays import jsonable
from lightfield.scene.acts import Acts
from lightfield.scene.parameters import switched_off
from lightfield.studies.follower.survey import DOCKING_ASKS
from lightfield.studies.link.receiver import SEEN_HZ, SEEN_SNR
from lightfield.studies.link.study import Link, Reaches
from lightfield.studies.working_range.reaches import Reach
from lightfield.studies.working_range.text import POSE_WORDS, UNTOLD


class Reported(NamedTuple):
    """A distance at which vehicles are reported to have found a dock or each other by light, to compare with.

    It is not computed here; lamps, receivers and waters differ from one report to the next.

    Parameters
    ----------
    from_m, to_m : float, m
        Range of what was reported; `from_m` is 0 where only the farthest distance was.
    water, source : str
    """

    from_m: float
    to_m: float
    water: str
    source: str

    def __str__(self) -> str:
        """The distance."""
        return f"up to {self.to_m:g} m" if not self.from_m else f"{self.from_m:g} to {self.to_m:g} m"


_THESIS = "Eren 2015, thesis, University of New Hampshire, scholars.unh.edu/dissertation/2193"
_REPORTED = (
    Reported(0.0, 20.0, "K = 0.05 per m, 400 W lamp", _THESIS),
    Reported(0.0, 8.0, "K = 0.1 per m, 400 W lamp", _THESIS),
    Reported(
        10.0, 15.0, "turbid bay", "Cowen, Briest and Dombrowski 1997, Proc. OCEANS, 1143, as cited by others"
    ),
    Reported(20.0, 28.0, "not told", "second hand; no first source is known to us"),
)


def headline(found: Link) -> str:
    """One sentence: range for data in the scene's water."""
    r, rate = found.reaches["scene"], found.receiver.bit_rate_per_s
    least, far = (float(found.dataset.z_m[k]) for k in (0, -1))
    return (
        f"{rate / 1e6:g} Mbit/s reach {_data(r, far, least)} in the "
        f"scene's water; exp(−cz) says {reached(r.data_formula_m, most=far, least=least)}."
    )


HEAD = (
    "water",
    "a, b (1/m)",
    "data",
    "data, with echoes",
    "data, exp(−cz)",
    "docking",
    "docking, exp(−cz)",
    "seen",
    "seen, exp(−cz)",
)
#: What is asked of each column.
_ASKED = (
    "Open water, on the beam's axis: walls and surface of a tank are left out. Docking: where an array of "
    f"receivers on the axis knows its pose to {DOCKING_ASKS} (Cramer-Rao bound of one reading; gain "
    "and water known as the scene says, or to 5 % and 20 %; "
    f"as in `range`). Seen: a signal {SEEN_SNR:g} times the noise in {SEEN_HZ:g} Hz, no pose. Echoes: "
    "scattered light that comes late into the next bits."
)
_UNIFORM = "Uniform water: the scene's gradients, layers and hardening of its absorption are left out."
#: Distances at which the bandwidth is told, m, as far as they were asked about.
_BANDWIDTH_AT_M = (10.0, 20.0, 40.0)
REPORTED_HEAD = ("reported", "water", "source")


def rows(found: Link) -> list[list[str]]:
    """A row per water, in the order of `HEAD`."""
    table = []
    least, far = float(found.dataset.z_m[0]), float(found.dataset.z_m[-1])
    for k, (name, r) in enumerate(found.reaches.items()):
        a, b = (float(found.dataset[n].values[k]) for n in ("absorption", "scattering"))
        docking, near = r.docking, found.docking_to_m
        table.append([
            name, f"{a:.3g}, {b:.3g}", _data(r, far, least),
            *(reached(at, most=far, least=least) for at in (r.data_with_echoes_m, r.data_formula_m)),
            docked(docking, near, least),
            nearer(docking.formula_near_m)
            + reached(docking.formula_m, from_m=docking.formula_from_m, most=near, least=least),
            surely(reached(r.seen_m, r.seen_stderr_m, most=far, least=least), r.seen_sure_m),
            reached(r.seen_formula_m, most=far, least=least),
        ])  # fmt: skip
    return table


def _data(reaches: Reaches, most: float, least: float) -> str:
    return surely(reached(reaches.data_m, reaches.data_stderr_m, most=most, least=least), reaches.data_sure_m)


def bandwidth_sentence(found: Link) -> str:
    """Bandwidth of the water by the traced paths in the scene's water."""
    data = found.dataset.isel(water=0)
    z = data.z_m.values
    parts = []
    told = [far for far in _BANDWIDTH_AT_M if z[0] <= far <= z[-1]]
    for far in told or [float(z[-1])]:  # nearer than all of them: at the farthest that was asked
        at, error = (
            float(np.interp(far, z, data[name].values)) / 1e6
            for name in ("bandwidth_hz", "bandwidth_stderr_hz")
        )
        before = float(data.bandwidth_hz.values[max(int(np.searchsorted(z, far, side="right")) - 1, 0)])
        unknown = "no limit" if np.isinf(before) else "too few photons to say"
        shown = f"{at:.0f} ± {max(error, 1):.0f} MHz" if np.isfinite(at + error) else unknown
        parts.append(f"{shown} at {far:g} m")
    return (
        "Bandwidth by the lengths of the traced paths (3 dB, electrical), in the scene's water: "
        + ", ".join(parts)
        + ". The errors are those of the photons, of the steps in which paths are tallied, and of what lies "
        "between the distances asked at."
    )


def asked_words(found: Link) -> tuple[str, ...]:
    """What is asked of each column, and what of the scene has no say in it."""
    uniform = switched_off(found.scene.water, Acts.LAYERS | Acts.HARDENING)
    return (_ASKED,) if uniform else (_ASKED, _UNIFORM)


def in_band_words(found: Link) -> str:
    """How much of the lamp's power counts."""
    low, high = found.scene.detector.bands_nm[0]
    return f"of which {found.in_band_w:.3g} W count, from {low:g} to {high:g} nm"


def keying_words(found: Link) -> str:
    """How power becomes bits."""
    return (
        f"on-off keying at {found.receiver.bit_rate_per_s:g} bit/s: a one has twice that power, a zero none, "
        "so that the mean is the lamp's"
    )


def as_text(found: Link) -> str:
    """The answer for people."""
    receiver = found.receiver
    lines = [headline(found), ""]
    for row in [list(HEAD), *rows(found)]:
        lines.append(f"{row[0]:<8}{row[1]:<14}" + "".join(f" {cell:>22}" for cell in row[2:]))
    reported = "; ".join(f"{r} ({r.water}; {r.source})" for r in _REPORTED)
    return "\n".join([
        *lines, bandwidth_sentence(found), *asked_words(found),
        f"{found.scene.lamp.power_w:g} W lamp, {in_band_words(found)}; {receiver.area_mm2:g} mm² diode of "
        f"{receiver.responsivity_a_per_w:g} A/W, amplifier {receiver.noise_a_per_sqrt_hz:g} A/√Hz, "
        f"background {receiver.background_a:g} A, error rate {receiver.ber:g}, {keying_words(found)}.",
        f"Others report, with lamps and receivers of their own: {reported}.",
    ])  # fmt: skip


def reported_rows() -> list[list[str]]:
    """A row per report, in the order of `REPORTED_HEAD`."""
    return [[str(r), r.water, r.source] for r in _REPORTED]


def reached(
    value: float,
    stderr: float = float("nan"),
    from_m: float = float("nan"),
    most: float = 0.0,
    least: float = 0.0,
    from_stderr: float = float("nan"),
) -> str:
    """A distance with its error, or that it lies beyond what was asked; and where it begins to hold."""
    if np.isfinite(from_m):
        return f"{reached(from_m, from_stderr)} to {reached(value, stderr, most=most)}"
    if np.isnan(value):
        return f"nowhere from {least:g} m on" if least else "nowhere"
    if np.isinf(value):
        return f"> {most:g} m" if most else "farther than asked"
    return f"{value:.1f} ± {max(stderr, 0.1):.1f} m" if np.isfinite(stderr) else f"{value:.1f} m"


def nearer(end_m: float) -> str:
    """Where it ends to hold near the lamp, if it does again farther away."""
    return f"to {reached(end_m)}, " if np.isfinite(end_m) else ""


def docked(reach: Reach, most: float, least: float) -> str:
    """Where an array knows its pose well enough, as far as the photons tell."""
    if not reach.is_told:
        return UNTOLD
    words = reached(reach.z_m, reach.stderr_m, reach.from_m, most, least, reach.from_stderr_m)
    return surely(nearer(reach.near_m) + words, reach.sure_m)


def surely(words: str, sure_m: float) -> str:
    """A distance in words, and up to where it is sure, where that is nearer."""
    return f"{words} ({sure_m:.1f} m for sure)" if np.isfinite(sure_m) else words


def as_data(found: Link) -> dict[str, Any]:
    """The answer for programs."""
    data = found.dataset
    return {
        "reaches": {
            name: {
                **{k: jsonable(v) for k, v in vars(r).items() if k != "docking"},
                "docking": jsonable({"rule": POSE_WORDS[r.docking.name], **vars(r.docking)}),
            }
            for name, r in found.reaches.items()
        },
        "reported_by_others": [r._asdict() for r in _REPORTED],
        "receiver": vars(found.receiver),
        "lamp_power_w": found.scene.lamp.power_w,
        "lamp_in_band_w": found.in_band_w,
        "band_nm": list(found.scene.detector.bands_nm[0]),
        **{str(k): jsonable(v.values.tolist()) for k, v in {**data.coords, **data.data_vars}.items()},
    }
