"""One arm whose boards are on two buses: all of it holds, and the loss of one is the loss of one.

The second bus goes through a relay that the tests cut.
"""

import select
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml
from processes import free_udp_port

from fastswing_msgs.msg import MuscleState
from fastswing_planner.robot.path import MUSASHI, resolve_path

if TYPE_CHECKING:
    from test.system.suite import Suite


MUSCLES = [f"#{number}" for number in range(1, 11)]
JOINTS = ["S-p", "S-r", "S-y", "E-p", "E-y"]
FIRST, SECOND = slice(0, 5), slice(5, 10)


class Relay:
    """Carries datagrams between the bridge and one group's boards, unless it is cut."""

    def __init__(self, boards: tuple[str, int]) -> None:
        self._boards = boards
        self._near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._near.bind(("127.0.0.1", 0))
        self._far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._far.bind(("127.0.0.1", 0))
        self.url = f"udp://127.0.0.1:{self._near.getsockname()[1]}"
        self.cut = False
        self._ended = False
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def _carry(self) -> None:
        bridge: Any = None
        while not self._ended:
            for end in select.select([self._near, self._far], [], [], 0.1)[0]:
                frame, sender = end.recvfrom(65507)
                if end is self._near:
                    bridge = sender
                to, out = (self._boards, self._far) if end is self._near else (bridge, self._near)
                if not self.cut and to is not None:
                    out.sendto(frame, to)

    def close(self) -> None:
        self._ended = True
        self._thread.join()
        self._near.close()
        self._far.close()


def description(folder: Path, joints_on: int) -> Path:
    """Write Musashi's description with its boards on two buses; return its path."""
    original = resolve_path(MUSASHI)
    content = yaml.safe_load(original.read_text())
    content["mjcf"] = str(original.parent / content["mjcf"])
    content["board_groups"] = [{"muscles": MUSCLES[FIRST]}, {"muscles": MUSCLES[SECOND]}]
    content["board_groups"][joints_on]["joints"] = JOINTS
    path = folder / "two_buses.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


class TwoBuses:
    """A suite with the arm on two buses, the second of which can be cut."""

    def __init__(self, suite: "Suite", folder: Path, joints_on: int = 0) -> None:
        self.suite = suite
        ports = free_udp_port(), free_udp_port()
        self.relay = Relay(("127.0.0.1", ports[1]))
        robot = description(folder, joints_on)
        boards = [f"udp://127.0.0.1:{port}" for port in ports]
        suite.start("mock_driver", robot_description=robot, bus_url=" ".join(boards))
        bridge = f"{boards[0]} {self.relay.url}"
        suite.start("bridge", robot_description=robot, bus_url=bridge)
        suite.hold()

    def modes(self, part: slice) -> set[int]:
        return set(self.suite.fresh_muscles().mode[part])

    def wait_for_faults(self) -> None:
        self.suite.until(
            "the second bus to be missed",
            lambda: set(self.suite.fresh_muscles().fault[SECOND]) == {MuscleState.FAULT_BUS},
        )


@pytest.fixture
def arm(world: "Suite", tmp_path: Path) -> Iterator[TwoBuses]:
    arm = TwoBuses(world, tmp_path)
    yield arm
    arm.relay.close()


def test_an_arm_on_two_buses_is_held_as_one(arm: TwoBuses) -> None:
    assert list(arm.suite.fresh_muscles().name) == MUSCLES
    assert arm.modes(slice(None)) == {MuscleState.MODE_LENGTH}


def test_the_muscles_of_a_lost_bus_are_faulty_and_the_others_hold(arm: TwoBuses) -> None:
    arm.relay.cut = True
    arm.wait_for_faults()
    assert arm.suite.muscles is not None
    assert set(arm.suite.muscles.fault[FIRST]) == {MuscleState.FAULT_NONE}
    assert arm.modes(FIRST) == {MuscleState.MODE_LENGTH}


def test_the_diagnostics_name_the_lost_bus_and_its_muscles(arm: TwoBuses) -> None:
    arm.relay.cut = True
    arm.suite.until(
        "its muscles",
        lambda: arm.suite.reported("bridge", "lost") == ", ".join(MUSCLES[SECOND]),
    )
    assert int(arm.suite.reported("bridge", "bus1_misses_in_a_row")) > 0
    assert arm.suite.diagnostics["bridge"].message == f"the boards do not answer on {arm.relay.url}"


def test_a_bus_that_is_back_stays_faulty_until_faults_are_cleared(arm: TwoBuses) -> None:
    arm.relay.cut = True
    arm.wait_for_faults()
    arm.relay.cut = False
    arm.suite.until(
        "the answers", lambda: arm.suite.reported("bridge", "bus1_misses_in_a_row") == "0"
    )
    assert MuscleState.FAULT_NONE not in arm.suite.fresh_muscles().fault[SECOND]
    arm.suite.hold()


def test_joints_are_told_while_the_bus_that_measures_none_is_lost(arm: TwoBuses) -> None:
    arm.relay.cut = True
    arm.wait_for_faults()
    arm.suite.let_states_pass()


def test_joints_are_not_told_while_the_bus_that_measures_them_is_lost(
    world: "Suite", tmp_path: Path
) -> None:
    arm = TwoBuses(world, tmp_path, joints_on=1)
    try:
        arm.relay.cut = True
        arm.wait_for_faults()
        before = world.joint_states
        for _ in range(100):
            world.fresh_muscles()
        assert world.joint_states <= before + 1  # one may have been under way
    finally:
        arm.relay.close()


def test_too_few_buses_end_the_bridge_with_2_and_one_line(world: "Suite", tmp_path: Path) -> None:
    url = "udp://127.0.0.1:48800"
    process = world.start("bridge", robot_description=description(tmp_path, 0), bus_url=url)
    assert process.wait(60.0) == 2
    (line,) = process.log.read_text().splitlines()
    assert line.endswith(
        f"cannot configure: bus_url '{url}' has 1 URLs, the robot has 2 board_groups: "
        "write one URL for each, separated by blanks"
    )
