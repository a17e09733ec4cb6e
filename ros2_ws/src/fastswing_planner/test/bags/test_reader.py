"""Bags become columns, whoever wrote them and however they ended."""

import shutil
import struct
import subprocess
import sys
import tracemalloc
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_builder import (
    JOINT_STATE,
    JOINT_STATE_NAME,
    NO_INDEX,
    SECOND,
    SEPARATOR,
    START,
    STRING_NAME,
    Builder,
    folder_of,
    joint_state,
    text,
    write_idl_beside_joints,
    write_joints,
)
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType

import fastswing_planner
from fastswing_planner.bags import Bag, BagError, open_bag
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.cdr.columns import Columns
from fastswing_planner.errors import UndecodableMessage

POSITION = np.arange(100.0)


def positions(bag: Bag) -> list[float]:
    """Return the first joint's."""
    return [float(value) for value in bag.columns("/joint_states")["position"][:, 0]]


def complaint(*paths: Path) -> str:
    """Return the text of the error that opening ends with."""
    with pytest.raises(BagError) as caught:
        open_bag(*paths)
    return str(caught.value)


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


# Columns.


def test_a_sequence_of_numbers_is_a_matrix(tmp_path: Path) -> None:
    columns = open_bag(write_joints(tmp_path / "a.mcap")).columns("/joint_states")
    np.testing.assert_array_equal(columns["position"], np.stack([POSITION, -POSITION], axis=1))
    assert columns["position"].dtype == np.float64


def test_names_are_one_tuple(tmp_path: Path) -> None:
    columns = open_bag(write_joints(tmp_path / "a.mcap")).columns("/joint_states")
    assert columns.names() == ("j0", "j1")


