"""`lightfield ros`: a ROS 2 node that tells a follower where the lamp is."""

from __future__ import annotations

import argparse

from lightfield.commands.shared.follower import add_space, space_asked
from lightfield.commands.shared.options import add_option
from lightfield.studies.defaults import FRAME
from lightfield.studies.follower.elements import elements_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_option(parser, "scene", help="scene file with an [array]")
    parser.add_argument("--frame", default=FRAME, metavar="NAME", help="of the array (default %(default)s)")
    add_space(parser)


def run(args: argparse.Namespace) -> int:
    """Trace once, then answer every sample until interrupted."""
    from lightfield.api.array import space_and_light
    from lightfield.robots.ros import Bridge, ros
    from lightfield.robots.ros import spin as spin
    from lightfield.studies.follower.array_light import light_of
    from lightfield.studies.follower.estimation.pose import Estimator
    from lightfield.studies.follower.survey import array_of

    scene, where = space_and_light(args.scene, **space_asked(args))
    array = array_of(scene)
    ros()  # before the work of a trace
    light = light_of(scene, elements=elements_of(array), **where)
    bridge = Bridge(Estimator.of_scene(scene, light, where["space"]), array.gain)
    print(f"listening on array/readings, {len(bridge.estimator.model.elements)} elements, frame {args.frame}")
    spin(bridge, args.frame)
    return 0
