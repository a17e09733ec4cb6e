"""Builds small bags, whole and broken, with the `mcap` package alone."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2._dynamic import serialize_dynamic

SECOND = 1_000_000_000
START = 1000 * SECOND
SEPARATOR = "=" * 80
TIME = f"{SEPARATOR}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
HEADER = f"{SEPARATOR}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
JOINT_STATE = (
    "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n"
    f"float64[] effort\n{HEADER}{TIME}"
)
JOINT_STATE_NAME = "sensor_msgs/msg/JointState"
STRING_NAME = "std_msgs/msg/String"
_WRITE_JOINTS = serialize_dynamic(JOINT_STATE_NAME, JOINT_STATE)[JOINT_STATE_NAME]
_WRITE_TEXT = serialize_dynamic(STRING_NAME, "string data\n")[STRING_NAME]


def stamp(time_ns: int) -> dict[str, Any]:
    """Return a header."""
    sec, nanosec = divmod(time_ns, SECOND)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": ""}


def joint_state(position: Sequence[float], time_ns: int = 0) -> bytes:
    """Return a serialised joint state of joints j0, j1, ..."""
    names = [f"j{index}" for index in range(len(position))]
    data = {
        "header": stamp(time_ns),
        "name": names,
        "position": list(position),
        "velocity": [10.0 * value for value in position],
        "effort": [],
    }
    return bytes(_WRITE_JOINTS(data))


def text(content: str) -> bytes:
    """Return a serialised std_msgs/String."""
    return bytes(_WRITE_TEXT({"data": content}))


class Builder:
    """A bag that is being written; leaving the `with` block finishes it."""

    def __init__(self, path: Path, **options: Any) -> None:
        """`options` are those of mcap.writer.Writer."""
        self.path = path
        options.setdefault("compression", CompressionType.ZSTD)
        self.stream = open(path, "wb")  # noqa: SIM115  # closed on leaving
        self.writer = Writer(self.stream, **options)
        self.writer.start(profile="ros2")
        self._channels: dict[str, int] = {}

    def __enter__(self) -> "Builder":
        return self

    def __exit__(self, *error: object) -> None:
        self.writer.finish()
        self.stream.close()

    def topic(
        self, name: str, type_name: str, definition: str, encoding: str = "ros2msg", **more: str
    ) -> "Builder":
        """Announce a topic."""
        schema = self.writer.register_schema(type_name, encoding, definition.encode())
        self._channels[name] = self.writer.register_channel(name, "cdr", schema, more)
        return self

    def joints(self, name: str = "/joint_states") -> "Builder":
        """Announce a topic of joint states."""
        return self.topic(name, JOINT_STATE_NAME, JOINT_STATE)

    def write(self, name: str, data: bytes, time_ns: int, sequence: int = 0) -> None:
        """Write a message that was published 1 us before."""
        self.writer.add_message(self._channels[name], time_ns, data, time_ns - 1000, sequence)


def write_joints(path: Path, count: int = 100, start_ns: int = START, **options: Any) -> Path:
    """Write `count` joint states 10 ms apart, stamped 2 ms before; positions are i and -i."""
    with Builder(path, **options) as bag:
        bag.joints()
        for index in range(count):
            time_ns = start_ns + index * 10_000_000
            data = joint_state([index, -index], time_ns - 2_000_000)
            bag.write("/joint_states", data, time_ns, index + 1)
    return path


def write_idl_beside_joints(path: Path) -> Path:
    """Write a joint state at 5 rad, and a topic whose type is defined in OMG IDL."""
    definition = "module std_msgs { module msg { struct String { string data; }; }; };\n"
    with Builder(path) as bag:
        bag.joints().topic("/text", STRING_NAME, definition, "ros2idl")
        bag.write("/text", text("hello"), START)
        bag.write("/joint_states", joint_state([5.0]), START)
    return path


def folder_of(folder: Path, names: Sequence[str]) -> Path:
    """Write the metadata.yaml of a folder of bags, as far as it is read."""
    content = {"rosbag2_bagfile_information": {"relative_file_paths": list(names)}}
    (folder / "metadata.yaml").write_text(yaml.safe_dump(content))
    return folder


NO_INDEX = {"index_types": IndexType.NONE, "use_statistics": False, "repeat_channels": False}
"""Options of a file that says nothing about what is in it."""
