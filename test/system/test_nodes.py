"""Every executable starts, becomes active and ends as it should."""

import os
import signal
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from ament_index_python.packages import get_package_share_directory
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import State
from rcl_interfaces.srv import GetParameters

if TYPE_CHECKING:
    from test.system.suite import Suite


EXECUTABLES = [
    "mock_driver",
    "bridge",
    "planner",
    "swing_executor",
    "inhibitor",
    "show_arm",
    "record",
]
END_SEC = 60.0


def start(world: "Suite", executable: str, tmp_path: Path) -> None:
    """Start an executable with the least that it needs."""
    parameters = {"output": tmp_path / "bag.mcap"} if executable == "record" else {}
    world.start(executable, **parameters)


@pytest.mark.parametrize("signal_number", [signal.SIGINT, signal.SIGTERM], ids=lambda s: s.name)
@pytest.mark.parametrize("executable", EXECUTABLES)
def test_an_active_node_ends_with_0_on(
    world: "Suite", executable: str, signal_number: signal.Signals, tmp_path: Path
) -> None:
    start(world, executable, tmp_path)
    world.wait_for_state(executable, State.PRIMARY_STATE_ACTIVE)
    process = world.processes[executable]
    process.send(signal_number)
    assert process.wait(END_SEC) == 0, process.log_tail()


@pytest.mark.parametrize("executable", EXECUTABLES)
def test_an_ended_node_leaves_no_traceback(world: "Suite", executable: str, tmp_path: Path) -> None:
    start(world, executable, tmp_path)
    world.wait_for_state(executable, State.PRIMARY_STATE_ACTIVE)
    process = world.processes[executable]
    process.send(signal.SIGINT)
    process.wait(END_SEC)
    assert "Traceback" not in process.log.read_text()


@pytest.mark.parametrize("executable", EXECUTABLES)
def test_a_node_uses_no_shared_memory_of_dds(
    world: "Suite", executable: str, tmp_path: Path
) -> None:
    # A node that follows a killed one could lose its port there, and be deaf; docs/safety.md.
    start(world, executable, tmp_path)
    world.wait_for_state(executable, State.PRIMARY_STATE_ACTIVE)
    maps = Path(f"/proc/{world.processes[executable].pid}/maps").read_text()
    assert "fastrtps_port" not in maps


@pytest.mark.parametrize("executable", EXECUTABLES)
def test_a_node_loads_nothing_heavy_that_it_does_not_use(
    world: "Suite", executable: str, tmp_path: Path
) -> None:
    start(world, executable, tmp_path)
    world.wait_for_state(executable, State.PRIMARY_STATE_ACTIVE)
    maps = Path(f"/proc/{world.processes[executable].pid}/maps").read_text()
    assert [name for name in ("glfw", "/matplotlib/", "/pandas/", "/scipy/") if name in maps] == []


@pytest.mark.parametrize("executable", EXECUTABLES)
def test_the_timers_of_a_node_and_of_its_middleware_are_tight(
    world: "Suite", executable: str, tmp_path: Path
) -> None:
    start(world, executable, tmp_path)
    world.wait_for_state(executable, State.PRIMARY_STATE_ACTIVE)
    process = world.processes[executable].pid
    threads = [thread.name for thread in Path(f"/proc/{process}/task").iterdir()]
    slack = {name: int(Path(f"/proc/{name}/timerslack_ns").read_text()) for name in threads}
    assert slack[str(process)] == 1
    # numpy's own threads are older.
    assert sum(value == 1 for value in slack.values()) > len(threads) / 2


def test_who_begins_to_listen_to_diagnostics_need_not_wait_for_their_next_turn(
    world: "Suite",
) -> None:
    world.start("inhibitor")
    heard: list[Time] = []

    def listen(callback: Callable[[DiagnosticArray], None]) -> None:
        world.node.create_subscription(DiagnosticArray, "/diagnostics", callback, 10)

    def shortest_gap() -> float:
        times = [stamp.sec + stamp.nanosec * 1e-9 for stamp in heard]
        return min((later - one for one, later in pairwise(times)), default=np.inf)

    listen(lambda message: heard.append(message.header.stamp))
    world.until("diagnostics", lambda: bool(heard))
    listen(lambda _: None)
    # Between two turns, which are a second apart.
    world.until("diagnostics out of turn", lambda: shortest_gap() < 0.75)


def test_all_threads_of_a_node_run_on_the_cores_of_its_parameter(world: "Suite") -> None:
    core = min(os.sched_getaffinity(0))
    process = world.start("inhibitor", cpu_affinity=f"[{core}]")
    world.wait_for_state("inhibitor", State.PRIMARY_STATE_ACTIVE)
    threads = Path(f"/proc/{process.pid}/task").iterdir()
    assert {tuple(os.sched_getaffinity(int(one.name))) for one in threads} == {(core,)}


