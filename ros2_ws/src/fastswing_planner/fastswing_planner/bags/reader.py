"""Reads MCAP bags into numpy columns; needs neither ROS nor the message packages.

    bag = open_bag("run.mcap")                    # files, folders with metadata.yaml, or several
    print(bag.topics)                             # name -> Topic(name, type, message_count, qos)
    joints = bag.columns(bag.topic_of_type("sensor_msgs/msg/JointState"), time="header")
    joints.time                                   # [s] since 1970, float64, shape (k,)
    joints.time_ns                                # [ns] since 1970, int64, shape (k,)
    joints["position"]                            # [rad] shape (k, n)
    joints.names("name")                          # ('S-p', 'S-r', ...)
    for part in bag.stream("/muscle_state"): ...  # the same in parts, memory stays flat
    for time_ns, plan in bag.messages("/swing_plan"): ...  # plain objects, nested ones too
    bag.lost                                      # topic -> messages the recorder knows it lost
    bag.metadata                                  # metadata records: 'fastswing_recorder', ...
    bag.warnings                                  # what was recovered or lost; reading adds to it

Everything here raises a `BagError` whose text is one line.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import yaml
from mcap.records import Channel

from fastswing_planner.bags.files import bag_files
from fastswing_planner.bags.mcap_file import McapFile
from fastswing_planner.bags.mcap_scan import scan
from fastswing_planner.bags.topic_decoder import TimeBase, TopicDecoder, named
from fastswing_planner.bags.writer import NOTES
from fastswing_planner.cdr.batch import Messages, merged
from fastswing_planner.cdr.columns import (
    Columns,
    field_paths,
    joined,
)
from fastswing_planner.cdr.idl import parse_ros2idl
from fastswing_planner.cdr.layout import decode
from fastswing_planner.cdr.schema import Schema, parse_ros2msg
from fastswing_planner.errors import (
    BagError,
    UndecodableMessage,
    UnknownTopic,
    UnreadableBag,
    one_line,
)

__all__ = ["Bag", "BagError", "Columns", "TimeBase", "Topic", "open_bag"]
_PARSERS = {"ros2msg": parse_ros2msg, "ros2idl": parse_ros2idl}
_CHUNK = 8192
_MOST_HELD = 1 << 24
"""[bytes] of blocks that are kept as a whole while a batch is collected."""
_LARGEST_STEP_BACK_NS = 10_000_000
"""[ns] messages may be recorded in another order than they came."""


@dataclass(frozen=True)
class Topic:
    """One topic of a bag.

    type           'package/msg/Name'
    message_count  what the bag says, or what was recovered
    qos            of each publisher in rosbag2's words; empty if the bag does not say
    definition     text of the type
    encoding       of the definition: 'ros2msg' or 'ros2idl'
    type_hash      'RIHS01_...'; empty if the bag does not say
    """

    name: str
    type: str
    message_count: int
    qos: tuple[Mapping[str, Any], ...] = ()
    definition: str = ""
    encoding: str = "ros2msg"
    type_hash: str = ""


class Bag:
    """Several MCAP files as one; `open_bag` makes it."""

    def __init__(self, files: Sequence[McapFile], warnings: Sequence[str] = ()) -> None:
        """Put files together, the earliest first."""
        self._files = sorted(files, key=lambda file: (file.empty, file.start_ns))
        self._own_warnings = list(warnings)
        self._topics = _topics(self._files)
        self._schemas: dict[tuple[str, str, bytes], Schema] = {}

    @property
    def paths(self) -> tuple[Path, ...]:
        """The files."""
        return tuple(file.path for file in self._files)

    @property
    def topics(self) -> Mapping[str, Topic]:
        """All topics by name, those without messages too."""
        return self._topics

    @property
    def message_count(self) -> int:
        """Messages of all topics."""
        return sum(topic.message_count for topic in self._topics.values())

    @property
    def start_ns(self) -> int:
        """[ns] first log time; 0 if the bag is empty."""
        return min((file.start_ns for file in self._files if not file.empty), default=0)

    @property
    def end_ns(self) -> int:
        """[ns] last log time; 0 if the bag is empty."""
        return max((file.end_ns for file in self._files), default=0)

    @property
    def warnings(self) -> list[str]:
        """What was recovered or lost so far, a line each."""
        lines = [*self._own_warnings, *(line for file in self._files for line in file.warnings)]
        return [one_line(line) for line in lines]

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """Metadata records by name; of several with one name the last."""
        return {name: content for _, name, content in self.metadata_records}

    @property
    def metadata_records(self) -> list[tuple[Path, str, dict[str, str]]]:
        """All metadata records: file, name, content."""
        return [
            (file.path, record.name, record.metadata)
            for file in self._files
            for record in file.metadata
        ]

    @property
    def lost(self) -> dict[str, int]:
        """Messages that our recorder knows it lost, by topic; empty if the bag does not say."""
        total: dict[str, int] = {}
        for _, name, content in self.metadata_records:
            for topic, count in _lost_in(content).items() if name == NOTES else ():
                total[topic] = total.get(topic, 0) + count
        return total

    def topics_of_type(self, type_name: str) -> list[str]:
        """Return the topics of a type that have messages, the one with most messages first."""
        found = [topic for topic in self._topics.values() if topic.type == type_name]
        found.sort(key=lambda topic: -topic.message_count)
        return [topic.name for topic in found if topic.message_count]

    def topic_of_type(self, type_name: str, suffix: str = "") -> str:
        """Return the one topic of a type with messages, and with that end of its name.

        Raises UnknownTopic if there is none, or more than one.
        """
        names = [name for name in self.topics_of_type(type_name) if name.endswith(suffix)]
        if len(names) == 1:
            return names[0]
        ending = f" ending in '{suffix}'" if suffix else ""
        if names:
            raise UnknownTopic(
                f"more than one topic{ending} of type {type_name}, name one: {', '.join(names)}"
            )
        raise UnknownTopic(f"{self._title()} has no messages of type {type_name}{ending}")

    def fields(self, topic: str) -> tuple[str, ...]:
        """Return the paths of a topic's columns; raises UnknownTopic or UndecodableMessage."""
        paths = [field_paths(self._schema(*found)) for found in self._channels(topic)]
        return tuple(dict.fromkeys(path for found in paths for path in found))

    def schemas(self, topic: str) -> list[Schema]:
        """Return what a topic's messages are made of, once for each file and definition.

        Raises UnknownTopic, UndecodableMessage.
        """
        return [self._schema(file, channel) for file, channel in self._channels(topic)]

    def columns(
        self, topic: str, time: TimeBase = "log", fields: Sequence[str] | None = None
    ) -> Columns:
        """Return all messages of a topic as columns, in the order of recording.

        time    the time base of `Columns.time`
        fields  the paths wanted; None: all

        Raises UnknownTopic, or UndecodableMessage, also for messages with different fields.
        """
        parts = list(self.stream(topic, time, fields))
        if len(parts) == 1:
            return parts[0]
        if any(part.fields.keys() != parts[0].fields.keys() for part in parts):
            raise UndecodableMessage(
                f"{topic} has messages with different fields: name those that all of them have, "
                "or read it as plain messages"
            )
        return Columns(
            topic,
            np.concatenate([part.time_ns for part in parts]),
            np.concatenate([part.log_time_ns for part in parts]),
            np.concatenate([part.publish_time_ns for part in parts]),
            np.concatenate([part.sequence for part in parts]),
            {path: joined([part.fields[path] for part in parts]) for path in parts[0].fields},
        )

    def stream(
        self,
        topic: str,
        time: TimeBase = "log",
        fields: Sequence[str] | None = None,
        chunk: int = _CHUNK,
    ) -> Iterator[Columns]:
        """Yield a topic's messages as columns of about `chunk` messages; at least one part.

        Raises UnknownTopic or UndecodableMessage.
        """
        if time not in ("log", "publish", "header"):
            raise UnknownTopic(f"no time base '{time}'; choose from: log, publish, header")
        decoders: dict[Schema, TopicDecoder] = {}
        newest = -1
        for schema, batch in self._batches(topic, chunk):
            if schema not in decoders:
                decoders[schema] = TopicDecoder(topic, schema, time, fields)
            columns = decoders[schema].decode(batch)
            self._check_order(columns, newest)
            newest = int(columns.log_time_ns[-1])
            yield columns
        if newest == -1:
            schema = self._schema(*self._channels(topic)[0])
            yield TopicDecoder(topic, schema, time, fields).decode([])

    def messages(self, topic: str) -> Iterator[tuple[int, SimpleNamespace]]:
        """Yield log time [ns] and message of a topic, in the order of recording.

        Fields are attributes, arrays and sequences are lists. Slower than columns, but for every
        layout. Raises UnknownTopic or UndecodableMessage.
        """
        for schema, batch in self._batches(topic, 1):
            for messages in batch:
                times = messages.log_time_ns.tolist()
                for log_time, data in zip(times, messages.data(), strict=True):
                    yield log_time, named(topic, decode, schema, data)

    def raw_messages(self, topic: str) -> Iterator[tuple[int, int, bytes]]:
        """Yield log time [ns], publish time [ns] and CDR bytes of a topic's messages."""
        for _, batch in self._batches(topic, 1):
            for messages in batch:
                times = messages.log_time_ns.tolist(), messages.publish_time_ns.tolist()
                yield from zip(*times, messages.data(), strict=True)

    def _check_order(self, columns: Columns, newest: int) -> None:
        """Warn if the recorder's clock went back after the time `newest` [ns] or later."""
        steps = np.diff(columns.log_time_ns, prepend=newest if newest >= 0 else 0)
        if steps.size and steps.min() < -_LARGEST_STEP_BACK_NS:
            at = int(steps.argmin())
            line = (
                f"{columns.topic}: the recorder's clock went back by {-steps[at] * 1e-9:.3f} s, "
                f"to {columns.log_time_ns[at] * 1e-9:.3f} s"
            )
            if line not in self._own_warnings:
                self._own_warnings.append(line)

    def _title(self) -> str:
        return ", ".join(path.name for path in self.paths)

    def _channels(self, topic: str) -> list[tuple[McapFile, Channel]]:
        found = [
            (file, channel)
            for file in self._files
            for channel in file.channels.values()
            if channel.topic == topic
        ]
        if not found:
            raise UnknownTopic(
                f"{self._title()} has no topic {topic}; it has: {', '.join(self._topics) or 'none'}"
            )
        return found

    def _schema(self, file: McapFile, channel: Channel) -> Schema:
        record = file.schemas.get(channel.schema_id)
        if record is None:
            raise UndecodableMessage(
                f"{file.path.name} does not define the type of {channel.topic}"
            )
        if channel.message_encoding != "cdr" or record.encoding not in _PARSERS:
            raise UndecodableMessage(
                f"{channel.topic} is '{channel.message_encoding}' with a definition in "
                f"'{record.encoding}'; only cdr with ros2msg or ros2idl can be read"
            )
        key = (record.name, record.encoding, record.data)
        if key not in self._schemas:
            text = record.data.decode("utf-8", "replace")
            self._schemas[key] = _PARSERS[record.encoding](record.name, text)
        return self._schemas[key]

    def _batches(self, topic: str, size: int) -> Iterator[tuple[Schema, list[Messages]]]:
        """Yield a topic's messages in batches of one type, of `size` or the rest of a block."""
        channels = self._channels(topic)
        for file in self._files:
            schemas = {c.id: self._schema(file, c) for owner, c in channels if owner is file}
            waiting: list[Messages] = []
            waiting_for: Schema | None = None
            held = 0
            for schema, messages in _in_order(file.read(schemas), schemas):
                if waiting and waiting_for is not None and schema is not waiting_for:
                    yield waiting_for, waiting
                    waiting, held = [], 0
                waiting.append(messages)
                held += len(messages.content)
                if held > _MOST_HELD:
                    waiting, held = [part.alone() for part in waiting], 0
                waiting_for = schema
                if sum(map(len, waiting)) >= size:
                    yield schema, waiting
                    waiting, held = [], 0
            if waiting and waiting_for is not None:
                yield waiting_for, waiting


