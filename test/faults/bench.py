"""All nodes running, a way to any phase of a swing, and a way back to a sound arm."""

import math
import os
import re
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from board_lines import ZERO, BoardLines
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import State
from processes import isolated_environment
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, MuscleState, SwingOptions
from fastswing_planner.execution.settings import ExecutionSettings

if TYPE_CHECKING:
    from test.system.suite import Suite

NODES = ("mock_driver", "bridge", "planner", "swing_executor", "inhibitor")
HOLD = "hold"
PHASES = ("plan", "raise", "elongate", "settle", "swing", "recover")
ARM_FAULTS = ("stuck_encoder", "dead_board", "hot_motor", "broken_wire")
LINE_FAULTS = ("latency", "jitter", "loss", "corruption")
PARAMETERS: dict[str, dict[str, object]] = {"swing_executor": {"raise_speed": 2.0}}
"""Not the default, to get through many swings; the arm is not made to swing faster."""
MUSCLES = [f"#{number}" for number in range(1, 11)]
ARRIVAL_TOLERANCE = ExecutionSettings().arrival_tolerance
_CLOCK_PERIOD_SEC = 0.005


def error_name(code: int) -> str:
    """Return the name of an error code."""
    for name in dir(ErrorCode):
        if name.isupper() and getattr(ErrorCode, name) == code:
            return name
    return str(code)


class Disturbed(Exception):
    """This machine stalled, and something else went wrong than what is tried; the text says it."""


class Swing:
    """A goal on its way: what is told of it, and its result when there is one.

    distance_to_end  [rad] NaN before it is told
    arrived_at       monotonic time [s] at which the arm was first told to be there; NaN before
    ended_at         monotonic time [s] at which the result came; NaN before
    """

    def __init__(self, suite: "Suite", method: int) -> None:
        """Send the robot's own swing."""
        self.phases: list[int] = []
        self.distance_to_end = self.arrived_at = math.nan
        goal = suite.goal(options=SwingOptions(method=method))
        self._handle = suite.send_goal(goal, self._on_feedback)
        self.ended_at = math.nan
        self._future = self._handle.get_result_async()
        self._future.add_done_callback(self._on_result)

    def _on_feedback(self, message: Any) -> None:
        self.phases.append(message.feedback.phase)
        self.distance_to_end = message.feedback.distance_to_end
        swinging = message.feedback.phase >= ExecuteSwing.Feedback.PHASE_SWING
        near = swinging and self.distance_to_end < ARRIVAL_TOLERANCE
        if near and math.isnan(self.arrived_at):
            self.arrived_at = time.monotonic()

    def _on_result(self, _future: Any) -> None:
        self.ended_at = time.monotonic()

    @property
    def ended(self) -> bool:
        """Whether the result is there."""
        return bool(self._future.done())

    @property
    def result(self) -> str:
        """Error name and text; empty while there is no result."""
        if not self.ended:
            return ""
        result = self._future.result().result
        return f"{error_name(result.error_code)}: {result.error_string}".rstrip(": ")


