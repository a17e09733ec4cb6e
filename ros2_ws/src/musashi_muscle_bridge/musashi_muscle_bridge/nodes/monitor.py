"""Shows the muscles in a terminal, and stops them: `ros2 run musashi_muscle_bridge monitor`."""

import io
import os
import signal
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from rich.console import Console
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import CurrentOverride, InhibitionStatus, MuscleState
from fastswing_planner.lifecycle.common_parameters import ROBOT_DESCRIPTION
from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.lifecycle.running import run
from fastswing_planner.robot.description import load_robot
from musashi_muscle_bridge.monitor.dashboard import (
    FEEDBACK,
    INHIBITION,
    JOINTS,
    OVERRIDE,
    STATE,
    Dashboard,
)
from musashi_muscle_bridge.monitor.keys import CLEAR, QUIT, SERVICES, KeyPad, KeyReader
from musashi_muscle_bridge.monitor.picture import picture
from musashi_muscle_bridge.monitor.service_calls import ServiceCalls
from musashi_muscle_bridge.monitor.terminal import Terminal, TerminalError, require_terminal
from musashi_muscle_bridge.nodes.polling import PollingNode

_KEY_PERIOD_SEC = 0.02
_REPORTS = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
_KINDS = {
    STATE: MuscleState,
    JOINTS: JointState,
    OVERRIDE: CurrentOverride,
    INHIBITION: InhibitionStatus,
    FEEDBACK: ExecuteSwing.Impl.FeedbackMessage,
}

TABLE = (
    ROBOT_DESCRIPTION,
    Parameter("redraw_rate", 10.0, "Pictures of the terminal.", "Hz", 1.0, 30.0),
    Parameter("stale_after", 0.5, "Older states are shown as stale.", "s", 0.05, 10.0),
)


class MonitorNode(PollingNode):
    """Active means: the terminal is the dashboard's."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("monitor", TABLE)

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Load the robot, for its tension limits."""
        robot = load_robot(parameters["robot_description"])
        limits = zip(robot.model.muscle_names, robot.tension_limit.tolist(), strict=True)
        self._values = parameters
        self._tension_limit = dict(limits)

    def activate(self) -> None:
        """Take the terminal, watch, listen to keys."""
        namespace = self.get_namespace().strip("/")
        stale_after = self._values["stale_after"]
        self._terminal = Terminal()
        self._dashboard = Dashboard(namespace, self._tension_limit, stale_after)
        self._calls, self._keys, self._reader = ServiceCalls(), KeyPad(), KeyReader()
        self._topics = {topic: self.poll(kind, topic) for topic, kind in _KINDS.items()}
        self._heard = self.create_subscription(
            DiagnosticArray, "/diagnostics", self.guarded(self._on_diagnostics), _REPORTS
        )
        self._askable = {
            name: self.create_client(Trigger, name) for name in (*SERVICES.values(), CLEAR)
        }
        self._clocks = [
            self.create_steady_timer(_KEY_PERIOD_SEC, self._on_keys),
            self.create_steady_timer(1.0 / self._values["redraw_rate"], self._redraw),
        ]

    def deactivate(self) -> None:
        """Give the terminal back."""
        for clock in self._clocks:
            self.destroy_timer(clock)
        self.end_polling()
        self.destroy_subscription(self._heard)
        for client in self._askable.values():
            self.destroy_client(client)
        self._terminal.close()

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self._dashboard.diagnosed(message.status, self.monotonic())

    def _on_keys(self) -> None:
        typed, now = self._terminal.typed(), self.monotonic()
        if typed is None:
            signal.raise_signal(signal.SIGINT)
            return
        for letter in self._reader.feed(typed, now):
            wish = self._keys.press(letter, now)
            if wish == QUIT:
                signal.raise_signal(signal.SIGINT)
            elif wish:
                self._ask(wish)

    def _ask(self, service: str) -> None:
        client = self._askable[service]
        if not client.service_is_ready():
            self._calls.missing(service, self.monotonic())
            return
        self._calls.asked(service, self.monotonic())
        client.call_async(Trigger.Request()).add_done_callback(
            self.guarded(self._answer_of(service))
        )

    def _answer_of(self, service: str) -> Callable[[Future], None]:
        def on_answer(future: Future) -> None:
            answer = future.result()
            self._calls.answered(service, answer.success, answer.message, self.monotonic())

        return on_answer

    def _redraw(self) -> None:
        try:
            self._terminal.show(self._lines(self.monotonic()))
        except Exception:
            # The last picture must not stand there as if it were the present.
            self._terminal.show(["the monitor has a defect, which it tells after q; e and h work"])
            raise

    def _lines(self, now: float) -> list[str]:
        """Look at all topics, and return what the terminal is to show."""
        for name, topic in self._topics.items():
            sample = topic.take(now)
            if sample is not None:
                self._dashboard.heard(name, sample.message, sample.received, sample.sequence)
            self._dashboard.publishers[name] = self.count_publishers(name)
        width, height = self._terminal.size()
        lines = picture(
            self._dashboard,
            self._calls,
            self._keys,
            now,
            time.strftime("%H:%M:%S"),
            width,
            height,
        )
        file = io.StringIO()
        console = Console(
            file=file, force_terminal=True, width=width, height=height, highlight=False
        )
        console.print(lines, end="")
        return file.getvalue().splitlines()


def main() -> int:
    """Run the node; returns 0, or 2 without a terminal."""
    try:
        require_terminal(os.environ)
    except TerminalError as error:
        print(f"monitor: {error}", file=sys.stderr)
        return 2
    return run(MonitorNode)


if __name__ == "__main__":
    raise SystemExit(main())
