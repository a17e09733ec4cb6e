"""`swing`: one swing through the running nodes; Ctrl-C cancels it, and the arm holds."""

import argparse
import math
import signal
import sys
import time
from types import FrameType
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, SwingOptions
from fastswing_planner.command_line import OneLineParser, say
from fastswing_planner.commands.swing_arguments import add_swing_arguments, posture_argument
from fastswing_planner.conversion.error_codes import error_name
from fastswing_planner.errors import (
    InvalidRequest,
    NotReady,
    PlannerError,
    RobotDescriptionError,
)
from fastswing_planner.execution.settings import Phase
from fastswing_planner.planning.request import Method
from fastswing_planner.planning.task import posture
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI

_SLICE_SEC = 0.1
_GONE_SEC = 3.0


def main() -> int:
    """Run the command; returns 0, 1 if the swing failed, 2 if the request is wrong."""
    arguments = _parser().parse_args()
    try:
        robot = load_robot(arguments.robot)
        goal = _goal(arguments, robot)
        swing = _Swing(arguments.namespace)
        try:
            result = swing.run(goal, arguments.timeout)
        finally:
            swing.close()
    except PlannerError as error:
        print(f"swing: {' '.join(str(error).split())}", file=sys.stderr)
        return 2 if isinstance(error, (InvalidRequest, RobotDescriptionError)) else 1
    if result.error_code != ErrorCode.SUCCESS:
        print(f"swing: {error_name(result.error_code)}: {result.error_string}", file=sys.stderr)
        return 1
    say(_text(result))
    return 0


def _goal(arguments: argparse.Namespace, robot: Robot) -> ExecuteSwing.Goal:
    names = robot.model.joint_names

    def angles(option: str, text: str) -> list[float]:
        values = posture_argument(option, text, robot)
        angles: list[float] = posture(option, robot.model, names, values).tolist()
        return angles

    return ExecuteSwing.Goal(
        preempt=arguments.preempt,
        joint_name=names,
        start_position=angles("--start", arguments.start),
        end_position=angles("--end", arguments.end),
        options=SwingOptions(method=int(Method[arguments.method.upper()])),
    )


class _Swing:
    """A goal of `execute_swing`, which SIGINT cancels."""

    def __init__(self, namespace: str) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(
            "swing",
            namespace=namespace,
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._client = ActionClient(self._node, ExecuteSwing, "execute_swing")
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._phase: Phase | None = None
        self._interrupted = False
        signal.signal(signal.SIGINT, self._on_interrupt)

    def close(self) -> None:
        self._node.destroy_node()
        self._context.try_shutdown()

    def run(self, goal: ExecuteSwing.Goal, timeout: float) -> ExecuteSwing.Result:
        """Return the result; raises NotReady if nobody takes the goal or its executor goes away."""
        deadline = time.monotonic() + timeout
        while not self._client.server_is_ready():
            self._spin(Future())
            if self._interrupted:
                raise NotReady("interrupted before anything was asked for")
            if time.monotonic() > deadline:
                raise NotReady(
                    f"no execute_swing for {timeout:g} s: are the nodes active, in this namespace?"
                )
        goal.stamp = self._node.get_clock().now().to_msg()
        handle = self._answer(self._client.send_goal_async(goal, feedback_callback=self._tell))
        if not handle.accepted:
            raise NotReady("the swing executor is not active")
        finished = handle.get_result_async()
        return self._answer(finished, handle).result

    def _answer(self, future: Future, handle: Any = None) -> Any:
        """Wait for an answer; with a goal's `handle`, cancel it once if SIGINT comes."""
        seen, canceling = time.monotonic(), False
        while not future.done():
            self._spin(future)
            if self._interrupted and handle is not None and not canceling:
                canceling = True
                say("canceling; Ctrl-C again leaves without waiting for the answer")
                handle.cancel_goal_async()
            if self._client.server_is_ready():
                seen = time.monotonic()
            elif time.monotonic() > seen + _GONE_SEC:
                raise NotReady("the swing executor went away; see what the arm does")
        return future.result()

    def _spin(self, future: Future) -> None:
        self._executor.spin_until_future_complete(future, timeout_sec=_SLICE_SEC)

    def _tell(self, message: Any) -> None:
        phase = Phase(message.feedback.phase)
        if phase is not self._phase:
            self._phase = phase
            say(phase.name.lower())

    def _on_interrupt(self, _signal: int, _frame: FrameType | None) -> None:
        self._interrupted = True
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def _text(result: ExecuteSwing.Result) -> str:
    plan, measured = result.plan, result.measured
    masked = [name for name, kept in zip(plan.muscle_name, plan.mask, strict=True) if not kept]
    speeds = zip(plan.joint_name, measured.peak_joint_velocity, strict=True)
    tension = max((one for one in measured.peak_tension if not math.isnan(one)), default=math.nan)
    return (
        f"swung in {measured.time_cost:.2f} s, predicted {result.predicted.time_cost:.2f} s; "
        f"muscles masked: {' '.join(masked) or 'none'}\n"
        f"peak joint speeds [rad/s]: {', '.join(f'{name} {one:.2f}' for name, one in speeds)}\n"
        f"peak muscle speed {max(measured.peak_muscle_velocity):.2f} m/s, tension {tension:.0f} N"
    )


def _parser() -> OneLineParser:
    parser = OneLineParser(
        prog="swing",
        description="Swing the arm through the running nodes. The arm moves. Ctrl-C cancels: the "
        "arm holds where it is.",
    )
    add_swing_arguments(parser, MUSASHI, Method.BASIC)
    add = parser.add_argument
    add("--namespace", default="", help="of the arm's nodes, such as left; default: none")
    add("--preempt", action="store_true", help="take the place of a swing that runs")
    add(
        "--timeout",
        "--patience",
        type=float,
        default=10.0,
        metavar="SEC",
        help="until the nodes are found",
    )
    return parser
