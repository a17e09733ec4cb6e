"""Bags are read whoever wrote them, from one file, several, or a folder."""

import struct
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
    Builder,
    folder_of,
    joint_state,
    write_idl_beside_joints,
    write_joints,
)
from joint_positions import POSITION, positions
from mcap.writer import CompressionType, IndexType

from fastswing_planner.bags import Bag, BagError, open_bag
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.errors import UndecodableMessage

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
