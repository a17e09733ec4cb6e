"""Writes MCAP bags as `ros2 bag` accepts them; a killed writer loses at most its last chunk."""

import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, cast

from mcap.writer import CompressionType, Writer

from fastswing_planner.bags.metadata import BagSummary, BagTopic, metadata_yaml, qos_yaml
from fastswing_planner.errors import BagError, InvalidRequest

COMPRESSIONS = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}
NOTES = "fastswing_recorder"
"""Name of the metadata record in which the recorder says what it lost."""


class BagExists(BagError, FileExistsError):
    """The file exists already, and nothing recorded is ever overwritten."""


class InvalidBagPath(InvalidRequest):
    """Not the path of a .mcap file."""


class _AppendedFile:
    """A new file without a buffer of its own: what is written survives the process."""

    def __init__(self, path: Path) -> None:
        self._file = open(path, "xb", buffering=0)  # noqa: SIM115  # closed by close()
        self._size = 0

    def write(self, data: bytes) -> int:
        """Append all of `data`."""
        rest = memoryview(data)
        while rest:
            count = self._file.write(rest)
            self._size += count
            rest = rest[count:]
        return len(data)

    def tell(self) -> int:
        """Return the size [bytes]."""
        return self._size

    def flush(self) -> None:
        """Nothing is held back here."""

    def cut(self, size: int) -> None:
        """Drop everything beyond `size` [bytes]."""
        self._file.truncate(size)

    def close(self) -> None:
        """Hand everything to the disk and close."""
        try:
            os.fsync(self._file.fileno())
        finally:
            self._file.close()


class BagWriter:
    """One new MCAP file, profile `ros2`, schemas `ros2msg`, messages CDR.

    After an error it is closed, cut behind its last complete chunk.
    """

    def __init__(
        self,
        path: Path,
        compression: str = "zstd",
        chunk_size: int = 256 * 1024,
        ros_distro: str = "jazzy",
        notes: Callable[[], Mapping[str, str]] = dict,
    ) -> None:
        """Create the file, and its folder if that is missing; `chunk_size` in bytes.

        notes  what the metadata record NOTES says when the file is finished; nothing: no record

        Raises InvalidBagPath, BagExists or BagError.
        """
        check_path(path)
        self.path = path
        self._ros_distro = ros_distro
        self._notes = notes
        self._topics: dict[str, BagTopic] = {}
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._start_ns = self._end_ns = 0
        self._complete = 0
        self._file: _AppendedFile | None = _create(path)
        stream = cast(IO[bytes], self._file)
        self._writer = Writer(stream, chunk_size, COMPRESSIONS[compression])
        with self._guarded():
            self._writer.start(profile="ros2")
            # A file that is never finished still says how to read its QoS profiles.
            self._add_metadata()

    @property
    def closed(self) -> bool:
        """Whether the file is finished, or given up after an error."""
        return self._file is None

    @property
    def size(self) -> int:
        """[bytes] on disk."""
        return self._complete

    @property
    def message_count(self) -> int:
        """Messages written."""
        return sum(self._counts.values())

    @property
    def topics(self) -> Collection[str]:
        """Names of the topics added."""
        return self._topics.keys()

    def summary(self) -> BagSummary:
        """Return what the file holds so far."""
        return BagSummary(
            self.path.name,
            self._ros_distro,
            self._start_ns,
            self._end_ns,
            tuple(self._topics.values()),
            dict(self._counts),
        )

    def add_topic(self, topic: BagTopic) -> None:
        """Announce a topic; its messages may follow."""
        with self._guarded():
            if topic.type_name not in self._schemas:
                self._schemas[topic.type_name] = self._writer.register_schema(
                    topic.type_name, "ros2msg", topic.definition.encode()
                )
            metadata = {
                "offered_qos_profiles": qos_yaml(topic.offered_qos),
                "topic_type_hash": topic.type_hash,
            }
            self._channels[topic.name] = self._writer.register_channel(
                topic.name, "cdr", self._schemas[topic.type_name], metadata
            )
        self._topics[topic.name] = topic
        self._counts[topic.name] = 0

    def write(
        self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int, sequence: int = 0
    ) -> None:
        """Write one message in CDR of a topic that was added; raises BagError.

        log_time_ns      when it was received, since 1970
        publish_time_ns  when it was published, since 1970
        sequence         the publisher's count, modulo 2^32
        """
        log_time_ns = max(log_time_ns, 0)
        with self._guarded():
            self._writer.add_message(
                self._channels[topic], log_time_ns, data, max(publish_time_ns, 0), sequence % 2**32
            )
        first = self.message_count == 0
        self._start_ns = log_time_ns if first else min(self._start_ns, log_time_ns)
        self._end_ns = max(self._end_ns, log_time_ns)
        self._counts[topic] += 1

    def flush(self) -> None:
        """Complete the present chunk: what was written survives from here on."""
        with self._guarded():
            self._writer.flush()

    def close(self) -> None:
        """Write summary and footer; raises BagError. Closing again does nothing."""
        if self._file is None:
            return
        with self._guarded():
            self._writer.flush()
            notes = self._notes()
            if notes:
                self._writer.add_metadata(NOTES, dict(notes))
            self._add_metadata()
            self._writer.finish()
        with self._guarded() as file:
            file.close()
        self._file = None

    @contextmanager
    def _guarded(self) -> Iterator[_AppendedFile]:
        """Note what is complete after a write; after a failed one, cut the file there."""
        file = self._file
        if file is None:
            raise BagError(f"{self.path} is closed")
        try:
            yield file
        except OSError as error:
            self._file = None
            _give_up(file, self._complete)
            raise BagError(
                f"cannot write {self.path}: {error.strerror or error}; "
                f"it ends after {self._complete} bytes and is readable up to there"
            ) from error
        self._complete = file.tell()

    def _add_metadata(self) -> None:
        text = metadata_yaml(self.summary())
        self._writer.add_metadata("rosbag2", {"serialized_metadata": text})


def check_path(path: Path) -> None:
    """Raise InvalidBagPath or BagExists unless a bag may be created at `path`."""
    if path.suffix != ".mcap":
        raise InvalidBagPath(f"'{path}' is no bag file, its name must end in .mcap")
    if os.path.lexists(path):
        raise BagExists(f"{path} exists and is never overwritten; choose another output")


def _create(path: Path) -> _AppendedFile:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return _AppendedFile(path)
    except OSError as error:
        raise BagError(f"cannot create {path}: {error.strerror or error}") from error


def _give_up(file: _AppendedFile, size: int) -> None:
    with suppress(OSError, ValueError):  # ValueError: closed already
        file.cut(size)
    with suppress(OSError, ValueError):
        file.close()
