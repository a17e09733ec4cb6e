"""Bags are read as far as they go, however they ended; what is no bag is named."""

import shutil
import struct
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from bag_builder import (
    SECOND,
    START,
    STRING_NAME,
    Builder,
    joint_state,
    text,
    write_joints,
)
from hypothesis import given
from hypothesis import strategies as st
from joint_positions import POSITION, positions
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType

from fastswing_planner.bags import BagError, open_bag


def everything_read(path: Path) -> tuple[list[str], list[int]]:
    """Return each line that reading all of a bag ends with or warns of, and each topic's count."""
    lines, counts = [], []
    try:
        bag = open_bag(path)
        for topic in bag.topics:
            counts.append(bag.columns(topic).count)
        lines += bag.warnings
    except BagError as error:
        lines.append(str(error))
    return lines, counts


# However it ended.


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_cut_file_gives_what_was_written(tmp_path: Path, compression: CompressionType) -> None:
    whole = write_joints(tmp_path / "a.mcap", 60, chunk_size=2000, compression=compression)
    data = whole.read_bytes()
    counts = []
    for size in (*range(8, len(data) - 8, 101), *range(len(data) - 8, len(data))):
        (tmp_path / "b.mcap").write_bytes(data[:size])
        bag = open_bag(tmp_path / "b.mcap")
        assert "b.mcap: was not finished, what was written is read" in bag.warnings[-1]
        found = positions(bag) if bag.message_count else []
        assert found == POSITION[: len(found)].tolist()
        counts.append(len(found))
    assert counts[-1] == 60
    assert all(before <= after for before, after in pairwise(counts))


def test_what_a_cut_file_lost_is_said(tmp_path: Path) -> None:
    path = write_joints(tmp_path / "a.mcap", compression=CompressionType.NONE)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 3])
    bag = open_bag(path)
    count = bag.topics["/joint_states"].message_count
    assert 10 < count < 60
    assert (
        bag.warnings[0] == f"a.mcap: {count} messages were recovered from its incomplete last chunk"
    )
    assert bag.warnings[1].startswith(
        "a.mcap: was not finished, what was written is read; its last "
    )
    assert bag.warnings[1].endswith(" bytes are an incomplete record")


def test_a_damaged_chunk_is_left_out_and_named(tmp_path: Path) -> None:
    path = write_joints(tmp_path / "a.mcap", chunk_size=1500, compression=CompressionType.NONE)
    data = bytearray(path.read_bytes())
    place = data.index(struct.pack("<d", 33.0))
    data[place] ^= 1
    path.write_bytes(data)
    bag = open_bag(path)
    found = positions(bag)
    assert set(found) < set(POSITION)
    assert 33.0 not in found
    assert len(found) > 80
    (warning,) = bag.warnings
    assert warning.startswith("a.mcap: the chunk at byte ")
    assert warning.endswith(
        f" is damaged (wrong checksum), its {100 - len(found)} messages are left out"
    )


