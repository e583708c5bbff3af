"""`lightfield link`: how far the lamp carries data, and is seen, in clear and turbid water."""

from __future__ import annotations

import argparse
from pathlib import Path

from lightfield.commands._answer import answered, outputs_of
from lightfield.commands._options import add_answer, add_tracing, given
from lightfield.commands._progress import progress_of
from lightfield.errors import UsageError
from lightfield.scene import Scene

DEFAULTS = {"rel_error": 0.005, "max_photons": 4e6}
#: Options of the receiver: name, field, help.
RECEIVER = (
    ("--area", "area_mm2", "MM2", "of the photodiode, mm² (default {:g})"),
    ("--responsivity", "responsivity_a_per_w", "A/W", "of the photodiode, mean over the band (default {:g})"),
    ("--amplifier-noise", "noise_a_per_sqrt_hz", "A", "A per root Hz at the input (default {:g})"),
    ("--background", "background_a", "A", "photocurrent of ambient light and dark current (default {:g})"),
    ("--bit-rate", "bit_rate_per_s", "N", "bits per second (default {:g})"),
    ("--ber", "ber", "P", "errors per bit that are accepted (default {:g})"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "scene",
        type=Path,
        metavar="SCENE",
        help="scene file (TOML); a tank is left out, the lamp counts in its first band",
    )
    defaults = {
        "area_mm2": 13.0, "responsivity_a_per_w": 0.25, "noise_a_per_sqrt_hz": 5e-12, "background_a": 0.0,
        "bit_rate_per_s": 1e6, "ber": 1e-6,
    }  # fmt: skip
    group = parser.add_argument_group("receiver")
    for option, field, metavar, text in RECEIVER:
        group.add_argument(
            option, dest=field, type=float, default=defaults[field], metavar=metavar,
            help=text.format(defaults[field]),
        )  # fmt: skip
    parser.add_argument(
        "--water", action="append", default=[], metavar="NAME=A,B",
        help="absorption and scattering in 1/m to compare with; may be given again (default: clear=0.05,0.05 "
        "and turbid=0.05,0.3)",
    )  # fmt: skip
    parser.add_argument(
        "--to", type=float, default=60.0, metavar="M", help="farthest distance, m (default 60)"
    )
    add_tracing(parser, **DEFAULTS)
    add_answer(parser)


def run(args: argparse.Namespace) -> int:
    """Study, print, write."""
    scene = Scene.load(args.scene)
    waters = _waters(args.water) or None
    outputs_of(args, args.scene)
    from lightfield.api.link import Link
    from lightfield.studies.link.receiver import Receiver
    from lightfield.studies.link.study import link

    receiver = Receiver(**{field: getattr(args, field) for _, field, *_ in RECEIVER})
    with progress_of("link"):
        found = link(scene, receiver, waters=waters, to_m=args.to, **(DEFAULTS | given(args)))
    return answered(args, Link(found))


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
