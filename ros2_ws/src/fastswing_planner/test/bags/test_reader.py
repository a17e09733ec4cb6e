"""Bags become columns, whoever wrote them and however they ended."""

import subprocess
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_builder import (
    JOINT_STATE_NAME,
    SECOND,
    START,
    STRING_NAME,
    Builder,
    joint_state,
    text,
    write_joints,
)
from joint_positions import POSITION, positions
from mcap.writer import CompressionType

import fastswing_planner
from fastswing_planner.bags import BagError, open_bag
from fastswing_planner.cdr.columns import Columns

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
