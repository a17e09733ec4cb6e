"""How fast bags become numpy columns, beside the libraries that decode message by message."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from builtin_interfaces.msg import Time
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_msgs.msg import CurrentOverride, MuscleState
from fastswing_planner.bags import open_bag
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.conversion.definitions import definition_text

TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/muscle_state": "fastswing_msgs/msg/MuscleState",
    "/current_override": "fastswing_msgs/msg/CurrentOverride",
}
JOINTS = ["S-p", "S-r", "S-y", "E-p", "E-y"]
MUSCLES = [f"#{number}" for number in range(1, 11)]
_VARIANTS = 50
_START_NS = 1_700_000_000_000_000_000


def samples() -> dict[str, list[bytes]]:
    """Return some serialised messages of each topic."""
    random = np.random.default_rng(0)

    def numbers(count: int) -> list[float]:
        return [float(value) for value in random.normal(size=count)]

    found: dict[str, list[bytes]] = {name: [] for name in TYPES}
    for index in range(_VARIANTS):
        header = Header(stamp=Time(sec=1, nanosec=index))
        messages = {
            "/joint_states": JointState(
                header=header,
                name=JOINTS,
                position=numbers(5),
                velocity=numbers(5),
                effort=numbers(5),
            ),
            "/muscle_state": MuscleState(
                header=header,
                name=MUSCLES,
                length=numbers(10),
                velocity=numbers(10),
                tension=numbers(10),
                current=numbers(10),
                temperature=numbers(10),
                mode=[3] * 10,
                fault=[0] * 10,
            ),
            "/current_override": CurrentOverride(header=header, name=MUSCLES[: index % 4]),
        }
        for name, message in messages.items():
            found[name].append(bytes(serialize_message(message)))
    return found


def write_bag(path: Path, count: int, topics: tuple[str, ...] = tuple(TYPES)) -> Path:
    """Write `count` messages of each topic at 1 kHz."""
    messages = samples()
    bag = BagWriter(path)
    for name in topics:
        bag.add_topic(BagTopic(name, TYPES[name], definition_text(TYPES[name])))
    for index in range(count):
        for name in topics:
            time_ns = _START_NS + index * 1_000_000
            bag.write(name, messages[name][index % _VARIANTS], time_ns, time_ns, index)
    bag.close()
    return path


def read_columns(path: Path, topic: str) -> int:
    """Read a topic into columns; returns the number of messages."""
    return open_bag(path).columns(topic).count


def read_with_mcap(path: Path, topic: str) -> int:
    """Decode a topic with mcap-ros2-support; returns the number of messages."""
    with open(path, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        return sum(1 for _ in reader.iter_decoded_messages(topics=[topic]))


def read_with_rosbags(path: Path, topic: str) -> int:
    """Decode a topic with rosbags; returns the number of messages."""
    with AnyReader([path]) as reader:
        wanted = [one for one in reader.connections if one.topic == topic]
        rows = reader.messages(connections=wanted)
        return sum(reader.deserialize(data, one.msgtype) is not None for one, _, data in rows)


READERS: dict[str, Callable[[Path, str], int]] = {
    "columns": read_columns,
    "rosbags": read_with_rosbags,
    "mcap-ros2-support": read_with_mcap,
}
