"""The installed executables as processes in a ROS domain of their own, and a node beside them."""

import time
import warnings
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from processes import (
    Process,
    free_domain,
    free_udp_port,
    isolated_environment,
    stop_all,
)
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, LengthCommand, MuscleState
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI
from test.system.launch_rehearsal import programs

with warnings.catch_warnings():
    # ROS imports this when the first publisher is made; its parser uses a deprecated module.
    warnings.simplefilter("ignore", DeprecationWarning)
    import_module("rosidl_generator_py")

PACKAGES = {
    "mock_driver": "musashi_muscle_bridge",
    "bridge": "musashi_muscle_bridge",
    "planner": "fastswing_planner",
    "swing_executor": "fastswing_planner",
    "inhibitor": "fastswing_inhibitor",
    "show_arm": "musashi_muscle_bridge",
    "record": "fastswing_planner",
}
NODE_NAMES = {"record": "recorder"}
TIMEOUT_SEC = 60.0
TIMEOUT_FORGIVEN_SEC = 0.5
"""What the nodes of a swing forgive, as in the demo."""
_ASK_AGAIN_SEC = 3.0
_CLEAR_AGAIN_SEC = 5.0
_GRACE_SEC = 1.0
_PUBLISH_AGAIN_SEC = 0.5
_ON_THE_BUS = ("mock_driver", "bridge")