def chunk_places(path: Path) -> list[int]:
    """Return where the index says that chunks begin."""
    with open(path, "rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    return [index.chunk_start_offset for index in summary.chunk_indexes]


def spoil(path: Path, place: int, value: bytes) -> None:
    with open(path, "r+b") as stream:
        stream.seek(place)
        stream.write(value)


@pytest.mark.parametrize("size", [0, 50, 400, 2**60])
def test_behind_a_chunk_with_a_wrong_size_the_index_leads_on(tmp_path: Path, size: int) -> None:
    path = write_joints(tmp_path / "a.mcap", chunk_size=1500)
    place = chunk_places(path)[2]
    spoil(path, place + 1, struct.pack("<Q", size))
    bag = open_bag(path)
    assert positions(bag) == POSITION.tolist()
    assert bag.warnings == [
        f"a.mcap: the head of the chunk at byte {place} is damaged, its index is used"
    ]


@pytest.mark.parametrize("size", [0, 1, 400, 2**60])
def test_behind_another_record_with_a_wrong_size_the_index_leads_on(
    tmp_path: Path, size: int
) -> None:
    path = write_joints(tmp_path / "a.mcap", chunk_size=1500)
    third = chunk_places(path)[2]
    data = path.read_bytes()
    (chunk_size,) = struct.unpack_from("<Q", data, third + 1)
    spoil(path, third + 9 + chunk_size + 1, struct.pack("<Q", size))  # of the chunk's own index
    assert positions(open_bag(path)) == POSITION.tolist()


def test_how_many_messages_a_finished_file_lost_is_said(tmp_path: Path) -> None:
    options: dict[str, Any] = {"index_types": IndexType.CHUNK, "repeat_channels": False}
    path = write_joints(tmp_path / "a.mcap", chunk_size=1500, **options)
    spoil(path, chunk_places(path)[2] + 70, bytes(20))
    bag = open_bag(path)
    lost = 100 - bag.message_count
    assert lost > 0
    assert f"a.mcap: {lost} of its 100 messages are lost" in bag.warnings


def test_an_index_with_a_wrong_checksum_is_not_followed(tmp_path: Path) -> None:
    path = write_joints(tmp_path / "a.mcap", chunk_size=1500)
    place = path.read_bytes().rindex(struct.pack("<Q", chunk_places(path)[2]))
    spoil(path, place, struct.pack("<Q", 12))
    bag = open_bag(path)
    assert positions(bag) == POSITION.tolist()
    assert bag.warnings == []


def test_a_file_without_its_last_bytes_was_not_finished(tmp_path: Path) -> None:
    path = write_joints(tmp_path / "a.mcap", 3)
    path.write_bytes(path.read_bytes()[:-1])
    assert open_bag(path).warnings == [
        "a.mcap: was not finished, what was written is read; its last 7 bytes are an incomplete "
        "record"
    ]


@given(st.data())
def test_no_damage_is_more_than_a_bag_error(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = tmp_path_factory.mktemp("bag")
    whole = bytearray(write_joints(folder / "a.mcap", 20, chunk_size=900).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    (folder / "a.mcap").write_bytes(whole)
    lines, counts = everything_read(folder / "a.mcap")
    assert all(line.isprintable() for line in lines)
    assert max(counts, default=0) <= 20
    shutil.rmtree(folder)


def test_a_clock_that_goes_back_is_a_warning(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints()
        for time_ns in (START + 3 * SECOND, START):
            bag.write("/joint_states", joint_state([0.0]), time_ns)
    opened = open_bag(tmp_path / "a.mcap")
    opened.columns("/joint_states")
    assert opened.warnings == [
        "/joint_states: the recorder's clock went back by 3.000 s, to 1000.000 s"
    ]


# What is no bag.


def complaint(*paths: Path) -> str:
    """Return the text of the error that opening ends with."""
    with pytest.raises(BagError) as caught:
        open_bag(*paths)
    return str(caught.value)


def test_what_is_no_bag_is_named(tmp_path: Path) -> None:
    for name in ("empty.mcap", "text.mcap", "a.db3", "a.mcap.zstd"):
        (tmp_path / name).write_text("" if name == "empty.mcap" else "hello, world")
    assert complaint(tmp_path / "no.mcap") == f"there is no bag {tmp_path}/no.mcap"
    assert complaint(tmp_path / "empty.mcap") == f"{tmp_path}/empty.mcap is empty"
    assert complaint(tmp_path / "text.mcap") == f"{tmp_path}/text.mcap is no MCAP file"
    assert complaint(tmp_path / "a.db3") == (
        f"{tmp_path}/a.db3 is stored in sqlite3; convert it to mcap with ros2 bag convert"
    )
    assert complaint(tmp_path / "a.mcap.zstd") == (
        f"{tmp_path}/a.mcap.zstd is compressed as a whole; unpack it first"
    )


def test_a_folder_without_bags_is_named(tmp_path: Path) -> None:
    assert complaint(tmp_path) == f"folder {tmp_path} has no .mcap file"


def test_an_unknown_topic_names_those_there_are(tmp_path: Path) -> None:
    bag = open_bag(write_joints(tmp_path / "a.mcap", 1))
    with pytest.raises(BagError) as caught:
        bag.columns("/joint_state")
    assert str(caught.value) == "a.mcap has no topic /joint_state; it has: /joint_states"


def test_an_unknown_field_names_those_there_are(tmp_path: Path) -> None:
    columns = open_bag(write_joints(tmp_path / "a.mcap", 1)).columns("/joint_states")
    with pytest.raises(BagError) as caught:
        columns["torque"]
    assert str(caught.value) == (
        "/joint_states has no field 'torque'; choose from: header.stamp.sec, "
        "header.stamp.nanosec, header.frame_id, name, position, velocity, effort"
    )


def test_a_type_without_header_has_no_header_time(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.topic("/text", STRING_NAME, "string data\n")
    with pytest.raises(BagError) as caught:
        open_bag(tmp_path / "a.mcap").columns("/text", time="header")
    assert str(caught.value) == (
        "/text (std_msgs/msg/String) has no header: use the time base log or publish"
    )


def test_a_message_that_is_not_of_its_type_is_named(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints()
        bag.write("/joint_states", text("hello"), START)
    with pytest.raises(BagError) as caught:
        open_bag(tmp_path / "a.mcap").columns("/joint_states")
    assert str(caught.value) == (
        "/joint_states: a sensor_msgs/msg/JointState of 14 bytes ends before its fields do"
    )