def _in_order(
    parts: Iterator[tuple[int, Messages]], schemas: Mapping[int, Schema]
) -> Iterator[tuple[Schema, Messages]]:
    """Yield each block's messages by type, those of several channels in the order of recording."""
    for _, block in groupby(parts, key=lambda part: id(part[1].content)):
        of_type: dict[Schema, list[Messages]] = {}
        for channel, messages in block:
            of_type.setdefault(schemas[channel], []).append(messages)
        for schema, several in of_type.items():
            yield schema, several[0] if len(several) == 1 else merged(several)


def open_bag(*paths: str | Path) -> Bag:
    """Open MCAP files and folders of them as one bag; raises BagError.

    A folder is what `ros2 bag record -s mcap` writes: files, and `metadata.yaml` that names them.
    """
    if not paths:
        raise UnreadableBag("name a bag")
    warnings: list[str] = []
    found = bag_files([Path(path) for path in paths], warnings)
    files = []
    complaints = []
    for path in found:
        try:
            files.append(scan(path))
        except UnreadableBag as error:
            complaints.append(error)
    if not files:
        raise complaints[0]
    return Bag(files, [*warnings, *map(str, complaints)])


def _lost_in(notes: Mapping[str, str]) -> dict[str, int]:
    """Return what one file's recorder says it lost, by topic."""
    try:
        counts = json.loads(notes["lost"])
        return {str(topic): int(count) for topic, count in counts.items()}
    except (KeyError, ValueError, TypeError, AttributeError):
        return {}


