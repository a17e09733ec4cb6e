"""What was written is readable, though the bag was killed, cut, or met a full disk."""

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import written_joints
import yaml
from mcap.records import Metadata
from written_joints import readable_positions, until_end, write_bag

from fastswing_planner.bags.writer import BagError


def test_what_was_flushed_is_readable_while_the_bag_is_open(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.mcap", 10)
    assert readable_positions(tmp_path / "a.mcap") == []
    bag.flush()
    assert readable_positions(tmp_path / "a.mcap") == list(range(10))
    bag.close()


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_a_file_cut_anywhere_is_readable_up_to_its_last_chunk(
    tmp_path: Path, compression: str
) -> None:
    write_bag(tmp_path / "a.mcap", 100, chunk_size=1500, compression=compression).close()
    whole = (tmp_path / "a.mcap").read_bytes()
    previous = 0
    for size in range(200, len(whole), 97):
        (tmp_path / "cut.mcap").write_bytes(whole[:size])
        positions = readable_positions(tmp_path / "cut.mcap")
        assert positions == list(range(len(positions)))
        assert len(positions) >= previous
        previous = len(positions)
    assert previous == 100


def test_a_cut_file_still_tells_its_metadata_version(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.mcap")
    bag.flush()
    with open(tmp_path / "a.mcap", "rb") as stream:
        texts = [
            record.metadata["serialized_metadata"]
            for record in until_end(stream)
            if isinstance(record, Metadata)
        ]
    assert yaml.safe_load(texts[0])["version"] == 9
    bag.close()


KILLED_WRITER = """
import sys, time
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from written_joints import write_bag
bag = write_bag(Path(sys.argv[1]), 100)
bag.flush()
bag.write("/joint_states", b"lost", 1, 1)
print("written", flush=True)
time.sleep(60)
"""


def test_a_killed_writer_loses_at_most_its_last_chunk(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    command = [
        sys.executable,
        "-c",
        KILLED_WRITER,
        str(path),
        str(Path(written_joints.__file__).parent),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "written\n"
        os.kill(process.pid, signal.SIGKILL)
    assert readable_positions(path) == list(range(100))


@contextmanager
def disk_full_at(size: int) -> Iterator[None]:
    """Let every write beyond `size` [bytes] of a file fail, as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_is_an_error_that_leaves_a_readable_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with disk_full_at(8000), pytest.raises(BagError, match=r"cannot write .*a\.mcap: .*too large"):
        write_bag(path, 1000, chunk_size=1500, compression="none")
    positions = readable_positions(path)
    assert positions == list(range(len(positions)))
    assert len(positions) > 20


def test_a_bag_is_closed_after_a_write_error(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.mcap", 5)
    with disk_full_at(bag.size), pytest.raises(BagError, match="readable up to there"):
        bag.close()
    assert bag.closed
    assert (tmp_path / "a.mcap").stat().st_size == bag.size
