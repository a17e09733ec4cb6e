"""What the launch files start works, with names remapped too, and on bags."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from ament_index_python.packages import get_package_share_directory
from bag_of_swings import BagOfSwings, stamp
from builtin_interfaces.msg import Duration, Time
from lifecycle_msgs.msg import State
from processes import free_udp_port
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_msgs.msg import ErrorCode, InhibitionStatus
from fastswing_msgs.srv import ArmInhibitor
from fastswing_planner.robot.description import Robot
from test.system.launch_rehearsal import LaunchError, Program, programs

if TYPE_CHECKING:
    from test.system.suite import Suite

LAUNCH = Path(get_package_share_directory("musashi_muscle_bridge")) / "launch"
FILES = sorted(path.name for path in LAUNCH.glob("*.launch.xml"))
WRAPPER = """
<launch>
  <group>
    <set_remap from="joint_states" to="measured/joints"/>
    <include file="$(find-pkg-share musashi_muscle_bridge)/launch/mock.launch.xml">
      <arg name="namespace" value="/left"/>
      <arg name="bus_url" value="udp://127.0.0.1:PORT"/>
      <arg name="control_rate" value="200.0"/>
    </include>
  </group>
</launch>
"""
REST_SEC, SWING_SEC = 10.0, 1.0
# What a file has no default for.
VALUES = {"bus_url": "udp://192.0.2.1:48800", "bag": "run.mcap"}


@pytest.fixture
def left(tmp_path: Path) -> Iterator["Suite"]:
    from test.system.suite import Suite

    suite = Suite(tmp_path, "/left")
    yield suite
    suite.close()


def started(name: str, **values: str) -> list[Program]:
    return programs(LAUNCH / name, VALUES | values)


@pytest.mark.parametrize("name", FILES)
def test_every_node_is_put_into_the_namespace(name: str) -> None:
    for program in started(name, namespace="/left"):
        if program.ros_arguments:
            assert "__ns:=/left" in program.ros_arguments


@pytest.mark.parametrize("name", ["replay.launch.xml", "robot.launch.xml"])
def test_an_argument_without_default_must_be_given(name: str) -> None:
    with pytest.raises(LaunchError, match="is not given and has no default"):
        programs(LAUNCH / name, {})


def test_an_argument_reaches_every_node_that_it_is_for() -> None:
    for program in started("robot.launch.xml", robot_description="my_arm.yaml"):
        assert "robot_description:=my_arm.yaml" in program.ros_arguments


def test_bridge_and_mock_driver_meet_on_the_same_bus() -> None:
    found = {p.name: set(p.ros_arguments) for p in started("mock.launch.xml")}
    assert f"bus_url:={VALUES['bus_url']}" in found["bridge"] & found["mock_driver"]


def test_a_file_of_ones_own_can_include_ours_and_remap_its_names(
    left: "Suite", tmp_path: Path
) -> None:
    wrapper = tmp_path / "wrapper.launch.xml"
    wrapper.write_text(WRAPPER.replace("PORT", str(free_udp_port())))
    left.launch(wrapper, {})
    left.wait_for_state("bridge", State.PRIMARY_STATE_ACTIVE)
    left.wait_for_state("inhibitor", State.PRIMARY_STATE_ACTIVE)
    node = left.node
    new, old = "/left/measured/joints", "/left/joint_states"
    left.until("the new name", lambda: node.count_publishers(new) == 1)
    left.until("readers of the new name", lambda: node.count_subscribers(new) >= 2)
    assert (node.count_publishers(old), node.count_subscribers(old)) == (0, 1)


def write_swing(path: Path, robot: Robot) -> Path:
    """Write the joint states of a rest, a swing at constant speed and a rest, at 200 Hz."""
    bag = BagOfSwings(path)
    start, end = robot.postures["start"], robot.postures["end"]
    for time in np.arange(0.0, REST_SEC + 2.0 * SWING_SEC, 0.005):
        part = float(np.clip((time - REST_SEC) / SWING_SEC, 0.0, 1.0))
        state = JointState(
            header=Header(stamp=stamp(time)),
            name=robot.model.joint_names,
            position=(start + part * (end - start)).tolist(),
            velocity=((end - start) / SWING_SEC * (0.0 < part < 1.0)).tolist(),
        )
        bag.add("/left/joint_states", time, state)
    return bag.write()


def test_replay_shows_a_bag_to_a_live_inhibitor_and_prints_its_swings(
    left: "Suite", tmp_path: Path
) -> None:
    clock: list[Time] = [Time()]
    statuses: list[InhibitionStatus] = []
    left.node.create_subscription(Clock, "/clock", lambda m: clock.append(m.clock), 1)
    left.node.create_subscription(InhibitionStatus, "inhibition_status", statuses.append, 10)
    bag = write_swing(tmp_path / "swing.mcap", left.robot)
    timeout = {"inhibitor": {"state_timeout": 0.3}}
    left.launch(LAUNCH / "replay.launch.xml", timeout, bag=str(bag), namespace="/left")
    analyse = left.processes.pop("analyse")
    left.wait_for_state("inhibitor", State.PRIMARY_STATE_ACTIVE)
    soon = stamp(REST_SEC - 3.0).sec
    left.until("the swing to come", lambda: clock[-1].sec >= soon)
    request = ArmInhibitor.Request(
        stamp=clock[-1],
        joint_name=left.robot.model.joint_names,
        goal_position=left.robot.postures["end"].tolist(),
        time_limit=Duration(sec=5),
    )
    answer = left.ask(ArmInhibitor, "arm_inhibitor", request)
    assert (answer.error_code, answer.error_string) == (ErrorCode.SUCCESS, "")
    left.until("an inhibited muscle", lambda: any(status.inhibited for status in statuses))
    assert analyse.wait(60.0) == 0
    assert "1.34 E-p" in analyse.log.read_text()