def test_what_the_kernel_refuses_is_a_warning_of_a_node_that_works(world: "Suite") -> None:
    process = world.start("inhibitor", cpu_affinity="[1023]")
    world.wait_for_state("inhibitor", State.PRIMARY_STATE_ACTIVE)
    text = "cpu_affinity [1023] refused: Invalid argument"
    world.until("diagnostics", lambda: "inhibitor" in world.diagnostics)
    status = world.diagnostics["inhibitor"]
    assert (status.level, status.message) == (DiagnosticStatus.WARN, text)
    assert text in process.log.read_text()


@pytest.mark.parametrize("executable", ["bridge", "inhibitor", "planner", "swing_executor"])
def test_a_node_takes_the_parameter_file(world: "Suite", executable: str) -> None:
    share = Path(get_package_share_directory("musashi_muscle_bridge"))
    process = world.start_from_file(executable, share / "config" / "nodes.yaml")
    world.wait_for_state(executable, State.PRIMARY_STATE_ACTIVE)
    assert "WARN" not in process.log.read_text()


def test_a_section_of_a_parameter_file_is_for_its_node_alone(
    world: "Suite", tmp_path: Path
) -> None:
    path = tmp_path / "nodes.yaml"
    path.write_text(
        "/**/bridge: {ros__parameters: {control_rate: 5000.0}}\n"
        "/**/inhibitor: {ros__parameters: {lease: 0.1}}\n"
    )
    world.start_from_file("inhibitor", path)
    world.wait_for_state("inhibitor", State.PRIMARY_STATE_ACTIVE)
    request = GetParameters.Request(names=["lease"])
    (lease,) = world.ask(GetParameters, "/inhibitor/get_parameters", request).values
    assert lease.double_value == 0.1
    assert world.start_from_file("bridge", path).wait(END_SEC) == 2


def test_an_argument_behind_the_parameter_file_wins(world: "Suite", tmp_path: Path) -> None:
    path = tmp_path / "nodes.yaml"
    path.write_text("/**/bridge: {ros__parameters: {control_rate: 5000.0}}\n")
    world.start_from_file("bridge", path, control_rate=200.0)
    world.wait_for_state("bridge", State.PRIMARY_STATE_ACTIVE)


def test_a_parameter_out_of_range_ends_the_node_with_2(world: "Suite") -> None:
    assert world.start("bridge", control_rate=-5.0).wait(END_SEC) == 2


def test_a_parameter_out_of_range_is_told_in_one_line(world: "Suite") -> None:
    process = world.start("bridge", control_rate=-5.0)
    process.wait(END_SEC)
    (line,) = process.log.read_text().splitlines()
    assert "control_rate is -5.0, expected 10 to 2000 Hz" in line


def test_a_watchdog_shorter_than_three_periods_is_refused(world: "Suite") -> None:
    process = world.start("bridge", control_rate=100.0, watchdog_timeout=0.02)
    assert process.wait(END_SEC) == 2
    assert "at least 3 control periods, 0.03 s at 100 Hz" in process.log.read_text()


def test_a_number_without_its_decimal_point_is_told_so(world: "Suite") -> None:
    process = world.start("bridge", control_rate=200)
    assert process.wait(END_SEC) == 2
    (line,) = process.log.read_text().splitlines()
    assert "'control_rate' to '200'" in line
    assert line.endswith("write it with a decimal point")


def test_a_parameter_of_wrong_type_is_told_in_one_line(world: "Suite") -> None:
    process = world.start("bridge", control_rate="fast")
    process.wait(END_SEC)
    (line,) = process.log.read_text().splitlines()
    assert "control_rate" in line


@pytest.mark.parametrize("executable", EXECUTABLES[:-1])
def test_a_missing_robot_description_ends_the_node_with_2(
    world: "Suite", executable: str, tmp_path: Path
) -> None:
    missing = tmp_path / "no_such_robot.yaml"
    process = world.start(executable, robot_description=missing)
    assert process.wait(END_SEC) == 2
    (line,) = process.log.read_text().splitlines()
    assert str(missing) in line


def test_a_request_to_arm_the_inhibitor_expires_on_its_way(world: "Suite") -> None:
    world.start_active("swing_executor")

    def lifespans() -> list[int]:
        writers = world.node.get_publishers_info_by_topic("rq/arm_inhibitorRequest", True)
        return [writer.qos_profile.lifespan.nanoseconds for writer in writers]

    world.until("the executor's client", lambda: len(lifespans()) == 1)
    assert lifespans() == [1_000_000_000]
