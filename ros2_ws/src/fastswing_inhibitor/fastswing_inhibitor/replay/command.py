"""`replay`: the inhibitor's decisions made again from a bag, or a bag published again."""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path

from fastswing_inhibitor.inhibition import InhibitionSettings
from fastswing_inhibitor.replay.replay import replay
from fastswing_inhibitor.replay.result import WhatIf
from fastswing_inhibitor.replay.text import replay_text
from fastswing_planner.bags import open_bag
from fastswing_planner.command_line import say
from fastswing_planner.errors import PlannerError
from fastswing_planner.planning.task import checked_threshold
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI

_SETTINGS = InhibitionSettings()
_ROS_ARGS = "--ros-args"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns 0, 1 if a decision differs, 2 after an error of one line."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    cut = given.index(_ROS_ARGS) if _ROS_ARGS in given else len(given)
    options = _parser().parse_args(given[:cut])
    options.ros_args = given[cut:]
    try:
        if options.publish:
            # Only this needs ROS.
            from fastswing_inhibitor.player.node import publish

            return publish(options)
        return _replay(options)
    except PlannerError as error:
        print(f"replay: {' '.join(str(error).split())}", file=sys.stderr)
        return 2


def _replay(options: argparse.Namespace) -> int:
    robot = load_robot(options.model or options.robot)
    if options.threshold is not None:
        checked_threshold(options.threshold)
    if options.velocity_limit is not None:
        changed_limits = replace(robot.limits, velocity=options.velocity_limit)
        changed_limits.checked(robot.model.muscle_names)
    bag = open_bag(*options.bag)
    settings = InhibitionSettings(
        **{row.name: getattr(options, row.name) for row in fields(InhibitionSettings)}
    )
    what_if = WhatIf(options.threshold, options.velocity_limit)
    found = replay(
        bag,
        robot.model,
        robot.limits.velocity,
        settings=settings,
        what_if=what_if,
        prefix=options.prefix,
    )
    changed = _changes(options)
    say(replay_text(found, bag.start_ns, changed))
    for line in bag.warnings:
        print(f"warning: {line}", file=sys.stderr)
    return 0 if found.agrees or changed else 1


def _changes(options: argparse.Namespace) -> str:
    parts = []
    if options.threshold is not None:
        parts.append(f"C {options.threshold:g} s/rad")
    if options.velocity_limit is not None:
        parts.append(f"velocity limit {options.velocity_limit:g} m/s")
    if options.model is not None:
        parts.append(f"model {options.model}")
    return ", ".join(parts)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="replay",
        description="Make the inhibitor's decisions again from a bag and compare them with what "
        "was published; exit code 1 if one differs.",
    )
    parser.add_argument("bag", nargs="+", type=Path, help="MCAP file or folder; several are one")
    parser.add_argument("--prefix", default="", help="namespace of the robot's topics, '/left'")
    parser.add_argument("--robot", default=MUSASHI, help="the YAML file the inhibitor had")
    changes = parser.add_argument_group("what if")
    changes.add_argument("--threshold", type=float, help="another C [s/rad]")
    changes.add_argument("--velocity-limit", type=float, help="another limit of all muscles [m/s]")
    changes.add_argument("--model", help="another YAML file than the inhibitor had")
    node = parser.add_argument_group("the inhibitor's parameters, if they were not the defaults")
    for row in fields(InhibitionSettings):
        node.add_argument(
            f"--{row.name.replace('_', '-')}", type=float, default=getattr(_SETTINGS, row.name)
        )
    again = parser.add_argument_group("publish the bag again")
    again.add_argument("--publish", action="store_true", help="publish instead, with /clock")
    again.add_argument("--topic", action="append", help="this topic; may be repeated (states)")
    again.add_argument("--rate", type=float, default=1.0, help="times as fast as recorded")
    again.add_argument("--start", type=float, default=0.0, help="[s] from the bag's start")
    again.add_argument("--duration", type=float, default=math.inf, help="[s] of the bag")
    again.add_argument("--loop", action="store_true", help="begin again at the end")
    again.add_argument("--paused", action="store_true", help="wait for the service ~/pause")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
