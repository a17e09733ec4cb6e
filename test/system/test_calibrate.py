"""`calibrate` with an operator who follows a script, on the emulated arm."""

import os
import pty
import signal
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import yaml
from processes import executable, isolated_environment

from fastswing_msgs.msg import MuscleState

if TYPE_CHECKING:
    from test.system.suite import Suite

_TIMEOUT_SEC = 120.0


def calibrate(
    world: "Suite", output: Path, answers: str, *arguments: str
) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [
            str(executable("musashi_muscle_bridge", "calibrate")),
            "--output",
            str(output),
            *arguments,
        ],
        env=isolated_environment(world.domain),
        input=answers,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=_TIMEOUT_SEC,
    )


def found(output: Path) -> dict[str, dict[str, object]]:
    muscles: dict[str, dict[str, object]] = yaml.safe_load(output.read_text())["muscles"]
    return muscles


def test_a_sound_muscle_is_pulled_and_written(bridge_and_mock: "Suite", tmp_path: Path) -> None:
    bridge_and_mock.hold()
    output = tmp_path / "found.yaml"
    run = calibrate(bridge_and_mock, output, "\n\n", "--muscles", "#6")
    assert run.returncode == 0, run.stdout
    assert found(output)["#6"]["verdict"] == "sound"


def test_the_emulated_arms_length_zeros_are_right(bridge_and_mock: "Suite", tmp_path: Path) -> None:
    bridge_and_mock.hold()
    output = tmp_path / "found.yaml"
    run = calibrate(bridge_and_mock, output, "\n\n\n", "--muscles", "#3", "#9")
    assert run.returncode == 0, run.stdout
    assert [one["length_offset"] for one in found(output).values()] == pytest.approx(
        [0.0, 0.0], abs=1e-3
    )


def test_afterwards_the_muscle_holds(bridge_and_mock: "Suite", tmp_path: Path) -> None:
    bridge_and_mock.hold()
    calibrate(bridge_and_mock, tmp_path / "found.yaml", "\n\n", "--muscles", "#6")
    bridge_and_mock.until(
        "a hold",
        lambda: set(bridge_and_mock.fresh_muscles().mode) == {MuscleState.MODE_LENGTH},
    )


def test_a_broken_wire_is_found_and_told_by_the_exit_code(world: "Suite", tmp_path: Path) -> None:
    world.start("mock_driver", broken_wire="['#6']")
    world.start("bridge")
    world.hold()
    output = tmp_path / "found.yaml"
    run = calibrate(world, output, "\n\n", "--muscles", "#6")
    assert run.returncode == 1, run.stdout
    assert found(output)["#6"]["verdict"] == "no_tension"


def test_a_skipped_muscle_is_not_pulled(bridge_and_mock: "Suite", tmp_path: Path) -> None:
    bridge_and_mock.hold()
    output = tmp_path / "found.yaml"
    run = calibrate(bridge_and_mock, output, "\ns\n", "--muscles", "#6")
    assert run.returncode == 1
    assert found(output) == {"#6": {"verdict": "skipped"}}


def test_q_ends_it_and_writes_nothing(bridge_and_mock: "Suite", tmp_path: Path) -> None:
    output = tmp_path / "found.yaml"
    run = calibrate(bridge_and_mock, output, "q\n")
    assert run.returncode == 1
    assert not output.exists()


def test_a_read_only_bridge_pulls_nothing(world: "Suite", tmp_path: Path) -> None:
    world.start("mock_driver")
    world.start("bridge", read_only=True)
    world.fresh_muscles()
    run = calibrate(world, tmp_path / "found.yaml", "\n\n", "--muscles", "#6")
    assert run.returncode == 1
    assert "muscles that do not hold a length: #1, #2" in run.stdout


def test_under_an_emergency_stop_nothing_is_pulled(
    bridge_and_mock: "Suite", tmp_path: Path
) -> None:
    bridge_and_mock.hold()
    bridge_and_mock.trigger("emergency_stop")
    bridge_and_mock.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    run = calibrate(bridge_and_mock, tmp_path / "found.yaml", "\n\n", "--muscles", "#6")
    assert run.returncode == 1
    assert "end an emergency stop with clear_faults" in run.stdout


def test_with_a_fault_nothing_is_pulled(world: "Suite", tmp_path: Path) -> None:
    world.start("mock_driver", dead_board="['#1']")
    world.start("bridge", watchdog_timeout=0.5)  # a stall of this machine is no fault of the others
    world.until("the fault", lambda: any(world.fresh_muscles().fault))
    run = calibrate(world, tmp_path / "found.yaml", "\n\n", "--muscles", "#6")
    assert run.returncode == 1
    assert "faulty muscles: #1; find the cause, then clear_faults" in run.stdout


def test_without_a_bridge_it_says_so(world: "Suite", tmp_path: Path) -> None:
    run = calibrate(world, tmp_path / "found.yaml", "\n\n", "--muscles", "#6")
    assert run.returncode == 1
    assert "is the bridge active, do its boards answer?" in run.stdout


def test_an_existing_file_is_not_overwritten(world: "Suite", tmp_path: Path) -> None:
    output = tmp_path / "found.yaml"
    output.write_text("mine")
    assert calibrate(world, output, "").returncode == 2
    assert output.read_text() == "mine"


def test_ctrl_c_in_a_terminal_ends_it(bridge_and_mock: "Suite", tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [
            str(executable("musashi_muscle_bridge", "calibrate")),
            "--output",
            str(tmp_path / "found.yaml"),
        ],
        env=isolated_environment(bridge_and_mock.domain),
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
        start_new_session=True,
    )
    os.close(theirs)
    seen = b""
    try:
        while b"Enter goes on" not in seen:
            seen += os.read(ours, 1000)
        process.send_signal(signal.SIGINT)
        assert process.wait(_TIMEOUT_SEC) == 1
    finally:
        process.kill()
        process.wait()
        os.close(ours)
