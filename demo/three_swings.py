"""Swings the arm three ways through real ROS 2 nodes and reports what came out.

Starts the mock of boards and arm, the bridge, the planner, the inhibitor and the swing executor as
`ros2 run` would, records each swing with the recorder, and writes `out/demo`.
"""

import argparse
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import rclpy
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from paper_values import PAPER
from processes import Process, free_domain, free_udp_port, isolated_environment, stop_all
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from report import table_text, write_report
from swing_picture import draw_swing

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, SwingFigures, SwingOptions
from fastswing_planner.execution.settings import Phase
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI

METHODS = {
    "basic": SwingOptions.METHOD_BASIC,
    "method_1": SwingOptions.METHOD_INHIBIT,
    "method_2": SwingOptions.METHOD_ELONGATE,
}
_ELBOW = "E-p"
_READY_SEC = 60.0
_ASK_AGAIN_SEC = 0.5
_SWING_SEC = 60.0


class DemoError(Exception):
    """The demo cannot go on; the text says why."""


class Client:
    """The demo's own node: asks for states and swings."""

    def __init__(self, processes: Sequence[Process]) -> None:
        """Watch over `processes` while waiting for answers."""
        self.node = Node("demo", enable_rosout=False)
        self._processes = list(processes)
        # EventsExecutor does not notice clients that are made between two of its spins.
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._swings = ActionClient(self.node, ExecuteSwing, "execute_swing")

    def watch(self, process: Process) -> None:
        """Also watch over a process that was started later."""
        self._processes.append(process)

    def forget(self, process: Process) -> None:
        """Stop watching a process."""
        self._processes.remove(process)

    def spin_until(self, done: Callable[[], bool], timeout: float, what: str) -> None:
        """Spin until `done`; raises DemoError after `timeout` [s] or when a process ends."""
        deadline = time.monotonic() + timeout
        while not done():
            for process in self._processes:
                if not process.running:
                    raise DemoError(f"{process.name} ended:\n{process.log_tail()}")
            if time.monotonic() > deadline:
                raise DemoError(f"{what}: no answer for {timeout:g} s")
            self._executor.spin_once(timeout_sec=0.02)

    def wait_for(self, future: Future, timeout: float, what: str) -> Any:
        """Return the result of a future."""
        self.spin_until(future.done, timeout, what)
        return future.result()

    def wait_until_active(self, node: str) -> None:
        """Wait until a lifecycle node says that it is active."""
        client = self.node.create_client(GetState, f"{node}/get_state")
        pending: list[Future] = []
        asked = -np.inf

        def active() -> bool:
            # Discovery is not symmetric: an early answer can get lost, so ask again.
            nonlocal asked
            if client.service_is_ready() and time.monotonic() - asked > _ASK_AGAIN_SEC:
                pending.append(client.call_async(GetState.Request()))
                asked = time.monotonic()
            answers = [future.result() for future in pending if future.done()]
            return any(a.current_state.id == State.PRIMARY_STATE_ACTIVE for a in answers)

        self.spin_until(active, _READY_SEC, f"waiting for {node}")

    def wait_for_topic(self, topic: str, subscribers: int) -> None:
        """Wait until a topic has a publisher and that many subscribers."""

        def connected() -> bool:
            matched: int = self.node.count_subscribers(topic)
            return matched >= subscribers and self.node.count_publishers(topic) >= 1

        self.spin_until(connected, _READY_SEC, f"waiting for {topic}")

    def swing(
        self, robot: Robot, method: int, on_phase: Callable[[Phase], None]
    ) -> ExecuteSwing.Result:
        """Execute one swing between the robot's postures."""
        goal = ExecuteSwing.Goal(
            joint_name=robot.model.joint_names,
            start_position=robot.postures["start"].tolist(),
            end_position=robot.postures["end"].tolist(),
            options=SwingOptions(method=method),
        )
        self.spin_until(self._swings.server_is_ready, _READY_SEC, "waiting for execute_swing")
        goal.stamp = self.node.get_clock().now().to_msg()
        future = self._swings.send_goal_async(
            goal, feedback_callback=lambda message: on_phase(Phase(message.feedback.phase))
        )
        handle = self.wait_for(future, _SWING_SEC, "sending the swing")
        answer = self.wait_for(handle.get_result_async(), _SWING_SEC, "the swing")
        return answer.result

    def close(self) -> None:
        """Leave ROS."""
        self._swings.destroy()
        self.node.destroy_node()


def start_nodes(environment: dict[str, str], logs: Path) -> list[Process]:
    """Start everything but the recorder."""
    bus = {"bus_url": f"udp://127.0.0.1:{free_udp_port()}"}
    # A shared desktop stalls for longer than a robot PC may: the mock waits for it.
    timeout = 0.5
    nodes: list[tuple[str, str, dict[str, Any]]] = [
        ("musashi_muscle_bridge", "mock_driver", bus),
        ("musashi_muscle_bridge", "bridge", {**bus, "watchdog_timeout": timeout}),
        ("fastswing_planner", "planner", {}),
        ("fastswing_planner", "swing_executor", {"state_timeout": timeout}),
        ("fastswing_inhibitor", "inhibitor", {"state_timeout": timeout, "lease": 0.2}),
    ]
    return [
        Process(package, name, parameters, environment, logs / f"{name}.log")
        for package, name, parameters in nodes
    ]


