"""Robot and task code on two computers: a swing over the cable, the cable cut, the cable back."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import Process, free_domain, isolated_environment, stop_all
from two_hosts import Host, NotPossible, TwoHosts

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import ErrorCode, MuscleState

ROOT = Path(__file__).parents[2]


TIMEOUT_SEC = 90.0
FORGOTTEN_SEC = 60.0
PACKAGES = {
    "mock_driver": "musashi_muscle_bridge",
    "bridge": "musashi_muscle_bridge",
    "planner": "fastswing_planner",
    "swing_executor": "fastswing_planner",
    "inhibitor": "fastswing_inhibitor",
}
BRIDGE = {"control_rate": 200.0, "watchdog_timeout": 1.0}
"""Gentle to a busy machine: what is tried here is the cable between the computers, not the bus."""
INHIBITOR_LIMIT_SEC = 3.5 + 0.05 + 1.0
"""For how long the executor arms the inhibitor, the lease, and a busy machine."""
SETTLED_SEC = 6.0
REQUEST_MAX_AGE_SEC = 1.0
"""The executor's parameter."""
LATE_SEC = 5.0
"""In which a goal arrives after all, once the cable is back."""
STILL = 0.02
"""[rad] by which a held arm may move."""


class View:
    """What one computer sees, from `host_view.py` running there."""

    def __init__(self, host: Host, environment: dict[str, str]) -> None:
        self.lines: list[dict[str, Any]] = []
        self._process = subprocess.Popen(
            [*host.prefix, sys.executable, str(ROOT / "test/hosts/host_view.py")],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.lines.append(json.loads(line))

    @property
    def last(self) -> dict[str, Any]:
        """The newest line; empty before the first."""
        return self.lines[-1] if self.lines else {}

    def send(self, command: str) -> None:
        """Give the view a command."""
        assert self._process.stdin is not None
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()

    def until(
        self, what: str, condition: Callable[[dict[str, Any]], bool], timeout: float = TIMEOUT_SEC
    ) -> dict[str, Any]:
        """Return the first new line for which the condition holds."""
        seen = len(self.lines)
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            while seen < len(self.lines):
                seen += 1
                if condition(self.lines[seen - 1]):
                    return self.lines[seen - 1]
            time.sleep(0.002)
        pytest.fail(f"waited in vain for {what}; last: {self.last}")

    def swing(self, method: str = "INHIBIT") -> list[Any]:
        """Return error code and text of a swing."""
        count = len(self.last["results"])
        self.send(f"swing {method}")
        line = self.until("the swing's result", lambda now: len(now["results"]) > count)
        result: list[Any] = line["results"][-1]
        return result

    def call(self, service: str) -> None:
        """Call a Trigger service and wait for its answer."""
        self.until(service, lambda now: now["ready"][service])
        count = len(self.last["calls"])
        self.send(f"call {service}")
        self.until(f"an answer of {service}", lambda now: len(now["calls"]) > count)

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        if self._process.stdout.closed:
            return
        self._process.stdin.close()
        self._process.wait(TIMEOUT_SEC)
        self._reader.join()
        self._process.stdout.close()


@dataclass
class Laboratory:
    """The suite's nodes on two computers, with a view on each."""

    hosts: TwoHosts
    executor_on: str
    folder: Path
    processes: list[Process] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.environment = {
            **isolated_environment(free_domain()),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
            # Both computers are this one, and would meet in its shared memory.
            "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
        }
        del self.environment["FASTRTPS_DEFAULT_PROFILES_FILE"]  # these two are for one computer
        self.robot = View(self.hosts.robot, self.environment)
        self.task = View(self.hosts.task, self.environment)

    def start(self) -> None:
        """Start every node where it belongs; wait until a swing can begin."""
        on_robot = {"mock_driver", "bridge", "inhibitor"}
        if self.executor_on == "robot":
            on_robot.add("swing_executor")
        for name, package in PACKAGES.items():
            host = self.hosts.robot if name in on_robot else self.hosts.task
            self.processes.append(
                Process(
                    package,
                    name,
                    BRIDGE if name == "bridge" else {},
                    self.environment,
                    self.folder / f"{name}.log",
                    prefix=host.prefix,
                )
            )
        self.robot.until("the robot", lambda now: now["states"] > 0 and "diagnostics" in now)
        self.task.until("the robot", lambda now: now["states"] > 0)

    def swing_until_success(self) -> list[Any]:
        """Return the outcome of a swing; one that a busy machine made fail is tried again."""
        deadline = time.monotonic() + TIMEOUT_SEC
        while True:
            self.task.call("clear_faults")
            self.task.until("the executor", lambda now: now["ready"]["execute_swing"])
            result = self.task.swing()
            if result[0] == ErrorCode.SUCCESS or time.monotonic() > deadline:
                return result

    def cut_in_the_swing(self) -> float:
        """Pull the cable when the arm swings; return when, in monotonic time [s]."""
        self.task.call("clear_faults")
        self.task.send("swing INHIBIT")
        self.task.until("the swing", lambda now: now["phase"] == ExecuteSwing.Feedback.PHASE_SWING)
        self.hosts.cut()
        return time.monotonic()

    def close(self) -> dict[str, int]:
        """End everything; return the nodes' exit codes."""
        codes = stop_all(self.processes, TIMEOUT_SEC)
        self.robot.close()
        self.task.close()
        return codes


@dataclass
class Outage:
    """What happened: a swing, the cable cut in another, both ends forgotten, the cable back."""

    executor_on: str
    swing_before: list[Any]
    on_robot: list[dict[str, Any]]
    """What the robot's computer saw from the cut to the healing."""
    on_task: list[dict[str, Any]]
    cut_at: float
    swing_after: list[Any]
    late_goal: dict[str, Any]
    """What the task code saw of a goal that it sent during a short outage, some time after."""
    running_after: dict[str, bool]
    exit_codes: dict[str, int]
    last_words: dict[str, str]

    @property
    def results_during(self) -> list[Any]:
        """Results of the interrupted swing that reached the task code during the outage."""
        results: list[Any] = self.on_task[-1]["results"]
        return results[len(self.on_task[0]["results"]) :]


def forgotten(robot_sees: dict[str, Any], task_sees: dict[str, Any], executor_on: str) -> bool:
    """Whether neither computer knows the other's publishers any more."""
    lost = robot_sees if executor_on == "task" else task_sees
    return bool(
        task_sees["publishers"]["joint_states"] == 0 and lost["publishers"]["swing_plan"] == 0
    )


def send_a_goal_into_an_outage(laboratory: Laboratory) -> dict[str, Any]:
    """Return what the task code sees of it after the cable is back."""
    laboratory.hosts.cut()
    laboratory.task.send("swing BASIC")
    time.sleep(REQUEST_MAX_AGE_SEC + 3.0)
    laboratory.hosts.heal()
    states = laboratory.task.last["states"]
    laboratory.task.until("fresh states", lambda now: now["states"] > states)
    time.sleep(LATE_SEC)
    return laboratory.task.last


def carry_out(laboratory: Laboratory) -> Outage:
    """Let it happen."""
    robot, task = laboratory.robot, laboratory.task
    laboratory.start()
    swing_before = laboratory.swing_until_success()
    cut_at = laboratory.cut_in_the_swing()
    first = len(robot.lines), len(task.lines)
    deadline = time.monotonic() + FORGOTTEN_SEC
    while not forgotten(robot.last, task.last, laboratory.executor_on):
        assert time.monotonic() < deadline, (robot.last, task.last)
        time.sleep(0.1)
    on_robot, on_task = robot.lines[first[0] :], task.lines[first[1] :]
    laboratory.hosts.heal()
    task.until("fresh states", lambda now: now["states"] > on_task[-1]["states"])
    swing_after = laboratory.swing_until_success()
    late_goal = send_a_goal_into_an_outage(laboratory)
    running = {process.name: process.running for process in laboratory.processes}
    return Outage(
        laboratory.executor_on,
        swing_before,
        on_robot,
        on_task,
        cut_at,
        swing_after,
        late_goal,
        running,
        laboratory.close(),
        {process.name: process.log_tail(60) for process in laboratory.processes},
    )


@pytest.fixture(scope="module", params=["task", "robot"], ids="executor_on_{}".format)
def outage(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Outage]:
    try:
        hosts = TwoHosts()
    except NotPossible as reason:
        pytest.skip(f"no network namespaces here: {reason}")
    laboratory = Laboratory(hosts, request.param, tmp_path_factory.mktemp("hosts"))
    try:
        yield carry_out(laboratory)
    finally:
        laboratory.close()
        hosts.close()


def only(outage: Outage, executor_on: str) -> None:
    if outage.executor_on != executor_on:
        pytest.skip(f"holds with the executor on the {executor_on}'s computer")


def test_a_swing_works_over_the_cable(outage: Outage) -> None:
    assert outage.swing_before == [ErrorCode.SUCCESS, ""]


def test_after_the_cut_every_muscle_comes_back_to_its_length(outage: Outage) -> None:
    assert set(outage.on_robot[-1]["modes"]) == {MuscleState.MODE_LENGTH}


def test_after_the_cut_no_muscle_is_let_go_longer_than_the_inhibitors_time_limit(
    outage: Outage,
) -> None:
    let_go = [
        line["time"] - outage.cut_at
        for line in outage.on_robot
        if MuscleState.MODE_ZERO_CURRENT in line["modes"]
    ]
    assert max(let_go, default=0.0) < INHIBITOR_LIMIT_SEC


def test_a_cut_between_the_computers_is_no_fault_of_the_boards(outage: Outage) -> None:
    assert not any(any(line["faults"]) for line in outage.on_robot)


def test_during_the_outage_the_robot_goes_on_measuring(outage: Outage) -> None:
    assert outage.on_robot[-1]["states"] > outage.on_robot[0]["states"] + 100


def test_the_arm_is_held_still_until_the_cable_is_back(outage: Outage) -> None:
    settled = outage.cut_at + SETTLED_SEC
    late = [line["posture"] for line in outage.on_robot if line["time"] > settled]
    assert np.ptp(np.array(late), axis=0).max() < STILL


def test_the_inhibitor_ends_by_itself(outage: Outage) -> None:
    assert outage.on_robot[-1]["diagnostics"]["inhibitor"]["armed"] == "False"


def test_the_task_code_sees_that_no_state_comes(outage: Outage) -> None:
    assert outage.on_task[-1]["publishers"]["joint_states"] == 0


def test_an_executor_on_the_tasks_computer_aborts_with_stale_state(outage: Outage) -> None:
    only(outage, executor_on="task")
    ((code, text),) = outage.results_during
    assert code == ErrorCode.STALE_STATE
    assert text.startswith("the last measurements are ")


def test_an_executor_beside_the_bridge_finishes_the_swing(outage: Outage) -> None:
    only(outage, executor_on="robot")
    assert outage.on_robot[-1]["diagnostics"]["swing_executor"]["phase"] == "idle"


def test_of_an_executor_beside_the_bridge_the_task_code_hears_nothing(outage: Outage) -> None:
    only(outage, executor_on="robot")
    assert outage.results_during == []


def test_with_the_cable_back_the_next_swing_works(outage: Outage) -> None:
    assert outage.swing_after == [ErrorCode.SUCCESS, ""]


def test_a_goal_that_was_long_on_its_way_moves_nothing(outage: Outage) -> None:
    only(outage, executor_on="robot")
    assert outage.late_goal["phase"] == -1


def test_a_goal_that_was_long_on_its_way_is_answered(outage: Outage) -> None:
    only(outage, executor_on="robot")
    assert outage.late_goal["results"][-1][0] == ErrorCode.STALE_REQUEST


def test_no_node_ended_meanwhile(outage: Outage) -> None:
    assert all(outage.running_after.values()), outage.running_after


def test_every_node_ends_cleanly_afterwards(outage: Outage) -> None:
    unclean = {name: code for name, code in outage.exit_codes.items() if code}
    assert unclean == {}, "\n".join(outage.last_words[name] for name in unclean)