class Bench:
    """Runs the suite for one fault after another."""

    def __init__(self, suite: "Suite", folder: Path) -> None:
        """`folder` is for the boards' logs."""
        self.suite = suite
        self.folder = folder
        self.swing: Swing | None = None
        self.extra: list[Callable[[], object]] = []
        """End what a fault made besides, such as processes and publishers; called by `tidy`."""
        self._logs: list[BoardLines] = []
        self._heard: dict[str, float] = {}
        self._clock_ahead: float | None = None
        self.simulated: set[str] = set()
        suite.node.create_subscription(DiagnosticArray, "/diagnostics", self._hear, 100)
        self.tidied_at = 0.0
        """Monotonic time [s]: the arm was sound, and boards got their commands from then on."""
        self.notes: list[str] = []
        """What else is worth telling about the present fault."""
        self.genuine: JointState | None = None
        """The last joint state of the bridge, none of a fault's."""
        self.genuine_muscles: MuscleState | None = None
        """The last muscle state of the bridge, likewise."""
        self.foreign_states = suite.node.create_publisher(JointState, "joint_states", 10)
        self.foreign_muscles = suite.node.create_publisher(MuscleState, "muscle_state", 10)
        suite.node.create_subscription(MuscleState, "muscle_state", self._on_muscles, 10)
        suite.node.create_subscription(JointState, "joint_states", self._on_joints, 10)
        self._clock = suite.node.create_publisher(Clock, "/clock", 10)
        suite.node.create_timer(_CLOCK_PERIOD_SEC, self._tick)

    def _hear(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self._heard[status.name] = time.monotonic()

    def _on_joints(self, message: JointState) -> None:
        angles = message.position
        ours = not angles or any(not abs(angle) < 50.0 for angle in angles)
        if list(message.name) == list(self.suite.robot.model.joint_names) and not ours:
            self.genuine = message

    def _on_muscles(self, message: MuscleState) -> None:
        if all(math.isfinite(length) for length in message.length):
            self.genuine_muscles = message

    def _tick(self) -> None:
        if self._clock_ahead is None:
            return
        now = time.time() + self._clock_ahead
        clock = Clock()
        clock.clock.sec, clock.clock.nanosec = int(now), int(now % 1.0 * 1e9)
        self._clock.publish(clock)

    # Processes and parameters.

    @property
    def environment(self) -> dict[str, str]:
        """Of a process that meets the nodes."""
        return isolated_environment(self.suite.domain)

    @property
    def lines(self) -> BoardLines:
        """The log of the boards that run now, up to date."""
        self._logs[-1].poll()
        return self._logs[-1]

    def start(self, name: str) -> None:
        """Start a node, in place of one that has ended; wait until it is active."""
        parameters = dict(PARAMETERS.get(name, {}))
        if name == "mock_driver":
            path = self.folder / f"boards_{len(self._logs)}.tsv"
            self._logs.append(BoardLines(path))
            parameters["board_log"] = path
        self.suite.start(name, **parameters)

    def start_all(self) -> None:
        """Start every node; wait until all are active and the arm is held."""
        for name in NODES:
            self.start(name)
        for name in NODES:
            self.suite.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)

    def kill(self, name: str, signal_number: int = signal.SIGKILL) -> None:
        """Send a signal that ends a node, and wait for its end."""
        self.suite.processes[name].send(signal_number)
        self.suite.processes[name].wait(60.0)

    def restart(self, name: str) -> None:
        """Start an ended node again and wait until it is active."""
        self.start(name)
        self.suite.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)

    def control_processes(self) -> list[int]:
        """Return the process in which the bridge runs its control loop, or nothing."""
        node = self.suite.processes["bridge"].pid
        return [int(one) for one in Path(f"/proc/{node}/task/{node}/children").read_text().split()]

    def go_on(self, name: str) -> None:
        """Let a stopped node go on."""
        self.suite.processes[name].send(signal.SIGCONT)

    def set(self, node: str, **values: object) -> None:
        """Set parameters of a node at run time."""
        parameters = [
            Parameter(name, Parameter.Type.STRING_ARRAY if value == [] else None, value)
            for name, value in values.items()
        ]
        request = SetParametersAtomically.Request(
            parameters=[parameter.to_parameter_msg() for parameter in parameters]
        )
        service = f"{node}/set_parameters_atomically"
        assert self.suite.ask(SetParametersAtomically, service, request).result.successful

    def line(self, **values: object) -> None:
        """Set faults of bus and boards on the mock driver."""
        self.set("mock_driver", **values)

    def simulate_time(self, *nodes: str) -> None:
        """Let these nodes take their time from /clock."""
        for node in nodes:
            self.set(node, use_sim_time=True)
            self.simulated.add(node)

    def run_clock(self, ahead: float | None) -> None:
        """Publish /clock, `ahead` [s] of the real time; None: no more."""
        self._clock_ahead = ahead

    # Ways.

    def tidy(self) -> None:
        """Undo the fault, whatever it was, and hold the arm."""
        suite = self.suite
        self.run_clock(None)
        for thing in self.extra:
            thing()
        self.extra.clear()
        for name in NODES:
            process = suite.processes[name]
            process.send(signal.SIGCONT)
            if name == "bridge" and process.running:
                self._mend_control_process()
            if not process.running:
                self.start(name)
        for name in NODES:
            suite.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)
        for name in sorted(self.simulated):
            self.set(name, use_sim_time=False)
        self.simulated.clear()
        self.notes.clear()
        self.line(**{name: [] for name in ARM_FAULTS}, **dict.fromkeys(LINE_FAULTS, 0.0))
        self.wait_for_idle()
        suite.fresh_muscles()
        suite.hold()
        suite.trigger("disarm_inhibitor")
        # What an hour of swings leaves behind would slow this process down.
        self.lines.forget(self.tidied_at)
        suite.length_commands.clear()
        self.tidied_at = time.monotonic()

    def _mend_control_process(self) -> None:
        """Let it go on; end a bridge without one."""
        for control in self.control_processes():
            os.kill(control, signal.SIGCONT)
        if not self.control_processes():
            self.kill("bridge", signal.SIGINT)

    def wait_for_idle(self) -> None:
        """Wait until the swing has ended, or its executor says so: its result can be lost."""
        if self.swing is not None and not self.swing.ended:
            self._wait_for_phase_idle()
        self.swing = None

    def _wait_for_phase_idle(self) -> None:
        since = time.monotonic()
        self.suite.until(
            "the executor to be idle",
            lambda: (
                (self.swing is not None and self.swing.ended and self.swing.result[:4] != "BUSY")
                or (
                    self._heard.get("swing_executor", 0.0) > since
                    and self.suite.reported("swing_executor", "phase") == "idle"
                )
            ),
        )

    def swing_to(self, phase: str, method: int = SwingOptions.METHOD_INHIBIT) -> None:
        """Swing as far as a phase; in the swing with Method 1, until muscles are let go."""
        self.suite.until(
            "the executor's length_command",
            lambda: self.suite.node.count_subscribers("length_command") >= 2,
        )
        self.swing = swing = Swing(self.suite, method)
        wanted = getattr(ExecuteSwing.Feedback, f"PHASE_{phase.upper()}")
        self.suite.until(
            f"the phase {phase}", lambda: swing.ended or max(swing.phases, default=0) >= wanted
        )
        if phase == "swing" and method == SwingOptions.METHOD_INHIBIT:
            self.suite.until(
                "muscles let go",
                lambda: swing.ended or ZERO in self.lines.commands[-1].modes,
            )
        if swing.result.startswith("HOLDING_INFEASIBLE"):
            self.relax()
        if swing.result.startswith("BUSY"):
            self._wait_for_phase_idle()
        if swing.ended or max(swing.phases) > wanted:
            raise Disturbed(f"no way to the phase {phase}: {swing.result}")

    def relax(self) -> None:
        """Let the arm hang: a fault may have left it where no muscles can hold it on its way."""
        self.suite.trigger("emergency_stop")
        self.suite.let_states_pass(1500)
        self.suite.hold()

    # What an operator sees.

    def sees(self, place: str, pattern: str) -> str:
        """Return what a place shows if it fits a pattern, else nothing.

        place  a node: its /diagnostics message; NODE.KEY: one value of it; "result": of the
               swing; "NODE silent": since when its diagnostics have not come; "NODE log"
        """
        if place == "result":
            text = "" if self.swing is None else self.swing.result
        elif place.endswith(" silent"):
            node = place.removesuffix(" silent")
            quiet = time.monotonic() - self._heard.get(node, 0.0)
            text = "no diagnostics any more" if quiet > 2.0 else ""
        elif place.endswith(" log"):
            text = self.suite.processes[place.removesuffix(" log")].log_tail(8)
            found = [line for line in text.splitlines() if re.search(pattern, line)]
            text = found[-1].partition("]: ")[2] if found else ""
        elif "." in place:
            node, _, key = place.partition(".")
            text = self.suite.reported(node, key)
        else:
            text = getattr(self.suite.diagnostics.get(place), "message", "")
        return text if text and re.search(pattern, text) else ""
