"""A live inhibitor runs on a bag that is published again, and decides as its replay does."""

import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from lifecycle_msgs.msg import State
from processes import isolated_environment
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from fastswing_inhibitor.inhibition import InhibitionSettings, Reason
from fastswing_inhibitor.replay.replay import replay
from fastswing_msgs.msg import ErrorCode, InhibitionStatus, SwingPlan
from fastswing_msgs.srv import ArmInhibitor
from fastswing_planner.bags import open_bag
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.cdr.stamps import to_ns
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI

if TYPE_CHECKING:
    from test.system.suite import Suite


START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 5_000_000
REST_SEC = 4.0
SETTINGS = InhibitionSettings(state_timeout=0.3)
"""A shared machine stalls for longer than a robot PC may."""
SWING_SEC = 1.0
TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/inhibition_status": "fastswing_msgs/msg/InhibitionStatus",
    "/swing_plan": "fastswing_msgs/msg/SwingPlan",
}


def stamp(time_ns: int) -> Time:
    return Time(sec=time_ns // 1_000_000_000, nanosec=time_ns % 1_000_000_000)


def new_bag(path: Path) -> BagWriter:
    bag = BagWriter(path)
    for name, kind in TYPES.items():
        bag.add_topic(BagTopic(name, kind, definition_text(kind)))
    return bag


def put(bag: BagWriter, topic: str, message: Any, time_ns: int) -> None:
    bag.write(topic, bytes(serialize_message(message)), time_ns, time_ns)


def joint_states(robot: Robot) -> list[tuple[int, JointState]]:
    """Return log time [ns] and message of a rest and a swing, at 200 Hz."""
    start, end = robot.postures["start"], robot.postures["end"]
    rows = []
    for index in range(round((REST_SEC + SWING_SEC) * 1e9) // PERIOD_NS):
        part = np.clip((index * PERIOD_NS * 1e-9 - REST_SEC) / SWING_SEC, 0.0, 1.0)
        moving = 0.0 < part < 1.0
        time_ns = START_NS + index * PERIOD_NS
        message = JointState(
            header=Header(stamp=stamp(time_ns - 1_000_000)),
            name=robot.model.joint_names,
            position=(start + part * (end - start)).tolist(),
            velocity=((end - start) / SWING_SEC * moving).tolist(),
        )
        rows.append((time_ns, message))
    return rows


class Player:
    """A bag that is published again in a process of its own."""

    def __init__(self, suite: "Suite", bag: Path, *options: str) -> None:
        self.clock_ns: list[int] = []
        self.suite = suite
        suite.node.create_subscription(Clock, "/clock", self._on_clock, QoSProfile(depth=100))
        command = [sys.executable, "-m", "fastswing_inhibitor.replay.command", str(bag)]
        self.process = subprocess.Popen(
            [*command, "--publish", *options],
            env=isolated_environment(suite.domain),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def _on_clock(self, message: Clock) -> None:
        self.clock_ns.append(message.clock.sec * 1_000_000_000 + message.clock.nanosec)

    def close(self) -> None:
        if self.process.poll() is None:
            self.end()

    def end(self) -> str:
        self.process.terminate()
        output, _ = self.process.communicate(timeout=30.0)
        return output


@pytest.fixture
def suite(tmp_path: Path) -> Any:
    from test.system.suite import Suite

    suite = Suite(tmp_path)
    yield suite
    suite.close()


@pytest.fixture
def play(suite: "Suite") -> Iterator[Callable[..., Player]]:
    with ExitStack() as players:

        def begin(bag: Path, *options: str) -> Player:
            player = Player(suite, bag, *options)
            players.callback(player.close)
            return player

        yield begin


def write_states(
    path: Path,
    states: Sequence[tuple[int, JointState]],
    robot: Robot | None = None,
    statuses: Sequence[InhibitionStatus] = (),
) -> None:
    """Write joint states into a bag; with a robot also its plan, and what was decided."""
    bag = new_bag(path)
    if robot is not None:
        end = robot.postures["end"].tolist()
        plan = SwingPlan(joint_name=robot.model.joint_names, end_position=end)
        put(bag, "/swing_plan", plan, START_NS)
    for time_ns, message in states:
        put(bag, "/joint_states", message, time_ns)
    for status in statuses:
        time = status.header.stamp
        put(bag, "/inhibition_status", status, to_ns(time.sec, time.nanosec))
    bag.close()


def test_a_live_inhibitor_decides_on_a_bag_as_its_replay_does(
    suite: "Suite", play: Callable[..., Player], tmp_path: Path
) -> None:
    robot = load_robot(MUSASHI)
    states = joint_states(robot)
    write_states(tmp_path / "states.mcap", states)
    statuses: list[InhibitionStatus] = []
    suite.node.create_subscription(InhibitionStatus, "inhibition_status", statuses.append, 1000)
    suite.start("inhibitor", use_sim_time=True, state_timeout=SETTINGS.state_timeout)
    suite.wait_for_state("inhibitor", State.PRIMARY_STATE_ACTIVE)

    player = play(tmp_path / "states.mcap", "--paused")
    suite.until("the paused clock", lambda: len(player.clock_ns) > 10)
    assert set(player.clock_ns) == {START_NS}

    def arm() -> ArmInhibitor.Response:
        request = ArmInhibitor.Request(
            stamp=stamp(player.clock_ns[-1]),
            joint_name=robot.model.joint_names,
            goal_position=robot.postures["end"].tolist(),
            time_limit=Duration(sec=5),
        )
        return suite.ask(ArmInhibitor, "arm_inhibitor", request)

    # Before, the request's stamp is in the future of the inhibitor's clock; then it misses states.
    suite.until("the inhibitor's clock", lambda: arm().error_code == ErrorCode.NOT_READY)
    assert suite.ask(SetBool, "/replay/pause", SetBool.Request(data=False)).success
    suite.until("the rest", lambda: player.clock_ns[-1] > START_NS + 1_500_000_000)
    answer = arm()
    assert (answer.error_code, answer.error_string) == (ErrorCode.SUCCESS, "")
    suite.until("the end", lambda: bool(statuses) and not statuses[-1].armed)
    player.end()
    assert statuses[-1].reason == InhibitionStatus.REASON_GOAL_REACHED
    assert player.clock_ns == sorted(player.clock_ns)

    write_states(tmp_path / "decided.mcap", states, robot, statuses)
    decided = open_bag(tmp_path / "decided.mcap")
    found = replay(decided, robot.model, robot.limits.velocity, settings=SETTINGS)
    (swing,) = found.swings
    assert swing.first_difference is None
    assert len(swing.decisions) > SWING_SEC * 100
    assert swing.end is Reason.GOAL_REACHED


def test_rate_start_duration_and_loop_are_kept(
    suite: "Suite", play: Callable[..., Player], tmp_path: Path
) -> None:
    robot = load_robot(MUSASHI)
    bag = new_bag(tmp_path / "states.mcap")
    for time_ns, message in joint_states(robot):
        put(bag, "/joint_states", message, time_ns)
    bag.close()
    received: list[int] = []
    suite.node.create_subscription(
        JointState, "/joint_states", lambda m: received.append(m.header.stamp.nanosec), 1000
    )
    options = ("--start", "0.1", "--duration", "0.2", "--loop", "--rate", "0.5")
    player = play(tmp_path / "states.mcap", *options)
    suite.until("three rounds", lambda: received.count(199_000_000) >= 3)
    output = player.end()
    assert player.process.returncode == 0
    assert "40 messages published" in output
    assert min(received) >= 99_000_000
    assert max(received) < 300_000_000


def bag_of_an_older_plan(path: Path) -> Path:
    """Write joint states, and a plan whose type has a field less than the installed one."""
    bag = BagWriter(path)
    plan = "fastswing_msgs/msg/SwingPlan"
    older = definition_text(plan).replace("string[] warning ", "# ")
    bag.add_topic(BagTopic("/swing_plan", plan, older))
    joints = "sensor_msgs/msg/JointState"
    bag.add_topic(BagTopic("/joint_states", joints, definition_text(joints)))
    put(bag, "/swing_plan", SwingPlan(), START_NS)
    put(bag, "/joint_states", JointState(), START_NS)
    bag.close()
    return path


OLDER = (
    "/swing_plan cannot be published: recorded with other fields than the installed messages have"
)


def test_a_topic_of_an_older_type_is_left_out(play: Callable[..., Player], tmp_path: Path) -> None:
    player = play(bag_of_an_older_plan(tmp_path / "older.mcap"))
    output, _ = player.process.communicate(timeout=60.0)
    assert player.process.returncode == 0
    assert OLDER in output
    assert "1 messages published" in output


def test_a_named_topic_of_an_older_type_is_refused(
    play: Callable[..., Player], tmp_path: Path
) -> None:
    bag = bag_of_an_older_plan(tmp_path / "older.mcap")
    player = play(bag, "--topic", "/swing_plan")
    output, _ = player.process.communicate(timeout=60.0)
    assert player.process.returncode == 2
    assert OLDER in output
