"""`ros2 run` where ROS's command line is not installed: scripts/without_ros2, last on the path."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROS2 = ROOT / "scripts" / "without_ros2" / "ros2"


def ros2(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run([ROS2, *arguments], capture_output=True, text=True, check=False)


def test_it_becomes_the_executable_with_its_arguments_and_exit_code() -> None:
    run = ros2("run", "fastswing_planner", "plan", "--start", "no such posture")
    assert run.returncode == 2
    assert run.stderr.startswith("plan: ")


def test_a_signal_reaches_the_executable(tmp_path: Path) -> None:
    folder = tmp_path / "lib" / "some_package"
    folder.mkdir(parents=True)
    program = folder / "program"
    program.write_text("#!/bin/sh\necho $$\n")
    program.chmod(0o755)
    environment = {**os.environ, "AMENT_PREFIX_PATH": str(tmp_path)}
    command = [str(ROS2), "run", "some_package", "program"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        printed, _ = process.communicate()
    assert int(printed) == process.pid


def test_a_misspelt_executable_is_told_with_the_choice() -> None:
    run = ros2("run", "fastswing_inhibitor", "inhibit")
    assert run.returncode == 1
    assert run.stderr == (
        "ros2 run: no executable 'inhibit' in fastswing_inhibitor, choose from: inhibitor replay\n"
    )


def test_an_unknown_package_is_told() -> None:
    run = ros2("run", "fastswing", "plan")
    assert (run.returncode, run.stdout) == (1, "")
    assert "no package 'fastswing' with executables" in run.stderr


def test_other_commands_say_what_works() -> None:
    run = ros2("launch", "musashi_muscle_bridge", "mock.launch.xml")
    assert run.returncode == 1
    assert "only ros2 run works" in run.stderr


@pytest.mark.parametrize("installed", [False, True])
def test_the_ros2_of_an_installed_ros_comes_first(installed: bool, tmp_path: Path) -> None:
    own = tmp_path / "ros2"
    if installed:
        own.write_text("#!/bin/sh\n")
        own.chmod(0o755)
    # Only the system's own folders beside it: this computer may have a ros2.
    environment = {"PATH": f"{tmp_path}:/usr/bin:/bin"}
    script = "source scripts/ros_env.bash && source scripts/ros_env.bash && type -P ros2"
    run = subprocess.run(
        ["bash", "-c", script],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    found = Path(run.stdout.strip())
    assert found == (own if installed else ROS2) or found.is_relative_to("/opt/ros")
