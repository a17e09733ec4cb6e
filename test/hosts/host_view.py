"""What one computer sees of the robot, as lines of JSON; run there, apart from the tests' process.

Fast DDS looks for a process's network interfaces once, so each computer needs a process of its own.
Commands come as lines: `swing METHOD` or `call SERVICE`. Time is monotonic, the same everywhere on
this machine.
"""

import json
import queue
import sys
import threading
import time
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionClient
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import MuscleState, SwingOptions
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI

_PERIOD_SEC = 0.02
_GRAPH_PERIOD_SEC = 0.25
_WATCHED = ("joint_states", "length_command", "swing_plan", "inhibition_status")
_TRIGGERS = ("hold_posture", "clear_faults", "emergency_stop")


class View:
    """Subscriptions, a swing client, and one line of JSON for each period."""

    def __init__(self) -> None:
        """Connect."""
        self.node = Node("view", enable_rosout=False, start_parameter_services=False)
        self.robot = load_robot(MUSASHI)
        self.seen: dict[str, Any] = {"states": 0, "phase": -1, "results": [], "calls": []}
        newest = QoSProfile(depth=1)
        self.node.create_subscription(MuscleState, "muscle_state", self._on_muscles, newest)
        self.node.create_subscription(JointState, "joint_states", self._on_joints, newest)
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 100)
        self._swings = ActionClient(self.node, ExecuteSwing, "execute_swing")
        self._triggers = {name: self.node.create_client(Trigger, name) for name in _TRIGGERS}

    def _on_muscles(self, message: MuscleState) -> None:
        self.seen["modes"] = list(message.mode)
        self.seen["faults"] = list(message.fault)
        self.seen["tension"] = list(message.tension)

    def _on_joints(self, message: JointState) -> None:
        self.seen["states"] += 1
        self.seen["posture"] = list(message.position)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {value.key: value.value for value in status.values}
            self.seen.setdefault("diagnostics", {})[status.name] = values

    def look_around(self) -> None:
        """Note which publishers and services are known."""
        self.seen["publishers"] = {name: self.node.count_publishers(name) for name in _WATCHED}
        ready = {name: client.service_is_ready() for name, client in self._triggers.items()}
        self.seen["ready"] = {**ready, "execute_swing": self._swings.server_is_ready()}

    def line(self) -> str:
        """Return what is seen now."""
        return json.dumps({**self.seen, "time": time.monotonic()})

    def obey(self, command: str) -> None:
        """Carry out a command line."""
        verb, name = command.split()
        if verb == "swing":
            self._swing(name)
        else:
            answer = self._triggers[name].call_async(Trigger.Request())
            answer.add_done_callback(lambda _: self.seen["calls"].append(name))

    def _swing(self, method: str) -> None:
        goal = ExecuteSwing.Goal(
            stamp=self.node.get_clock().now().to_msg(),
            start_position=self.robot.postures["start"].tolist(),
            end_position=self.robot.postures["end"].tolist(),
            options=SwingOptions(method=getattr(SwingOptions, f"METHOD_{method}")),
        )
        self.seen["phase"] = -1
        sent = self._swings.send_goal_async(goal, feedback_callback=self._on_feedback)
        sent.add_done_callback(
            lambda accepted: (
                accepted.result()
                .get_result_async()
                .add_done_callback(lambda answer: self._on_result(answer.result().result))
            )
        )

    def _on_feedback(self, message: Any) -> None:
        self.seen["phase"] = message.feedback.phase

    def _on_result(self, result: ExecuteSwing.Result) -> None:
        self.seen["results"].append([result.error_code, result.error_string])


def main() -> None:
    """Print lines until standard input ends."""
    rclpy.init()
    view = View()
    executor = EventsExecutor()
    executor.add_node(view.node)
    commands: queue.SimpleQueue[str] = queue.SimpleQueue()

    def read() -> None:
        for line in sys.stdin:
            commands.put(line)
        commands.put("")

    threading.Thread(target=read, daemon=True).start()
    looked = 0.0
    while True:
        if time.monotonic() - looked > _GRAPH_PERIOD_SEC:
            view.look_around()
            looked = time.monotonic()
        print(view.line(), flush=True)
        executor.spin_until_future_complete(Future(), timeout_sec=_PERIOD_SEC)
        if not commands.empty():
            command = commands.get()
            if not command:
                return
            view.obey(command)


if __name__ == "__main__":
    main()
