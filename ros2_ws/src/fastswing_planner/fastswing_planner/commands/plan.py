"""`plan`: a swing planned on the command line, without any node."""

import argparse
import json
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from numpy.typing import ArrayLike

from fastswing_planner.command_line import OneLineParser, numbers, say
from fastswing_planner.commands.plan_report import comparison_record, plan_record, plan_text
from fastswing_planner.commands.swing_arguments import add_swing_arguments, posture_argument
from fastswing_planner.errors import (
    InvalidRequest,
    PlannerError,
    RobotDescriptionError,
    WrongLength,
)
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, MuscleConstants, Search, SwingRequest
from fastswing_planner.planning.swing import SwingSettings
from fastswing_planner.planning.task import requested_limits
from fastswing_planner.qp.solvers import DEFAULT_SOLVER, SOLVERS, solver_from
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.muscle_model import Payload
from fastswing_planner.robot.path import MUSASHI

_PICTURES = (".png", ".svg", ".pdf")


def main() -> int:
    """Run the command; returns 0, 1 if the arm cannot do it, 2 if the request is wrong."""
    # Ctrl-C, or a reader that has read enough, such as `head`, ends it without a word.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    arguments = _parser().parse_args()
    try:
        _plan(arguments)
    except PlannerError as error:
        if arguments.json:
            print(json.dumps({"error_code": error.code_name, "error_string": str(error)}))
        print(f"plan: {' '.join(str(error).split())}", file=sys.stderr)
        return 2 if isinstance(error, (InvalidRequest, RobotDescriptionError)) else 1
    return 0


def _plan(arguments: argparse.Namespace) -> None:
    if arguments.plot is not None and arguments.plot.suffix.lower() not in _PICTURES:
        raise InvalidRequest(
            f"--plot is '{arguments.plot}': choose a file name that ends in {', '.join(_PICTURES)}"
        )
    robot = load_robot(arguments.robot)
    request = _request(arguments, robot)
    planner = SwingPlanner(robot.model, robot.limits, solver_from(arguments.solver))
    plan = planner.plan(request, time.monotonic)
    comparison = planner.compare(request, time.monotonic)
    if arguments.plot is not None:
        # Not needed for the rest, and slow to import.
        from fastswing_planner.commands.plan_picture import save_plan_picture

        limits = requested_limits(robot.model, robot.limits, request.constants)
        try:
            save_plan_picture(arguments.plot, plan, comparison, limits)
        except (OSError, ValueError) as error:
            raise InvalidRequest(f"--plot: {error}") from error
    if arguments.json:
        record = {"plan": plan_record(plan), "comparison": comparison_record(comparison)}
        say(json.dumps(record, allow_nan=False))
    else:
        say(plan_text(plan, comparison))


def _request(arguments: argparse.Namespace, robot: Robot) -> SwingRequest:
    count = len(robot.model.muscle_names)

    def for_all(values: list[float]) -> ArrayLike:
        return values * count if len(values) == 1 else values

    payload = None
    if arguments.payload is not None:
        x, y, z = _exactly(3, "--payload-position", arguments.payload_position)
        body = arguments.payload_body or robot.payload_body
        payload = Payload(arguments.payload, body, (x, y, z))
    return SwingRequest(
        start=posture_argument("--start", arguments.start, robot),
        end=posture_argument("--end", arguments.end, robot),
        method=Method[arguments.method.upper()],
        kept_muscles=arguments.keep,
        constants=MuscleConstants(
            velocity=for_all(arguments.velocity_limit),
            acceleration=for_all(arguments.acceleration_limit),
            tension_min=for_all(arguments.tension_min),
            tension_max=for_all(arguments.tension_max),
            holding_weight=arguments.holding_weight,
        ),
        threshold=arguments.threshold,
        payload=payload,
        settings=SwingSettings(arguments.time_step, arguments.epsilon, arguments.max_steps),
        swing_weight=arguments.swing_weight,
        search=Search[arguments.search.upper()],
        time_limit=arguments.time_limit,
    )


def _exactly(count: int, option: str, values: Sequence[float]) -> Sequence[float]:
    if len(values) != count:
        raise WrongLength(f"{option} has {len(values)} numbers, expected {count}")
    return values


def _parser() -> argparse.ArgumentParser:
    settings = SwingSettings()
    parser = OneLineParser(
        prog="plan",
        description="Plan one swing, and compare all methods. Nothing moves.",
    )
    add = parser.add_argument
    add_swing_arguments(parser, MUSASHI, Method.ELONGATE)
    searches = [search.name.lower() for search in Search]
    add("--search", choices=searches, default="greedy", help="default: greedy, the paper's")
    add("--time-limit", type=float, default=float("inf"), metavar="SEC", help="of the search")
    add("--solver", choices=list(SOLVERS), default=DEFAULT_SOLVER)
    add("--threshold", type=float, default=0.0, help="C [s/rad] of Method 1; default: 0")
    add("--keep", nargs="+", default=[], metavar="MUSCLE", help="muscles that are never masked")
    for option, what in (
        ("--velocity-limit", "[m/s]"),
        ("--acceleration-limit", "[m/s^2], inf: no ramp"),
        ("--tension-min", "[N]"),
        ("--tension-max", "[N]"),
    ):
        add(
            option,
            type=numbers,
            default=[],
            metavar="X[,X...]",
            help=f"{what}; one number for all muscles, or one for each; default: the robot's",
        )
    weight = "diagonal or all of it, row by row; default: identity"
    add("--holding-weight", type=numbers, default=[], metavar="X,...", help=f"W1, {weight}")
    add("--swing-weight", type=numbers, default=[], metavar="X,...", help=f"W2, {weight}")
    add("--payload", type=float, metavar="KG", help="mass that the arm holds; default: none")
    add("--payload-body", default="", metavar="BODY", help="that carries it; default: the robot's")
    add("--payload-position", type=numbers, default=[0.0] * 3, metavar="X,Y,Z", help="[m] in it")
    add("--time-step", type=float, default=settings.time_step, metavar="SEC")
    add("--epsilon", type=float, default=settings.epsilon, metavar="RAD")
    add("--max-steps", type=int, default=settings.max_steps, metavar="COUNT")
    add("--json", action="store_true", help="print JSON instead of tables")
    add("--plot", type=Path, metavar="FILE", help="also draw the plan (png, svg, pdf)")
    return parser
