"""A bag of joint states as the recorder writes it, finished or not, and what can be read of it."""

import struct
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from mcap.exceptions import EndOfFile
from mcap.records import McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from fastswing_planner.bags.metadata import BagTopic, OfferedQos
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.conversion.definitions import definition_text, type_hash

JOINTS = BagTopic(
    "/joint_states",
    "sensor_msgs/msg/JointState",
    definition_text("sensor_msgs/msg/JointState"),
    type_hash("sensor_msgs/msg/JointState"),
    (OfferedQos(reliability="best_effort"),),
)
SECOND = 1_000_000_000
TRUNCATED = (EndOfFile, struct.error)
"""What the stream reader raises in the middle of a record."""


def joint_message(position: float) -> bytes:
    return bytes(serialize_message(JointState(name=["E-p"], position=[position])))


def write_bag(path: Path, count: int = 100, **options: Any) -> BagWriter:
    """Write `count` joint states, 10 ms apart from 1000 s on; the bag stays open."""
    bag = BagWriter(path, **options)
    bag.add_topic(JOINTS)
    for index in range(count):
        log_time = 1000 * SECOND + index * SECOND // 100
        bag.write("/joint_states", joint_message(index), log_time, log_time - 500, index + 1)
    return bag


def until_end(stream: BinaryIO) -> Iterator[McapRecord]:
    """Yield the records before the file ends, however it ends."""
    with suppress(*TRUNCATED):
        yield from StreamReader(stream).records


def readable_positions(path: Path) -> list[float]:
    """Return what can be decoded of a bag that nobody finished."""
    positions = []
    decode = None
    with open(path, "rb") as stream:
        for record in until_end(stream):
            if isinstance(record, Schema):
                decode = DecoderFactory().decoder_for("cdr", record)
            elif isinstance(record, Message):
                assert decode is not None
                positions.append(decode(record.data).position[0])
    return positions
