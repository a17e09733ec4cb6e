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

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from mcap.records import Channel

from fastswing_planner.bags.batches import batches, step_back
from fastswing_planner.bags.files import bag_files
from fastswing_planner.bags.mcap_file import McapFile
from fastswing_planner.bags.mcap_scan import scan
from fastswing_planner.bags.topic_decoder import TimeBase, TopicDecoder, named
from fastswing_planner.bags.topics import Topic, lost_in, topics_of
from fastswing_planner.bags.writer import NOTES
from fastswing_planner.cdr.batch import Messages
from fastswing_planner.cdr.columns import (
    Columns,
    field_paths,
    joined,
)
from fastswing_planner.cdr.layout import decode
from fastswing_planner.cdr.schema import Schema, parse_ros2msg
from fastswing_planner.errors import (
    UndecodableMessage,
    UnknownTopic,
    UnreadableBag,
    one_line,
)

_ENCODING = "ros2msg"
"""What rosbag2 writes of every type that has a .msg file."""
_CHUNK = 8192


class Bag:
    """Several MCAP files as one; `open_bag` makes it."""

    def __init__(self, files: Sequence[McapFile], warnings: Sequence[str] = ()) -> None:
        """Put files together, the earliest first."""
        self._files = sorted(files, key=lambda file: (file.empty, file.start_ns))
        self._own_warnings = list(warnings)
        self._topics = topics_of(self._files)
        self._schemas: dict[tuple[str, bytes], Schema] = {}

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
            for topic, count in lost_in(content).items() if name == NOTES else ():
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
        line = step_back(columns, newest)
        if line and line not in self._own_warnings:
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
        if channel.message_encoding != "cdr" or record.encoding != _ENCODING:
            raise UndecodableMessage(
                f"{channel.topic} is '{channel.message_encoding}' with a definition in "
                f"'{record.encoding}'; only cdr with ros2msg can be read"
            )
        key = (record.name, record.data)
        if key not in self._schemas:
            text = record.data.decode("utf-8", "replace")
            self._schemas[key] = parse_ros2msg(record.name, text)
        return self._schemas[key]

    def _batches(self, topic: str, size: int) -> Iterator[tuple[Schema, list[Messages]]]:
        channels = self._channels(topic)
        for file in self._files:
            yield from batches(
                file, {c.id: self._schema(file, c) for owner, c in channels if owner is file}, size
            )


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