def _topics(files: Sequence[McapFile]) -> dict[str, Topic]:
    found: dict[str, Topic] = {}
    for file in files:
        for channel in sorted(file.channels.values(), key=lambda channel: channel.id):
            count = file.counts.get(channel.id, 0)
            known = found.get(channel.topic)
            if known is None or (known.message_count == 0 and count):
                found[channel.topic] = _topic(file, channel, count)
            else:
                known_count = known.message_count + count
                found[channel.topic] = Topic(**{**vars(known), "message_count": known_count})
    return dict(sorted(found.items()))


def _topic(file: McapFile, channel: Channel, count: int) -> Topic:
    schema = file.schemas.get(channel.schema_id)
    return Topic(
        channel.topic,
        schema.name if schema else "",
        count,
        _qos(channel.metadata.get("offered_qos_profiles", "")),
        schema.data.decode("utf-8", "replace") if schema else "",
        schema.encoding if schema else "",
        channel.metadata.get("topic_type_hash", ""),
    )


def _qos(text: str) -> tuple[Mapping[str, Any], ...]:
    try:
        profiles = yaml.safe_load(text)
    except yaml.YAMLError:
        return ()
    if not isinstance(profiles, list):
        return ()
    return tuple(profile for profile in profiles if isinstance(profile, dict))
