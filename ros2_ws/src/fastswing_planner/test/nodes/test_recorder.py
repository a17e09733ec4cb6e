"""The recorder as a process: what other nodes publish is in the bag when it ends."""

import json
import os
import resource
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rosbags.rosbag2 import Reader
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from fastswing_msgs.msg import SwingPlan
from fastswing_planner.bags import open_bag
from fastswing_planner.bags.writer import NOTES

DOMAIN = 87
TIMEOUT_SEC = 30.0


class World:
    """A node beside the recorder, and the recorders that it started."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=DOMAIN)
        self.node = Node("beside", context=self.context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._processes: list[subprocess.Popen[str]] = []

    def until(self, what: str, condition: Callable[[], bool]) -> None:
        end = time.monotonic() + TIMEOUT_SEC
        while not condition():
            assert time.monotonic() < end, f"timeout while waiting for {what}"
            self._executor.spin_once(timeout_sec=0.05)

    def start(self, *arguments: str, **options: Any) -> "subprocess.Popen[str]":
        command = [sys.executable, "-m", "fastswing_planner.nodes.recorder", "--ros-args"]
        environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(DOMAIN),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        process = subprocess.Popen(
            [*command, *arguments],
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            **options,
        )
        self._processes.append(process)
        return process

    def record(self, path: Path, *arguments: str, **options: Any) -> "subprocess.Popen[str]":
        """Start a recorder and wait until it is active."""
        process = self.start("-p", f"output:={path}", *arguments, **options)
        namespace = next((a.partition(":=")[2] for a in arguments if a.startswith("__ns:=")), "")
        self.wait_for_state(State.PRIMARY_STATE_ACTIVE, namespace)
        return process

    def wait_for_state(self, state: int, namespace: str = "") -> None:
        client = self.node.create_client(GetState, f"{namespace}/recorder/get_state")
        self.until("the recorder's service", client.service_is_ready)
        seen: list[int] = []
        while not seen or seen[-1] != state:
            future = client.call_async(GetState.Request())
            self.until(f"state {state}, at last {seen[-1:]}", future.done)
            result = future.result()
            assert result is not None
            seen.append(result.current_state.id)
        self.node.destroy_client(client)

    def publish(self, publisher: Publisher, *messages: Any) -> None:
        """Publish once the recorder listens, slowly enough for best effort."""
        self.until("the recorder's subscription", lambda: publisher.get_subscription_count() > 0)
        for message in messages:
            publisher.publish(message)
            self._executor.spin_once(timeout_sec=0.002)

    def close(self) -> None:
        for process in self._processes:
            process.kill()
            process.communicate()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    world = World()
    yield world
    world.close()


def end(process: "subprocess.Popen[str]", how: signal.Signals = signal.SIGTERM) -> str:
    """End a recorder, check its exit code, and return what it printed."""
    process.send_signal(how)
    output, _ = process.communicate(timeout=TIMEOUT_SEC)
    assert process.returncode == 0, output
    return output


def decoded(path: Path, topic: str) -> list[Any]:
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return list(reader.iter_decoded_messages(topics=[topic]))


def messages_before_the_end(path: Path) -> int:
    """Return how many messages a stream reader finds in a file that nobody finished."""
    count = 0
    with open(path, "rb") as stream, suppress(EndOfFile, struct.error):
        for record in StreamReader(stream).records:
            count += isinstance(record, Message)
    return count


def joint_states(count: int) -> list[JointState]:
    return [
        JointState(name=["E-p"], position=[float(index)], velocity=[0.0], effort=[0.0])
        for index in range(count)
    ]


def positions(path: Path, topic: str = "/joint_states") -> list[float]:
    return [row.decoded_message.position[0] for row in decoded(path, topic)]


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_every_message_is_in_the_finished_bag(
    world: World, tmp_path: Path, how: signal.Signals
) -> None:
    path = tmp_path / "new" / "a.mcap"
    publisher = world.node.create_publisher(JointState, "joint_states", qos_profile_sensor_data)
    process = world.record(path)
    before = time.time_ns()
    world.publish(publisher, *joint_states(200))
    output = end(process, how)
    rows = decoded(path, "/joint_states")
    assert [row.decoded_message.position[0] for row in rows] == list(range(200)), output
    assert [row.message.sequence for row in rows] == list(range(1, 201))
    for row in rows:
        assert before <= row.message.publish_time <= row.message.log_time <= time.time_ns()


def test_rosbags_reads_what_the_recorder_wrote(world: World, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    publisher = world.node.create_publisher(JointState, "joint_states", qos_profile_sensor_data)
    statuses: list[DiagnosticArray] = []
    world.node.create_subscription(DiagnosticArray, "/diagnostics", statuses.append, 10)
    process = world.record(path)
    world.publish(publisher, *joint_states(10))
    world.until("a status", lambda: bool(statuses))
    end(process)
    with Reader(path) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
    assert counts["/joint_states"] == 10
    assert counts["/diagnostics"] >= 1


def test_a_latched_plan_from_before_is_recorded_with_its_qos(world: World, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = world.node.create_publisher(SwingPlan, "swing_plan", latched)
    publisher.publish(SwingPlan(muscle_name=["#9"], mask=[0], elongation=[0.02]))
    process = world.record(path)
    world.until("the subscription", lambda: publisher.get_subscription_count() > 0)
    time.sleep(0.5)  # the writer's history needs a moment beyond the match
    end(process)
    (row,) = decoded(path, "/swing_plan")
    assert row.decoded_message.muscle_name == ["#9"]
    assert row.channel.metadata["topic_type_hash"].startswith("RIHS01_")
    (profile,) = yaml.safe_load(row.channel.metadata["offered_qos_profiles"])
    assert profile["reliability"] == "reliable"
    assert profile["durability"] == "transient_local"


def test_names_follow_the_namespace_and_other_types_can_be_given(
    world: World, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    own = world.node.create_publisher(JointState, "/left/joint_states", qos_profile_sensor_data)
    other = world.node.create_publisher(String, "/note", 10)
    topics = "topics:=['joint_states', '/note std_msgs/msg/String']"
    process = world.record(path, "-r", "__ns:=/left", "-p", topics)
    world.publish(own, *joint_states(5))
    world.publish(other, String(data="hello"))
    end(process)
    assert positions(path, "/left/joint_states") == list(range(5))
    assert [row.decoded_message.data for row in decoded(path, "/note")] == ["hello"]


def test_an_existing_bag_is_refused_and_kept(world: World, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_text("precious")
    process = world.start("-p", f"output:={path}")
    output, _ = process.communicate(timeout=TIMEOUT_SEC)
    assert process.returncode == 2
    assert f"cannot configure: {path} exists and is never overwritten" in output
    assert path.read_text() == "precious"


@pytest.mark.parametrize(
    ("topics", "complaint"),
    [
        ("['elbow']", "the type of topic 'elbow' is not known: write 'elbow PACKAGE/msg/TYPE'"),
        ("['a no_such_msgs/msg/A']", "message package 'no_such_msgs' is not installed"),
        ("['a b c']", "'b c' is no message type"),
        ("['1/joint_states']", "'1/joint_states' is no topic name"),
        ("['joint_states', '/joint_states']", "topic /joint_states is named more than once"),
    ],
)
def test_a_topic_that_cannot_be_recorded_is_named(
    world: World, tmp_path: Path, topics: str, complaint: str
) -> None:
    process = world.start("-p", f"output:={tmp_path}/a.mcap", "-p", f"topics:={topics}")
    output, _ = process.communicate(timeout=TIMEOUT_SEC)
    assert process.returncode == 2
    assert complaint in output
    assert not (tmp_path / "a.mcap").exists()


def test_without_an_output_the_recorder_says_so(world: World) -> None:
    process = world.start()
    output, _ = process.communicate(timeout=TIMEOUT_SEC)
    assert process.returncode == 2
    assert "set the parameter output to the new .mcap file" in output


def test_a_full_disk_ends_the_recording_and_is_reported(world: World, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    statuses: list[DiagnosticStatus] = []
    world.node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda message: statuses.extend(message.status), 10
    )
    publisher = world.node.create_publisher(JointState, "joint_states", qos_profile_sensor_data)
    process = world.record(
        path,
        *("-p", "compression:=none", "-p", "topics:=['joint_states']"),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, 12_000)),
    )
    world.publish(publisher, *joint_states(500))
    world.wait_for_state(State.PRIMARY_STATE_INACTIVE)
    world.until("an error", lambda: bool(statuses) and statuses[-1].level == DiagnosticStatus.ERROR)
    assert f"cannot write {path}: File too large" in statuses[-1].message
    assert "recording stopped" in end(process)


def test_lost_messages_are_counted(world: World, tmp_path: Path) -> None:
    values: dict[str, str] = {}
    received: list[int] = []

    def note(message: DiagnosticArray) -> None:
        values.update({pair.key: pair.value for pair in message.status[0].values})
        received.append(int(values.get("messages /joint_states", "0")))

    world.node.create_subscription(DiagnosticArray, "/diagnostics", note, 10)
    publisher = world.node.create_publisher(JointState, "joint_states", qos_profile_sensor_data)
    process = world.record(tmp_path / "a.mcap")
    world.publish(publisher, *joint_states(1))
    world.until("the first message", lambda: received[-1:] == [1])
    process.send_signal(signal.SIGSTOP)
    for message in joint_states(1500):  # more than the recorder's queue holds
        publisher.publish(message)
    process.send_signal(signal.SIGCONT)
    # The message after the gap shows the gap, so its place in the queue must be free.
    world.until("an emptied queue", lambda: received[-1] > 1 and received[-1] == received[-2])
    world.publish(publisher, *joint_states(1))
    world.until("every message", lambda: received[-1] + int(values["lost"]) == 1502)
    assert int(values["lost"]) > 0
    end(process)
    assert open_bag(tmp_path / "a.mcap").lost["/joint_states"] == int(values["lost"])


def test_a_recording_is_split_by_time_into_one_bag(world: World, tmp_path: Path) -> None:
    path = tmp_path / "run"
    publisher = world.node.create_publisher(JointState, "joint_states", qos_profile_sensor_data)
    process = world.record(path, "-p", "split_duration:=0.2", "-p", "topics:=['joint_states']")
    world.publish(publisher, *joint_states(1))
    for message in joint_states(3):
        time.sleep(0.25)
        world.publish(publisher, message)
    assert "4 messages recorded in" in end(process)
    assert sorted(one.name for one in path.glob("*.mcap")) == [f"run_{i}.mcap" for i in range(4)]
    with Reader(path) as reader:
        assert reader.message_count == 4
    bag = open_bag(path)
    assert (bag.warnings, bag.lost["/joint_states"]) == ([], 0)
    counts = [
        json.loads(notes["messages"]) for _, name, notes in bag.metadata_records if name == NOTES
    ]
    assert counts == [{"/joint_states": 1}] * 4


def test_a_file_cannot_be_split(world: World, tmp_path: Path) -> None:
    process = world.start("-p", f"output:={tmp_path}/a.mcap", "-p", "split_size:=1000000")
    output, _ = process.communicate(timeout=TIMEOUT_SEC)
    assert process.returncode == 2
    assert (
        "split_size and split_duration need a folder, and output is the file "
        f"'{tmp_path}/a.mcap': leave .mcap away"
    ) in output


def test_a_killed_recorder_keeps_what_is_older_than_the_flush_period(
    world: World, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    publisher = world.node.create_publisher(JointState, "joint_states", qos_profile_sensor_data)
    process = world.record(path, "-p", "topics:=['joint_states']", "-p", "flush_period:=0.05")
    world.publish(publisher, *joint_states(50))
    world.until("the flush", lambda: messages_before_the_end(path) == 50)
    process.kill()
    process.wait(TIMEOUT_SEC)
    assert messages_before_the_end(path) == 50