def figures(robot: Robot, message: SwingFigures) -> dict[str, float | None]:
    """Return the summary's four figures of one swing; None for what is not known."""
    elbow = robot.model.joint_names.index(_ELBOW)
    values = {
        "peak_elbow_pitch_velocity_rad_s": message.peak_joint_velocity[elbow],
        "time_cost_s": message.time_cost,
        "max_muscle_velocity_m_s": max(message.peak_muscle_velocity),
        "max_tension_n": max(message.peak_tension),
    }
    return {name: None if value != value else round(value, 4) for name, value in values.items()}


def record_swing(
    client: Client, robot: Robot, name: str, environment: dict[str, str], output: Path
) -> dict[str, Any]:
    """Execute and record one swing; return its part of the summary."""
    bag = output / f"{name}.mcap"
    parameters = {"output": bag}
    log = output / "logs" / f"record_{name}.log"
    recorder = Process("fastswing_planner", "record", parameters, environment, log)
    client.watch(recorder)
    try:
        client.wait_until_active("recorder")
        for topic in ("joint_states", "muscle_state"):
            client.wait_for_topic(topic, 2)
        result = client.swing(robot, METHODS[name], _phase_printer(name))
    finally:
        client.forget(recorder)
        code = stop_all([recorder])["record"]
    if result.error_code != ErrorCode.SUCCESS:
        raise DemoError(f"{name}: error {result.error_code}: {result.error_string}")
    if code != 0:
        raise DemoError(f"the recorder ended with {code}:\n{recorder.log_tail()}")
    masked = [
        muscle
        for muscle, kept in zip(result.plan.muscle_name, result.plan.mask, strict=True)
        if not kept
    ]
    return {
        "predicted": figures(robot, result.predicted),
        "measured": figures(robot, result.measured),
        "masked_muscles": masked,
        "bag": bag.name,
    }


def _phase_printer(name: str) -> Callable[[Phase], None]:
    seen: list[Phase] = []

    def on_phase(phase: Phase) -> None:
        if phase not in seen:
            seen.append(phase)
            print(f"  {name}: {phase.name.lower()}", flush=True)

    return on_phase


def prepare(output: Path) -> None:
    """Make an empty output folder; an earlier demo's is renamed, as nothing recorded is lost."""
    if output.exists():
        stamp = time.strftime("%Y%m%d_%H%M%S", time.localtime(output.stat().st_mtime))
        earlier = output.with_name(f"{output.name}_{stamp}")
        output.rename(earlier)
        print(f"the earlier results are now in {earlier}")
    (output / "logs").mkdir(parents=True)


def swing_all(output: Path, environment: dict[str, str]) -> dict[str, Any]:
    """Run the nodes and the three swings; return the summary."""
    robot = load_robot(MUSASHI)
    summary: dict[str, Any] = {"methods": {}, "paper": PAPER}
    processes: list[Process] = []
    client: Client | None = None
    try:
        processes = start_nodes(environment, output / "logs")
        client = Client(processes)
        print(f"waiting for {len(processes)} nodes", flush=True)
        for node in ("mock_driver", "bridge", "planner", "swing_executor", "inhibitor"):
            client.wait_until_active(node)
        for name in METHODS:
            summary["methods"][name] = record_swing(client, robot, name, environment, output)
    finally:
        codes = stop_all(processes)
        if client is not None:
            client.close()
    bad = {name: code for name, code in codes.items() if code != 0}
    if bad:
        raise DemoError(f"nodes that did not end cleanly: {bad}; see {output / 'logs'}")
    return summary


def _interrupt(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def main() -> int:
    """Run the demo; returns 0, 1 if a swing failed, 130 if interrupted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=Path("out/demo"))
    output: Path = parser.parse_args().output
    # A background job of a non-interactive shell is started with SIGINT ignored.
    signal.signal(signal.SIGINT, _interrupt)
    signal.signal(signal.SIGTERM, _interrupt)
    environment = isolated_environment(free_domain())
    os.environ.update(environment)
    try:
        prepare(output)
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        summary = swing_all(output, environment)
        (output / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
        bags = {name: output / part["bag"] for name, part in summary["methods"].items()}
        draw_swing(bags, output / "swing.png")
        write_report(summary, output / "swing.png", output / "report.html")
    except DemoError as error:
        print(f"demo: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("demo: interrupted, all nodes stopped", file=sys.stderr)
        return 130
    finally:
        rclpy.try_shutdown()
    print(table_text(summary))
    print(f"written: {output}/report.html, swing.png, summary.json and one bag per method")
    return 0
