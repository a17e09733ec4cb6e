"""Bags beside the libraries that most people use: read, write, analyse, replay, record, growth."""

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from bag_reading import READERS, TYPES, samples, write_bag
from decided_bag import TOPICS as DECIDED
from decided_bag import write_decided_bag
from growth_picture import Line, draw
from mcap.writer import CompressionType, Writer
from mcap_ros2.writer import Writer as EncodingWriter
from rclpy.serialization import deserialize_message
from recording import record_four_topics
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagsWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rounds import Program, Row, Samples, in_turns, row

from fastswing_inhibitor.replay.replay import replay
from fastswing_msgs.msg import MuscleState
from fastswing_planner.analysis.finding import FindingSettings
from fastswing_planner.analysis.reading import read_recordings
from fastswing_planner.bags import open_bag
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI

QUESTION = "What does a message of a bag cost to read, write, analyse and replay, beside others?"
READ, WRITTEN, GROWN = "/muscle_state", "/muscle_state", "/joint_states"
COUNTS = (10_000, 100_000, 1_000_000)
ROSBAGS, MCAP = "rosbags", "mcap-ros2-support"
_START_NS = 1_700_000_000_000_000_000
_MOST_OTHERS = 100_000  # messages; they take minutes for a million


def run(scale: float, plots: Path | None = None) -> list[Row]:
    """Measure; 1.0 takes about six minutes."""
    rounds, count = max(1, round(5 * scale)), max(500, round(20_000 * scale))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = _reading(write_bag(folder / "read.mcap", count), rounds)
        rows += _replaying(folder, max(500, count // 4), rounds)
        rows += _writing(folder, count, rounds)
        rows += _recording(folder, max(2.0, 15.0 * scale))
        grown = _growth(folder, scale)
    if plots is not None:
        panels = {"messages": {reader: line for reader, (line, _) in grown.items()}}
        draw(panels, "reading [s]", plots / "performance_bags.png")
    return rows + [one for _, found in grown.values() for one in found]


def each(call: Callable[[], int]) -> Program:
    """Return a program that gives the time for each message of a call that returns their count."""

    def program() -> Samples:
        begin = time.perf_counter()
        count = call()
        return np.array([(time.perf_counter() - begin) / count])

    return program


def _reading(bag: Path, rounds: int) -> list[Row]:
    rows = []
    for topic in TYPES:
        calls = {name: each(partial(read, bag, topic)) for name, read in READERS.items()}
        found = in_turns(calls, rounds)
        rows += _beside_rosbags(f"read {topic}", found)
    found = in_turns(
        {"analyse": each(lambda: _analysed(bag)), ROSBAGS: each(lambda: _decoded(bag))}, rounds
    )
    against = (f"{ROSBAGS} decoding the same", found[ROSBAGS])
    return [*rows, row("what analyse reads", found["analyse"], "us", against)]


def _replaying(folder: Path, count: int, rounds: int) -> list[Row]:
    robot = load_robot(MUSASHI)
    bag = write_decided_bag(folder / "decided.mcap", robot, count)

    def replayed() -> int:
        found = replay(open_bag(bag), robot.model, robot.limits.velocity)
        if [swing.agreed for swing in found.swings] != [count]:
            raise RuntimeError("the replayed decisions differ")
        return count

    def decoded() -> int:
        return sum(READERS[ROSBAGS](bag, topic) for topic in DECIDED) // len(DECIDED)

    found = in_turns({"replay": each(replayed), ROSBAGS: each(decoded)}, rounds)
    against = (f"{ROSBAGS} decoding the same", found[ROSBAGS])
    return [row("replay a decision", found["replay"], "us", against)]


def _beside_rosbags(title: str, found: dict[str, list[Samples]]) -> list[Row]:
    return [
        row(
            f"{title}, {name}",
            rounds,
            "us",
            None if name == ROSBAGS else (ROSBAGS, found[ROSBAGS]),
            note=f"{1.0 / float(np.median(np.concatenate(rounds))):,.0f} messages per second",
        )
        for name, rounds in found.items()
    ]


def _analysed(bag: Path) -> int:
    (recording,) = read_recordings(bag.name, open_bag(bag), FindingSettings())
    return sum(len(one.received) for one in recording.topics)


def _decoded(bag: Path) -> int:
    return sum(READERS[ROSBAGS](bag, topic) for topic in TYPES)


@dataclass(frozen=True)
class BagWriting:
    """Writes the same messages again and again, in four ways; each returns how many.

    messages  what `payloads` hold
    """

    path: Path
    count: int
    payloads: Sequence[bytes]
    messages: Sequence[MuscleState]
    definition: str

    def ours(self) -> int:
        """Write with `fastswing_planner`."""
        self.path.unlink(missing_ok=True)
        write_bag(self.path, self.count, (WRITTEN,))
        return self.count

    def plain(self) -> int:
        """Write bytes with `mcap`."""
        with self.path.open("wb") as stream:
            writer = Writer(stream, compression=CompressionType.ZSTD)
            writer.start()
            schema = writer.register_schema(TYPES[WRITTEN], "ros2msg", self.definition.encode())
            channel = writer.register_channel(WRITTEN, "cdr", schema)
            for index, stamp in self._stamps():
                data = self.payloads[index % len(self.payloads)]
                writer.add_message(channel, stamp, data, stamp, index)
            writer.finish()
        return self.count

    def encoding(self) -> int:
        """Write messages with `mcap-ros2-support`."""
        with self.path.open("wb") as stream:
            writer = EncodingWriter(stream)
            schema = writer.register_msgdef(TYPES[WRITTEN], self.definition)
            for index, stamp in self._stamps():
                message = self.messages[index % len(self.messages)]
                writer.write_message(WRITTEN, schema, message, stamp, stamp, index)
            writer.finish()
        return self.count

    def rosbags(self) -> int:
        """Write bytes with `rosbags`."""
        types = get_typestore(Stores.ROS2_JAZZY)
        types.register(get_types_from_msg(self.definition, TYPES[WRITTEN]))
        with (
            tempfile.TemporaryDirectory() as name,
            RosbagsWriter(
                Path(name) / "bag", version=9, storage_plugin=StoragePlugin.MCAP
            ) as writer,
        ):
            link = writer.add_connection(WRITTEN, TYPES[WRITTEN], typestore=types)
            for index, stamp in self._stamps():
                writer.write(link, stamp, self.payloads[index % len(self.payloads)])
        return self.count

    def _stamps(self) -> Iterator[tuple[int, int]]:
        return ((index, _START_NS + index * 1_000_000) for index in range(self.count))


def _writing(folder: Path, count: int, rounds: int) -> list[Row]:
    payloads = samples()[WRITTEN]
    messages = [deserialize_message(data, MuscleState) for data in payloads]
    definition = definition_text(TYPES[WRITTEN])
    by = BagWriting(folder / "written.mcap", count, payloads, messages, definition)
    programs = {"ours": by.ours, ROSBAGS: by.rosbags, "mcap": by.plain, MCAP: by.encoding}
    found = in_turns({name: each(call) for name, call in programs.items()}, rounds)
    return _beside_rosbags(f"write {WRITTEN}", found)


def _recording(folder: Path, seconds: float) -> list[Row]:
    found = record_four_topics(folder, seconds)
    share = row("recorder, four topics at 1 kHz", [np.array([found["cpu"]])], "s")
    missing = sum(found["gaps"].values())
    note = f"{missing} of {sum(found['sent'].values())} messages missing"
    return [Row(share.name, 100.0 * share.median, unit="% of a core", note=note)]


def _growth(folder: Path, scale: float) -> dict[str, tuple[Line, list[Row]]]:
    grown: dict[str, tuple[list[tuple[float, float]], list[Row]]] = {n: ([], []) for n in READERS}
    for whole in COUNTS:
        count = max(200, round(whole * min(scale, 1.0)))
        bag = write_bag(folder / f"grown_{whole}.mcap", count, (GROWN,))
        for name, read in READERS.items():
            if name != "columns" and whole > _MOST_OTHERS:
                continue
            found = in_turns({name: each(partial(read, bag, GROWN))}, 1)[name]
            line, rows = grown[name]
            line.append((count, count * float(found[0][0])))
            rows.append(row(f"read {count:,} joint states, {name}", found, "us"))
    return {name: (line, rows) for name, (line, rows) in grown.items()}