def test_names_that_change_are_no_tuple(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints()
        bag.write("/joint_states", joint_state([1.0]), START)
        bag.write("/joint_states", joint_state([1.0, 2.0]), START)
    columns = open_bag(tmp_path / "a.mcap").columns("/joint_states")
    with pytest.raises(BagError) as caught:
        columns.names()
    assert str(caught.value) == "name of /joint_states changes from message to message"


def test_sequences_whose_length_changes_are_an_array_each(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints()
        for position in ([1.0], [2.0, 3.0], [4.0]):
            bag.write("/joint_states", joint_state(position), START)
    column = open_bag(tmp_path / "a.mcap").columns("/joint_states")["position"]
    assert [row.tolist() for row in column] == [[1.0], [2.0, 3.0], [4.0]]


def test_texts_are_texts(tmp_path: Path) -> None:
    contents = ["one", "two", "", "three", "two"]
    with Builder(tmp_path / "a.mcap") as bag:
        bag.topic("/text", STRING_NAME, "string data\n")
        for content in contents:
            bag.write("/text", text(content), START)
    assert open_bag(tmp_path / "a.mcap").columns("/text")["data"].tolist() == contents


@pytest.mark.parametrize(
    ("time", "first_ns"), [("log", START), ("publish", START - 1000), ("header", START - 2_000_000)]
)
def test_the_time_base_is_chosen(tmp_path: Path, time: Any, first_ns: int) -> None:
    columns = open_bag(write_joints(tmp_path / "a.mcap")).columns("/joint_states", time=time)
    assert columns.time_ns[0] == first_ns
    np.testing.assert_array_equal(np.diff(columns.time_ns), 10_000_000)
    assert columns.time[0] == pytest.approx(first_ns * 1e-9, abs=1e-6)


def test_sequence_numbers_are_kept(tmp_path: Path) -> None:
    columns = open_bag(write_joints(tmp_path / "a.mcap", 3)).columns("/joint_states")
    assert columns.sequence.tolist() == [1, 2, 3]


def test_only_the_fields_asked_for_are_there(tmp_path: Path) -> None:
    bag = open_bag(write_joints(tmp_path / "a.mcap"))
    columns = bag.columns("/joint_states", time="header", fields=["velocity"])
    assert list(columns) == ["velocity"]
    assert columns.time_ns[0] == START - 2_000_000


def test_a_topic_without_messages_has_empty_columns(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints()
    columns = open_bag(tmp_path / "a.mcap").columns("/joint_states", time="header")
    assert (columns.count, columns["position"].shape, columns.names()) == (0, (0, 0), ())


def test_parts_follow_each_other_and_are_the_whole(tmp_path: Path) -> None:
    bag = open_bag(write_joints(tmp_path / "a.mcap", 500, chunk_size=2000))
    parts = list(bag.stream("/joint_states", chunk=50))
    assert len(parts) == pytest.approx(500 / 50, rel=0.3)
    joined = np.concatenate([part["position"] for part in parts])
    np.testing.assert_array_equal(joined, bag.columns("/joint_states")["position"])


def test_messages_are_plain_objects(tmp_path: Path) -> None:
    bag = open_bag(write_joints(tmp_path / "a.mcap", 2))
    (first, second) = bag.messages("/joint_states")
    assert first[0] == START
    assert second[1].position == [1.0, -1.0]
    assert second[1].header.stamp.sec == START // SECOND


def test_raw_messages_are_what_was_written(tmp_path: Path) -> None:
    bag = open_bag(write_joints(tmp_path / "a.mcap", 1))
    expected = (START, START - 1000, joint_state([0.0, 0.0], START - 2_000_000))
    assert list(bag.raw_messages("/joint_states")) == [expected]


# What a bag says of itself.


def test_topics_have_type_count_and_qos(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        qos = "- reliability: best_effort\n  depth: 5"
        bag.topic("/text", STRING_NAME, "string data\n", offered_qos_profiles=qos)
        bag.write("/text", text("a"), START)
    topic = open_bag(tmp_path / "a.mcap").topics["/text"]
    assert (topic.type, topic.message_count) == (STRING_NAME, 1)
    assert topic.qos == ({"reliability": "best_effort", "depth": 5},)


def test_a_topic_is_found_by_its_type_in_any_namespace(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints("/left/joint_states").joints("/unused")
        bag.write("/left/joint_states", joint_state([1.0]), START)
    assert open_bag(tmp_path / "a.mcap").topic_of_type(JOINT_STATE_NAME) == "/left/joint_states"


def test_of_two_topics_of_a_type_the_end_of_the_name_decides(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        for side in ("left", "right"):
            bag.joints(f"/{side}/joint_states")
            bag.write(f"/{side}/joint_states", joint_state([1.0]), START)
    both = open_bag(tmp_path / "a.mcap")
    assert both.topic_of_type(JOINT_STATE_NAME, "right/joint_states") == "/right/joint_states"
    with pytest.raises(BagError) as caught:
        both.topic_of_type(JOINT_STATE_NAME)
    assert str(caught.value) == (
        "more than one topic of type sensor_msgs/msg/JointState, name one: "
        "/left/joint_states, /right/joint_states"
    )


def test_metadata_records_are_there(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.writer.add_metadata("fastswing_recorder", {"lost": "3"})
    assert open_bag(tmp_path / "a.mcap").metadata == {"fastswing_recorder": {"lost": "3"}}


# Whoever wrote it.

WRITERS: dict[str, dict[str, Any]] = {
    "zstd": {},
    "lz4": {"compression": CompressionType.LZ4},
    "uncompressed": {"compression": CompressionType.NONE},
    "small chunks": {"chunk_size": 300},
    "no chunks": {"use_chunking": False},
    "no statistics": {"use_statistics": False},
    "no index": {"index_types": IndexType.NONE},
    "no message index": {"index_types": IndexType.ALL & ~IndexType.MESSAGE},
    "no summary": {**NO_INDEX, "repeat_schemas": False, "use_summary_offsets": False},
    "no checksums": {"enable_crcs": False},
}


@pytest.mark.parametrize("writer", WRITERS)
def test_every_way_to_write_a_file_is_read(tmp_path: Path, writer: str) -> None:
    bag = open_bag(write_joints(tmp_path / "a.mcap", **WRITERS[writer]))
    assert positions(bag) == POSITION.tolist()
    assert bag.topics["/joint_states"].message_count == 100
    assert (bag.start_ns, bag.end_ns) == (START, START + 99 * 10_000_000)
    assert bag.warnings == []


def test_our_own_bags_are_read(tmp_path: Path) -> None:
    from fastswing_planner.bags.metadata import BagTopic

    bag = BagWriter(tmp_path / "a.mcap")
    bag.add_topic(BagTopic("/joint_states", JOINT_STATE_NAME, JOINT_STATE))
    bag.write("/joint_states", joint_state([7.0]), START, START)
    bag.close()
    assert positions(open_bag(tmp_path / "a.mcap")) == [7.0]


def test_an_index_that_lies_is_not_believed(tmp_path: Path) -> None:
    path = write_joints(tmp_path / "a.mcap", 5, compression=CompressionType.NONE)
    data = bytearray(path.read_bytes())
    index = data.index(struct.pack("<BQHI", 7, 6 + 5 * 16, 1, 5 * 16))
    struct.pack_into("<Q", data, index + 15 + 16 + 8, 3)  # place of the second message
    path.write_bytes(data)
    assert positions(open_bag(path)) == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_several_files_are_one_bag_in_order_of_time(tmp_path: Path) -> None:
    late = write_joints(tmp_path / "late.mcap", 2, START + 10 * SECOND)
    early = write_joints(tmp_path / "early.mcap", 3)
    bag = open_bag(late, early)
    assert positions(bag) == [0.0, 1.0, 2.0, 0.0, 1.0]
    assert bag.topics["/joint_states"].message_count == 5
    assert (bag.start_ns, bag.end_ns) == (START, START + 10 * SECOND + 10_000_000)
    assert bag.warnings == []


def test_a_file_that_begins_at_time_zero_is_the_first(tmp_path: Path) -> None:
    late = write_joints(tmp_path / "a.mcap", 2, SECOND)
    with Builder(tmp_path / "b.mcap") as early:
        early.joints()
        early.writer.add_message(1, 0, joint_state([7.0, 0.0]), 0)
    bag = open_bag(late, tmp_path / "b.mcap")
    assert positions(bag) == [7.0, 0.0, 1.0]
    assert (bag.start_ns, bag.warnings) == (0, [])


def test_two_channels_of_a_topic_are_read_in_the_order_of_recording(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints()
        first = bag.writer.register_channel("/joint_states", "cdr", 1, {"publisher": "another"})
        for index in range(4):
            data = joint_state([index])
            bag.write("/joint_states", data, START + 2 * index * SECOND)
            bag.writer.add_message(first, START + (2 * index + 1) * SECOND, data, START)
    opened = open_bag(tmp_path / "a.mcap")
    times = opened.columns("/joint_states").log_time_ns
    assert np.diff(times).tolist() == [SECOND] * 7
    assert [time for time, _ in opened.messages("/joint_states")] == times.tolist()
    assert opened.warnings == []


def two_types(path: Path) -> Bag:
    """Return a bag with a topic of two types."""
    with Builder(path) as bag:
        for index, name in enumerate("ab"):
            bag.topic("/t", f"p/msg/{name}", f"uint8 {name}\nuint8 both\n")
            bag.write("/t", bytes([0, 1, 0, 0, index, 7 + index]), START + index)
    return open_bag(path)


def test_messages_with_different_fields_are_one_line(tmp_path: Path) -> None:
    with pytest.raises(BagError) as caught:
        two_types(tmp_path / "a.mcap").columns("/t")
    assert str(caught.value) == (
        "/t has messages with different fields: name those that all of them have, or read it as "
        "plain messages"
    )


def test_fields_that_all_types_have_are_read(tmp_path: Path) -> None:
    columns = two_types(tmp_path / "a.mcap").columns("/t", fields=["both"])
    assert columns["both"].tolist() == [7, 8]


def test_types_nested_too_deep_are_one_line(tmp_path: Path) -> None:
    sections = [f"{SEPARATOR}\nMSG: p/T{i}\np/T{i + 1} a\n" for i in range(1, 3000)]
    definition = "".join(["p/T1 a\n", *sections, f"{SEPARATOR}\nMSG: p/T3000\nuint8 x\n"])
    with Builder(tmp_path / "a.mcap") as bag:
        bag.topic("/t", "p/msg/T0", definition)
    with pytest.raises(BagError) as caught:
        open_bag(tmp_path / "a.mcap").columns("/t")
    assert str(caught.value) == "the definition of p/msg/T0 nests types more than 100 deep"


def test_a_file_named_twice_is_read_once(tmp_path: Path) -> None:
    path = write_joints(tmp_path / "a.mcap", 3)
    assert positions(open_bag(path, tmp_path)) == [0.0, 1.0, 2.0]


def test_a_folder_is_one_bag(tmp_path: Path) -> None:
    for index in range(12):
        write_joints(tmp_path / f"a_{index}.mcap", 1, START + index * SECOND)
    folder_of(tmp_path, [f"a_{index}.mcap" for index in range(12)])
    bag = open_bag(tmp_path)
    times = bag.columns("/joint_states").time_ns
    assert np.diff(times).tolist() == [SECOND] * 11
    assert bag.warnings == []


def test_a_file_of_a_folder_that_is_missing_is_a_warning(tmp_path: Path) -> None:
    write_joints(tmp_path / "a_0.mcap", 1)
    folder_of(tmp_path, ["a_0.mcap", "a_1.mcap"])
    bag = open_bag(tmp_path)
    assert positions(bag) == [0.0]
    assert bag.warnings == [f"{tmp_path}/a_1.mcap is missing, though metadata.yaml names it"]


def test_a_folder_without_metadata_is_all_its_files(tmp_path: Path) -> None:
    for index in range(2):
        write_joints(tmp_path / f"a_{index}.mcap", 1, START + index * SECOND)
    assert positions(open_bag(tmp_path)) == [0.0, 0.0]


def test_topics_of_unknown_encoding_are_no_obstacle(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints()
        bag.topic("/noise", "Noise", "{}", "jsonschema")
        bag.write("/noise", b"{}", START)
        bag.write("/joint_states", joint_state([5.0]), START)
    opened = open_bag(tmp_path / "a.mcap")
    assert positions(opened) == [5.0]
    with pytest.raises(BagError) as caught:
        opened.columns("/noise")
    assert str(caught.value) == (
        "/noise is 'cdr' with a definition in 'jsonschema'; only cdr with ros2msg can be read"
    )


def test_a_topic_with_an_idl_definition_is_listed_and_refused_in_one_line(tmp_path: Path) -> None:
    opened = open_bag(write_idl_beside_joints(tmp_path / "a.mcap"))
    assert (opened.topics["/text"].encoding, opened.topics["/text"].message_count) == ("ros2idl", 1)
    assert positions(opened) == [5.0]
    for read in (opened.columns, opened.fields, lambda topic: next(opened.messages(topic))):
        with pytest.raises(UndecodableMessage) as caught:
            read("/text")
        assert str(caught.value) == (
            "/text is 'cdr' with a definition in 'ros2idl'; only cdr with ros2msg can be read"
        )


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


# Without ROS, without end.

READ_ALONE = """
import sys
for package in "rclpy ament_index_python sensor_msgs mcap_ros2 rosbags pandas pyarrow".split():
    sys.modules[package] = None
from fastswing_planner.bags import open_bag
print(open_bag(sys.argv[1]).columns("/joint_states")["position"].sum())
"""


def test_a_bag_is_read_without_ros(tmp_path: Path) -> None:
    path = write_joints(tmp_path / "a.mcap", 3)
    source = Path(str(fastswing_planner.__file__)).parents[1]
    command = [sys.executable, "-c", READ_ALONE, str(path)]
    environment = {"PYTHONPATH": str(source), "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, timeout=60
    )
    assert (done.stdout, done.stderr) == ("0.0\n", "")


def test_other_topics_are_not_kept_in_memory(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Builder(path, chunk_size=2**20, compression=CompressionType.NONE) as bag:
        bag.joints().topic("/image", STRING_NAME, "string data\n")
        for index in range(60):
            bag.write("/image", bytes(2**20), START + index)
            bag.write("/joint_states", joint_state([index]), START + index)
    opened = open_bag(path)
    tracemalloc.start()
    assert positions(opened) == POSITION[:60].tolist()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 24 * 2**20


def test_names_cost_no_memory(tmp_path: Path) -> None:
    columns = open_bag(write_joints(tmp_path / "a.mcap", 500, chunk_size=2000)).columns(
        "/joint_states"
    )
    assert isinstance(columns, Columns)
    assert columns["name"].shape == (500, 2)
    assert columns["name"].strides[0] == 0
