"""`lightfield link`: how far the lamp carries data, and is seen, in clear and turbid water."""

from __future__ import annotations

import argparse

from lightfield.commands.shared.answer import answered, outputs_of
from lightfield.commands.shared.options import TRACING, add_answer, add_option, add_tracing, given
from lightfield.commands.shared.progress import progress_of
from lightfield.errors import UsageError
from lightfield.render.limits import ON_AXIS
from lightfield.scene import Scene
from lightfield.studies import defaults
from lightfield.studies.link.receiver import Receiver

#: Options of the receiver: name, default, unit, help.
_RECEIVER = (
    ("area", Receiver.area_mm2, "MM2", "of the photodiode, mm²"),
    ("responsivity", Receiver.responsivity_a_per_w, "A/W", "of the photodiode, mean over the band"),
    ("amplifier_noise", Receiver.noise_a_per_sqrt_hz, "A", "A per root Hz at the input"),
    ("background", Receiver.background_a, "A", "photocurrent of ambient light and dark current"),
    ("bit_rate", Receiver.bit_rate_per_s, "N", "bits per second"),
    ("ber", Receiver.ber, "P", "errors per bit that are accepted"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    what = "scene file (TOML); a tank is left out, the lamp counts in its first band"
    add_option(parser, "scene", help=what)
    group = parser.add_argument_group("receiver")
    for name, default, metavar, text in _RECEIVER:
        group.add_argument(
            f"--{name.replace('_', '-')}", type=float, default=default, metavar=metavar,
            help=f"{text} (default {default:g})",
        )  # fmt: skip
    waters = " and ".join(f"{name}={a:g},{b:g}" for name, (a, b) in defaults.LINK_WATERS.items())
    parser.add_argument(
        "--water", action="append", default=[], metavar="NAME=A,B",
        help=f"absorption and scattering in 1/m to compare with; may be given again (default: {waters})",
    )  # fmt: skip
    add_option(parser, "--to", "%(default)g", default=defaults.LINK_TO_M)
    add_tracing(parser, ON_AXIS)
    add_answer(parser)


def run(args: argparse.Namespace) -> int:
    """Study, print, write."""
    scene = Scene.load(args.scene)
    waters = _waters(args.water) or None
    outputs_of(args, args.scene, *scene.tables)
    from lightfield.api.link import link

    options = given(args, *TRACING, *(name for name, *_ in _RECEIVER))
    with progress_of("link"):
        answer = link(scene, water=waters, to=args.to, **options)
    return answered(args, answer)


def _waters(texts: list[str]) -> dict[str, tuple[float, float]]:
    waters: dict[str, tuple[float, float]] = {}
    for text in texts:
        name, water = _water(text)
        if name in waters:
            raise UsageError(
                "two waters of one name",
                where="--water",
                found=name,
                rule="every water has a name of its own",
                remedy="rename one of them",
            )
        waters[name] = water
    return waters


def _water(text: str) -> tuple[str, tuple[float, float]]:
    name, _, values = text.partition("=")
    try:
        a, b = (float(part) for part in values.split(","))
    except ValueError:
        raise UsageError(
            "not a water",
            where="--water",
            found=text,
            rule="NAME=A,B in 1/m",
            remedy="for example clear=0.05,0.05",
        ) from None
    return name, (a, b)
