"""Every command in the README runs: here, or in the test that stands beside it below.

`ros2` is not everywhere where the tests run. What it would start, call or set is done directly.
"""

import ast
import re
import shlex
import subprocess
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml
from ament_index_python.packages import get_package_share_directory
from lifecycle_msgs.msg import State
from processes import Process, executable, isolated_environment
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.parameter import Parameter

from fastswing_msgs.msg import MuscleState
from fastswing_planner.robot.path import MUSASHI

if TYPE_CHECKING:
    from test.system.suite import Suite

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
BEGINNINGS = ("cd", "git", "make", "python", "ros2", "rosdep", "source")

PLAN = "ros2 run fastswing_planner plan --search exhaustive --plot plan.png"
LAUNCH = (
    "ros2 launch musashi_muscle_bridge robot.launch.xml bus_url:=udp://HOST:PORT "
    "robot_description:=FILE"
)
SWING = "ros2 run fastswing_planner swing"
BRIDGE = "ros2 run musashi_muscle_bridge bridge --ros-args -p bus_url:=udp://HOST:PORT"
BREAK_A_WIRE = """ros2 param set /mock_driver broken_wire "['#9']\""""
CALL = "ros2 service call {} std_srvs/srv/Trigger"

# Command, and the test that runs it: of this file, or of the one named.
RUN_BY = {
    "git clone URL fastswing": "test_a_clone_has_the_commands",
    "cd fastswing": "test_a_clone_has_the_commands",
    "make": "test_a_clone_has_the_commands",
    "make build": "test_make_build_ends_with_0",
    "make demo": "demo/test_demo.py::test_the_demo_ends_with_0",
    # This run.
    "make test": "test_make_test_runs_all_tests",
    "make unit": "test_make_unit_needs_no_build",
    # What it would install; it is not here.
    "rosdep install": "house/test_packages.py::test_every_module_that_is_imported_is_declared",
    "ros2 run": (
        "house/test_ros2_run.py::test_it_becomes_the_executable_with_its_arguments_and_exit_code"
    ),
    "source scripts/ros_env.bash": "test_the_environment_has_the_packages",
    SWING: "system/test_swing_command.py::test_a_swing_tells_its_phases_and_figures",
    PLAN: "test_plan_prints_what_the_readme_shows",
    LAUNCH: "test_the_launched_bridge_holds_the_arm",
    BRIDGE: "test_a_single_node_starts",
    BREAK_A_WIRE: "test_a_wire_breaks_when_the_parameter_is_set",
    CALL.format("/hold_posture"): "test_the_stops_do_what_the_table_says",
    CALL.format("/emergency_stop"): "test_the_stops_do_what_the_table_says",
    CALL.format("/clear_faults"): "test_the_stops_do_what_the_table_says",
}
# What a dry run of make shows, and the file whose tests run the same program.
PROGRAMS = {
    "demo": ("demo/run_demo.py", "demo/test_demo.py"),
    "fit": ("fit/kinematic_fit.py", "fit/test_fits.py"),
}


def blocks() -> list[str]:
    """Return the blocks in no programming language: commands, and what they print."""
    return [content for language, content in BLOCK.findall(README) if not language]


