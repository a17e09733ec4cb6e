"""Bridge and mock driver over a serial line and over a laboratory's own bus."""

import os
import signal
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from lab_bus_page import install_lab_bus
from lifecycle_msgs.msg import State

from fastswing_msgs.msg import MuscleState

if TYPE_CHECKING:
    from test.system.suite import Suite


@pytest.fixture(scope="module")
def lab_bus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return install_lab_bus(tmp_path_factory.mktemp("lab"))


@pytest.fixture(params=["serial", "lab"])
def url(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "serial":
        return f"serial://{tmp_path}/boards?pty=true"
    path = f"{request.getfixturevalue('lab_bus')}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"
    monkeypatch.setenv("PYTHONPATH", path)
    return f"lab://{tmp_path}/lab.socket"


@pytest.fixture
def holding(world: "Suite", url: str) -> "Suite":
    """Let the bridge hold the arm over this bus."""
    world.start("mock_driver", bus_url=url)
    world.wait_for_state("mock_driver", State.PRIMARY_STATE_ACTIVE)
    world.start("bridge", bus_url=url)
    world.fresh_muscles()
    world.hold()
    return world


def test_the_arm_is_held_over_any_bus(holding: "Suite") -> None:
    assert set(holding.fresh_muscles().mode) == {MuscleState.MODE_LENGTH}


def test_a_killed_bridge_is_noticed_by_the_boards_on_any_bus(holding: "Suite") -> None:
    holding.processes["bridge"].send(signal.SIGKILL)
    holding.until("the watchdogs", lambda: holding.reported("mock_driver", "faulty_boards") == "10")


def test_boards_that_started_again_are_found_and_get_no_current(holding: "Suite", url: str) -> None:
    boards = holding.processes["mock_driver"]
    boards.send(signal.SIGTERM)
    boards.wait(60.0)
    holding.start("mock_driver", bus_url=url)
    holding.until("their names", lambda: "#10" in holding.reported("bridge", "rebooted"))
    assert set(holding.fresh_muscles().mode) == {MuscleState.MODE_ZERO_CURRENT}


def test_boards_that_started_again_hold_after_clear_faults(holding: "Suite", url: str) -> None:
    boards = holding.processes["mock_driver"]
    boards.send(signal.SIGTERM)
    boards.wait(60.0)
    holding.start("mock_driver", bus_url=url)
    holding.until("their names", lambda: "#10" in holding.reported("bridge", "rebooted"))
    holding.hold()


def test_a_second_bridge_on_the_same_boards_is_refused(bridge_and_mock: "Suite") -> None:
    bridge_and_mock.hold()
    second = bridge_and_mock.start_another("bridge")
    bridge_and_mock.until(
        "a count", lambda: int(bridge_and_mock.reported("mock_driver", "refused_foreign") or 0) > 0
    )
    second.send(signal.SIGTERM)
    assert second.wait(60.0) == 0
    assert set(bridge_and_mock.fresh_muscles().mode) == {MuscleState.MODE_LENGTH}
