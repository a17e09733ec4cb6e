"""Which swing, on a command line."""

import argparse

from numpy.typing import ArrayLike

from fastswing_planner.command_line import numbers
from fastswing_planner.errors import UnknownName
from fastswing_planner.planning.request import Method
from fastswing_planner.robot.description import Robot


def add_swing_arguments(parser: argparse.ArgumentParser, robot: str, method: Method) -> None:
    """Add what says which swing; `robot` and `method` are the defaults."""
    methods = [one.name.lower() for one in Method]
    default = method.name.lower()
    add = parser.add_argument
    add("--robot", default=robot, help="YAML file of the robot; default: %(default)s")
    add("--start", default="start", help="angles [rad] with commas, or a posture of the robot")
    add("--end", default="end", help="the same")
    add("--method", choices=methods, default=default, help="default: %(default)s")


def posture_argument(option: str, text: str, robot: Robot) -> ArrayLike:
    """Return the angles [rad], shape (n,), or those of a named posture; raises UnknownName."""
    if text in robot.postures:
        return robot.postures[text]
    try:
        return numbers(text)
    except argparse.ArgumentTypeError as error:
        raise UnknownName(
            f"{option} is '{text}': give one angle [rad] for each of "
            f"{', '.join(robot.model.joint_names)}, with commas between, or a posture of the "
            f"robot: {', '.join(robot.postures)}"
        ) from error