def commands() -> set[str]:
    """Return every command in the README, in a block or within a line."""
    lines = [line for block in blocks() for line in block.splitlines()]
    text = BLOCK.sub("", README)
    spans = [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", text)]
    parts = [part.strip() for line in [*lines, *spans] for part in line.split("&&")]
    # `ros2` alone is the name of a program, not a command.
    return {p for p in parts if p.split(" ")[0] in BEGINNINGS and p not in ("ros2", "python")}


def dry_run(target: str) -> str:
    command = ["make", "--no-print-directory", "-n", target]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def test_every_command_has_a_test_that_runs_it() -> None:
    assert commands() == set(RUN_BY)


@pytest.mark.parametrize("command", RUN_BY)
def test_the_test_that_runs_a_command_exists(command: str) -> None:
    file, _, name = RUN_BY[command].rpartition("::")
    tree = ast.parse((ROOT / "test" / (file or f"docs/{Path(__file__).name}")).read_text())
    assert name in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


@pytest.mark.parametrize("target", PROGRAMS)
def test_a_make_target_starts_the_program_that_its_test_runs(target: str) -> None:
    program, file = PROGRAMS[target]
    assert program in dry_run(target)
    assert Path(program).stem in (ROOT / "test" / file).read_text()


def test_make_test_runs_all_tests() -> None:
    assert "scripts/ros_env python scripts/run_tests.py all" in dry_run("test")


def test_make_unit_needs_no_build() -> None:
    shown = dry_run("unit")
    assert "scripts/run_tests.py unit" in shown
    assert "build_workspace" not in shown


def test_a_clone_has_the_commands(tmp_path: Path) -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("not a git repository")
    clone = tmp_path / "fastswing"
    subprocess.run(["git", "clone", "-q", ROOT, clone], check=True)
    listed = subprocess.run(["make"], cwd=clone, capture_output=True, text=True, check=True).stdout
    assert re.search(r"^make demo +\w", listed, re.MULTILINE)


def test_make_build_ends_with_0() -> None:
    assert subprocess.run(["make", "build"], cwd=ROOT, check=False).returncode == 0


def test_the_environment_has_the_packages() -> None:
    script = "source scripts/ros_env.bash && python -c 'import fastswing_msgs.msg'"
    subprocess.run(["bash", "-c", script], cwd=ROOT, check=True)


def test_plan_prints_what_the_readme_shows(tmp_path: Path) -> None:
    _, _, package, name, *arguments = shlex.split(PLAN)
    run = subprocess.run(
        [executable(package, name), *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    (shown,) = (block for block in blocks() if block.startswith("method"))
    assert shown in run.stdout
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")


def test_an_installed_interface_tells_its_units() -> None:
    share = Path(get_package_share_directory("fastswing_msgs"))
    for path in share.glob("msg/*.msg"):
        assert "#" in path.read_text(), path
    assert "# [N] never negative" in (share / "msg" / "MuscleState.msg").read_text()


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator["Suite"]:
    """Start what the README starts on the robot; the mock driver stands for the boards."""
    from test.system.suite import Suite

    suite = Suite(tmp_path_factory.mktemp("robot"))
    try:
        suite.start("mock_driver")
        _, _, package, file, *arguments = shlex.split(filled(LAUNCH, suite))
        values = dict(argument.split(":=", 1) for argument in arguments)
        path = Path(get_package_share_directory(package)) / "launch" / file
        suite.launch(path, {"bridge": {"watchdog_timeout": 0.5}}, **values)
        for name in ("bridge", "planner", "swing_executor", "inhibitor"):
            suite.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)
        suite.hold()
        yield suite
    finally:
        suite.close()


def filled(command: str, suite: "Suite") -> str:
    """Return a command with the mock driver's address and our robot's file."""
    return command.replace("udp://HOST:PORT", suite.bus_url).replace("FILE", MUSASHI)


def call(suite: "Suite", command: str) -> Any:
    """Do what `ros2 service call NAME TYPE` does."""
    *_, name, kind = command.split()
    package, _, type_name = kind.split("/")
    service = getattr(import_module(f"{package}.srv"), type_name)
    return suite.ask(service, name, service.Request())


def test_the_launched_bridge_holds_the_arm(robot: "Suite") -> None:
    robot.wait_for_modes(MuscleState.MODE_LENGTH)


def test_a_parameter_describes_itself(robot: "Suite") -> None:
    request = DescribeParameters.Request(names=["watchdog_timeout"])
    (row,) = robot.ask(DescribeParameters, "/bridge/describe_parameters", request).descriptors
    assert row.description.endswith(".")
    assert re.search(r"\d.* s", row.additional_constraints)


def test_the_stops_do_what_the_table_says(robot: "Suite") -> None:
    assert call(robot, CALL.format("/emergency_stop")).success
    robot.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    assert call(robot, CALL.format("/clear_faults")).success
    robot.wait_for_modes(MuscleState.MODE_LENGTH)
    before = robot.fresh_muscles().holds
    assert call(robot, CALL.format("/hold_posture")).success
    robot.until("the hold", lambda: robot.fresh_muscles().holds > before)


def test_a_wire_breaks_when_the_parameter_is_set(robot: "Suite") -> None:
    *_, node, name, value = shlex.split(BREAK_A_WIRE)
    setting = Parameter(name, value=yaml.safe_load(value)).to_parameter_msg()
    request = SetParameters.Request(parameters=[setting])
    (result,) = robot.ask(SetParameters, f"{node}/set_parameters", request).results
    assert result.successful
    biceps = list(robot.fresh_muscles().name).index("#9")
    robot.until("a slack wire", lambda: robot.fresh_muscles().tension[biceps] == 0.0)


def test_a_single_node_starts(world: "Suite", tmp_path: Path) -> None:
    _, _, package, name, *arguments = shlex.split(filled(BRIDGE, world))
    environment = isolated_environment(world.domain)
    log = tmp_path / "single.log"
    world.processes[name] = Process(package, name, {}, environment, log, arguments=arguments)
    world.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)