class Suite:
    """Some of the nodes, each a process, and what they publish."""

    def __init__(self, folder: Path, namespace: str = "", domain: int | None = None) -> None:
        """Write the logs into `folder`.

        namespace  of the nodes and of what is listened to, such as /left
        domain     the ROS domain to share with another suite
        """
        self.domain = free_domain() if domain is None else domain
        self.namespace = namespace
        self.processes: dict[str, Process] = {}
        self.robot = load_robot(MUSASHI)
        self.muscles: MuscleState | None = None
        self.posture = np.array([])
        self.joint_states = 0
        self.length_commands: list[LengthCommand] = []
        self.diagnostics: dict[str, DiagnosticStatus] = {}
        self._folder = folder
        self.bus_url = f"udp://127.0.0.1:{free_udp_port()}"
        self._ended: list[Process] = []
        self._others: list[Process] = []
        self._context = rclpy.Context()
        rclpy.init(
            context=self._context,
            domain_id=self.domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.node = Node(
            "beside",
            namespace=namespace,
            context=self._context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._clients: dict[str, Any] = {}
        self._swings: ActionClient | None = None
        newest = QoSProfile(depth=1)
        self.node.create_subscription(MuscleState, "muscle_state", self._on_muscles, newest)
        self.node.create_subscription(JointState, "joint_states", self._on_joints, newest)
        self.node.create_subscription(
            LengthCommand, "length_command", self.length_commands.append, 1000
        )
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 100)

    def _on_muscles(self, message: MuscleState) -> None:
        self.muscles = message

    def _on_joints(self, message: JointState) -> None:
        self.posture = np.array(message.position)
        self.joint_states += 1

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics[status.name] = status

    # Processes.

    def start(self, name: str, **parameters: object) -> Process:
        """Start an executable, in place of one that has ended."""
        return self._start(name, parameters)

    def start_from_file(self, name: str, parameter_file: Path, **parameters: object) -> Process:
        """Start an executable with the parameters of a file, and others behind it."""
        return self._start(name, parameters, "--params-file", str(parameter_file))

    def _start(self, name: str, parameters: Mapping[str, object], *ros_arguments: str) -> Process:
        if name in _ON_THE_BUS:
            parameters = {"bus_url": self.bus_url, **parameters}
        if name in self.processes:
            self._ended.append(self.processes[name])
        log = self._folder / f"{name}_{len(self._ended)}.log"
        namespace = ("-r", f"__ns:={self.namespace}") if self.namespace else ()
        environment = isolated_environment(self.domain)
        ros_arguments = (*namespace, *ros_arguments)
        process = Process(PACKAGES[name], name, parameters, environment, log, ros_arguments)
        self.processes[name] = process
        return process

    def launch(
        self, file: Path, changes: Mapping[str, Mapping[str, object]], **values: str
    ) -> None:
        """Start what a launch file starts with these arguments.

        changes  further parameters by executable, which the file has no arguments for
        """
        environment = isolated_environment(self.domain)
        for program in programs(file, values):
            self.processes[program.name] = Process(
                program.package,
                program.name,
                changes.get(program.name, {}),
                environment,
                self._folder / f"{program.name}.log",
                program.ros_arguments,
                arguments=program.arguments,
            )

    def start_another(self, name: str) -> Process:
        """Start an executable beside the one there is, in a ROS domain of its own."""
        log = self._folder / f"another_{name}.log"
        environment = isolated_environment(free_domain())
        process = Process(PACKAGES[name], name, {"bus_url": self.bus_url}, environment, log)
        self._others.append(process)
        return process

    def start_active(self, *names: str) -> None:
        """Start executables and wait until all of them are active."""
        for name in names:
            self.start(name)
        for name in names:
            self.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)

    def close(self) -> dict[str, int]:
        """End what was started; return the exit codes."""
        codes = stop_all([*self._others, *self.processes.values()], TIMEOUT_SEC)
        if self._swings is not None:
            self._swings.destroy()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)
        return codes

    # Waiting.

    def until(self, what: str, condition: Callable[[], bool]) -> None:
        """Spin until a condition holds; fails after TIMEOUT_SEC."""
        deadline = time.monotonic() + TIMEOUT_SEC
        while not condition():
            if time.monotonic() > deadline:
                tails = [f"{name}:\n{p.log_tail()}" for name, p in self.processes.items()]
                tails.append(f"faults: {None if self.muscles is None else self.muscles.fault}")
                pytest.fail("\n".join([f"waited in vain for {what}", *tails]))
            self._executor.spin_once(timeout_sec=0.02)

    def refuse_dead(self) -> None:
        """Fail if a node has ended."""
        for name, process in self.processes.items():
            if not process.running:
                pytest.fail(f"{name} ended:\n{process.log_tail()}")

    def result_of(self, future: Future, what: str) -> Any:
        """Return the result of a future."""
        self.until(what, future.done)
        return future.result()

    def ask(self, kind: Any, service: str, request: Any) -> Any:
        """Return a service's answer, asking again if it does not come: early ones can get lost."""
        client = self._clients.setdefault(service, self.node.create_client(kind, service))
        pending: list[Future] = []
        asked = -np.inf

        def answered() -> bool:
            nonlocal asked
            self.refuse_dead()
            if client.service_is_ready() and time.monotonic() - asked > _ASK_AGAIN_SEC:
                pending.append(client.call_async(request))
                asked = time.monotonic()
            return any(future.done() for future in pending)

        self.until(f"an answer of {service}", answered)
        # A late repetition must not act on what the test does next.
        grace = time.monotonic() + _GRACE_SEC
        while not all(future.done() for future in pending) and time.monotonic() < grace:
            self._executor.spin_once(timeout_sec=0.02)
        return next(future.result() for future in pending if future.done())

    def trigger(self, service: str) -> None:
        """Call a Trigger service, which must succeed."""
        assert self.ask(Trigger, service, Trigger.Request()).success

    def state_of(self, name: str) -> int:
        """Return the lifecycle state of an executable's node."""
        service = f"{NODE_NAMES.get(name, name)}/get_state"
        return int(self.ask(GetState, service, GetState.Request()).current_state.id)

    def wait_for_state(self, name: str, state: int) -> None:
        """Wait until an executable's node is in a lifecycle state."""
        self.until(f"state {state} of {name}", lambda: self.state_of(name) == state)

    def let_states_pass(self, count: int = 200) -> None:
        """Wait for that many more joint states: time in which the arm could have moved."""
        target = self.joint_states + count
        self.until(f"{count} joint states", lambda: self.joint_states >= target)

    # What is measured.

    def fresh_muscles(self) -> MuscleState:
        """Return a muscle state that arrives after this call."""
        self.muscles = None
        self.until("a muscle state", lambda: self.muscles is not None)
        return self.muscles

    def fresh_posture(self) -> np.ndarray:
        """Return joint angles [rad] that arrive after this call."""
        seen = self.joint_states
        self.until("a joint state", lambda: self.joint_states > seen)
        return self.posture

    def wait_for_modes(self, mode: int) -> None:
        """Wait until every muscle is in a mode (MuscleState.MODE_*) without a fault."""
        self.until(f"mode {mode} of all muscles", lambda: self._all_in(mode))

    def _all_in(self, mode: int) -> bool:
        muscles = self.muscles
        return muscles is not None and set(muscles.mode) == {mode} and not any(muscles.fault)

    def hold(self) -> None:
        """Clear what a stall of this machine may have left, and wait until all muscles hold."""
        cleared = -np.inf

        def held() -> bool:
            nonlocal cleared
            if time.monotonic() - cleared > _CLEAR_AGAIN_SEC:
                # A bridge that has just come back refuses until it knows that it is obeyed.
                answer = self.ask(Trigger, "clear_faults", Trigger.Request())
                cleared = time.monotonic() if answer.success else -np.inf
            return self._all_in(MuscleState.MODE_LENGTH)

        self.until("all muscles to hold", held)

    def reported(self, node: str, key: str) -> str:
        """Return a value of a node's last diagnostics; empty if it is not in them."""
        if node not in self.diagnostics:
            return ""
        return next((v.value for v in self.diagnostics[node].values if v.key == key), "")

    # What is commanded.

    def now(self) -> Header:
        """Return a header with the present stamp."""
        return Header(stamp=self.node.get_clock().now().to_msg())

    def publish_until(
        self,
        publisher: Publisher,
        make: Callable[[], Any],
        what: str,
        condition: Callable[[], bool],
    ) -> None:
        """Publish again and again until a condition holds."""
        published = -np.inf

        def seen() -> bool:
            nonlocal published
            if time.monotonic() - published > _PUBLISH_AGAIN_SEC:
                publisher.publish(make())
                published = time.monotonic()
            return condition()

        self.until(what, seen)

    def goal(self, **changes: Any) -> ExecuteSwing.Goal:
        """Return the goal of the robot's own swing, with some fields changed."""
        return ExecuteSwing.Goal(
            **{
                "start_position": self.robot.postures["start"].tolist(),
                "end_position": self.robot.postures["end"].tolist(),
                **changes,
            }
        )

    def plan(self, **changes: Any) -> PlanSwing.Response:
        """Ask the planner for the robot's own swing, with some fields changed."""
        goal = self.goal(**changes)
        request = PlanSwing.Request(
            joint_name=goal.joint_name,
            start_position=goal.start_position,
            end_position=goal.end_position,
            options=goal.options,
        )
        return self.ask(PlanSwing, "plan_swing", request)

    def send_goal_later(
        self, goal: ExecuteSwing.Goal, on_feedback: Any = None, stamped: bool = True
    ) -> Future:
        """Return the future handle of a swing; it is stamped now, unless it has a stamp."""
        if self._swings is None:
            self._swings = ActionClient(self.node, ExecuteSwing, "execute_swing")
        self.until("execute_swing", self._swings.server_is_ready)
        if stamped and goal.stamp == Time():
            goal.stamp = self.now().stamp
        return self._swings.send_goal_async(goal, feedback_callback=on_feedback)

    def send_goal(self, goal: ExecuteSwing.Goal, on_feedback: Any = None) -> Any:
        """Return the handle of an accepted swing; it is stamped now, unless it has a stamp."""
        handle = self.result_of(self.send_goal_later(goal, on_feedback), "acceptance of the swing")
        assert handle.accepted
        return handle

    def swing_result(self, handle: Any) -> Any:
        """Return status and result of a swing."""
        return self.result_of(handle.get_result_async(), "the result of the swing")

    def execute(self, goal: ExecuteSwing.Goal) -> ExecuteSwing.Result:
        """Return the result of a swing."""
        return self.swing_result(self.send_goal(goal)).result

    def wait_until_swings_are_judged(self) -> None:
        """Wait until goals reach the planner: a goal without angles is refused by it."""
        self.until(
            "execute_swing to reach the planner",
            lambda: self.execute(ExecuteSwing.Goal()).error_code == ErrorCode.WRONG_LENGTH,
        )
