"""Writes a bag as a folder of MCAP files that begin anew by size or time, with metadata.yaml."""

import os
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from pathlib import Path

from fastswing_planner.bags.metadata import BagTopic, folder_yaml
from fastswing_planner.bags.writer import BagExists, BagWriter
from fastswing_planner.errors import BagError

METADATA = "metadata.yaml"


class BagFolder:
    """A new folder NAME with the files NAME_0.mcap, NAME_1.mcap, ... as rosbag2 names them.

    metadata.yaml is written with the first file and again whenever a file is finished, so that a
    killed recorder leaves a bag whose last file alone is unfinished.
    """

    def __init__(
        self,
        path: Path,
        compression: str = "zstd",
        chunk_size: int = 256 * 1024,
        ros_distro: str = "jazzy",
        notes: Callable[[], Mapping[str, str]] = dict,
        split_size: int = 0,
        split_duration_ns: int = 0,
    ) -> None:
        """Create the folder and its first file.

        split_size         [bytes] on disk at which the next file begins; 0: never
        split_duration_ns  [ns] after a file's first message the next begins; 0: never

        The rest is as for BagWriter. Raises BagExists or BagError.
        """
        check_folder(path)
        self.path = path
        self._options = (compression, chunk_size, ros_distro, notes)
        self._split_size = split_size
        self._split_duration_ns = split_duration_ns
        self._topics: list[BagTopic] = []
        self._files: list[BagWriter] = []
        self._file_start_ns: int | None = None
        try:
            path.mkdir(parents=True)
        except OSError as error:
            raise BagError(f"cannot create {path}: {error.strerror or error}") from error
        self._file = self._next_file()

    @property
    def size(self) -> int:
        """[bytes] on disk."""
        return sum(file.size for file in self._files)

    @property
    def message_count(self) -> int:
        """Messages written."""
        return sum(file.message_count for file in self._files)

    @property
    def topics(self) -> Collection[str]:
        """Names of the topics added."""
        return self._file.topics

    def add_topic(self, topic: BagTopic) -> None:
        """Announce a topic; its messages may follow."""
        self._topics.append(topic)
        self._file.add_topic(topic)

    def write(
        self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int, sequence: int = 0
    ) -> None:
        """Write one message as BagWriter does, in a new file if it is time; raises BagError."""
        if self._file_start_ns is None:
            self._file_start_ns = log_time_ns
        elif self._is_full(log_time_ns):
            self._file.close()
            self._file = self._next_file()
            self._file_start_ns = log_time_ns
        self._file.write(topic, data, log_time_ns, publish_time_ns, sequence)

    def flush(self) -> None:
        """Complete the present chunk: what was written survives from here on."""
        self._file.flush()

    def close(self) -> None:
        """Finish the last file and metadata.yaml; raises BagError. Again does nothing."""
        if not self._file.closed:
            self._file.close()
            self._write_metadata()

    def _is_full(self, log_time_ns: int) -> bool:
        assert self._file_start_ns is not None
        lasted = log_time_ns - self._file_start_ns
        return (0 < self._split_size <= self._file.size) or (0 < self._split_duration_ns <= lasted)

    def _next_file(self) -> BagWriter:
        name = f"{self.path.name}_{len(self._files)}.mcap"
        file = BagWriter(self.path / name, *self._options)
        for topic in self._topics:
            file.add_topic(topic)
        self._files.append(file)
        self._write_metadata()
        return file

    def _write_metadata(self) -> None:
        """Replace metadata.yaml as a whole, so that it is never half written."""
        path = self.path / METADATA
        partial = path.with_name(f".{METADATA}")
        text = folder_yaml([file.summary() for file in self._files])
        try:
            partial.write_text(text, encoding="utf-8")
            os.replace(partial, path)
        except OSError as error:
            with suppress(OSError):
                partial.unlink(missing_ok=True)
            raise BagError(f"cannot write {path}: {error.strerror or error}") from error


def check_folder(path: Path) -> None:
    """Raise BagExists unless a folder may be created at `path`."""
    if os.path.lexists(path):
        raise BagExists(f"{path} exists and is never overwritten; choose another output")
