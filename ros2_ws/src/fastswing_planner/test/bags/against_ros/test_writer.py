"""Bags are what rosbag2 writes, survive a killed writer, and are never overwritten."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import Reader
from std_msgs.msg import String
from written_joints import JOINTS, SECOND, joint_message, readable_positions, write_bag

from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagError, BagExists, BagWriter, InvalidBagPath
from fastswing_planner.conversion.definitions import definition_text

TEXT = BagTopic("/text", "std_msgs/msg/String", definition_text("std_msgs/msg/String"))


def metadata_of(path: Path) -> dict[str, Any]:
    with open(path, "rb") as stream:
        records = [r for r in make_reader(stream).iter_metadata() if r.name == "rosbag2"]
    content = yaml.safe_load(records[-1].metadata["serialized_metadata"])
    assert isinstance(content, dict)
    return content


def test_messages_come_back_as_they_were(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.mcap").close()
    with open(tmp_path / "a.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        rows = list(reader.iter_decoded_messages())
    assert [row.decoded_message.position[0] for row in rows] == list(range(100))
    assert rows[3].message.log_time == 1000 * SECOND + 3 * SECOND // 100
    assert rows[3].message.publish_time == rows[3].message.log_time - 500
    assert rows[3].message.sequence == 4


def test_profile_and_encodings_are_those_of_ros_2(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.mcap", 1).close()
    with open(tmp_path / "a.mcap", "rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
    assert summary is not None
    assert [schema.encoding for schema in summary.schemas.values()] == ["ros2msg"]
    assert [schema.name for schema in summary.schemas.values()] == ["sensor_msgs/msg/JointState"]
    assert [channel.message_encoding for channel in summary.channels.values()] == ["cdr"]


def test_the_summary_counts_every_message(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.mcap", 100, chunk_size=2000, compression="none").close()
    with open(tmp_path / "a.mcap", "rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == 100
    assert summary.statistics.channel_message_counts == {1: 100}
    assert summary.statistics.message_start_time == 1000 * SECOND
    assert len(summary.chunk_indexes) > 3


def test_a_channel_carries_qos_and_type_hash_in_the_form_of_rosbag2(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.mcap", 1).close()
    with open(tmp_path / "a.mcap", "rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    metadata = summary.channels[1].metadata
    assert metadata["topic_type_hash"].startswith("RIHS01_")
    assert metadata["offered_qos_profiles"] == (
        "- history: unknown\n"
        "  depth: 0\n"
        "  reliability: best_effort\n"
        "  durability: volatile\n"
        "  deadline:\n"
        "    sec: 9223372036\n"
        "    nsec: 854775807\n"
        "  lifespan:\n"
        "    sec: 9223372036\n"
        "    nsec: 854775807\n"
        "  liveliness: automatic\n"
        "  liveliness_lease_duration:\n"
        "    sec: 9223372036\n"
        "    nsec: 854775807\n"
        "  avoid_ros_namespace_conventions: false"
    )


def test_the_rosbag2_record_describes_the_finished_bag(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.mcap", 101).close()
    metadata = metadata_of(tmp_path / "a.mcap")
    assert metadata["version"] == 9
    assert metadata["storage_identifier"] == "mcap"
    assert metadata["ros_distro"] == "jazzy"
    assert metadata["relative_file_paths"] == ["a.mcap"]
    assert metadata["message_count"] == 101
    assert metadata["duration"] == {"nanoseconds": SECOND}
    assert metadata["starting_time"] == {"nanoseconds_since_epoch": 1000 * SECOND}
    (topic,) = metadata["topics_with_message_count"]
    assert topic["message_count"] == 101
    assert topic["topic_metadata"]["name"] == "/joint_states"


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_rosbags_reads_the_file(tmp_path: Path, compression: str) -> None:
    path = tmp_path / "a.mcap"
    bag = write_bag(path, compression=compression, chunk_size=3000)
    bag.add_topic(TEXT)
    bag.write("/text", bytes(serialize_message(String(data="end"))), 1001 * SECOND, 1001 * SECOND)
    bag.close()
    with Reader(path) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == {
            "/joint_states": 100,
            "/text": 1,
        }
        assert reader.start_time == 1000 * SECOND
        assert sum(1 for _ in reader.messages()) == 101


def test_rosbags_reads_a_folder_whose_metadata_is_the_record(tmp_path: Path) -> None:
    path = tmp_path / "bag" / "a.mcap"
    write_bag(path).close()
    content = {"rosbag2_bagfile_information": metadata_of(path)}
    (tmp_path / "bag" / "metadata.yaml").write_text(yaml.safe_dump(content))
    with Reader(tmp_path / "bag") as reader:
        assert reader.message_count == 100
        assert reader.ros_distro == "jazzy"
        (connection,) = reader.connections
        assert connection.ext.offered_qos_profiles[0].reliability.name == "BEST_EFFORT"  # type: ignore[union-attr]


def test_a_bag_without_messages_is_valid(tmp_path: Path) -> None:
    BagWriter(tmp_path / "a.mcap").close()
    assert metadata_of(tmp_path / "a.mcap")["message_count"] == 0
    with Reader(tmp_path / "a.mcap") as reader:
        assert reader.message_count == 0


def test_two_topics_of_one_type_share_a_schema(tmp_path: Path) -> None:
    with_second = write_bag(tmp_path / "a.mcap", 1)
    with_second.add_topic(BagTopic("/left/joint_states", JOINTS.type_name, JOINTS.definition))
    with_second.write("/left/joint_states", joint_message(1), 1, 1)
    with_second.close()
    with open(tmp_path / "a.mcap", "rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert len(summary.schemas) == 1
    assert len(summary.channels) == 2


def test_an_existing_file_is_never_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_text("precious")
    with pytest.raises(BagExists, match=r"a\.mcap exists and is never overwritten"):
        BagWriter(path)
    assert path.read_text() == "precious"


def test_a_dangling_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").symlink_to(tmp_path / "elsewhere.mcap")
    with pytest.raises(BagExists):
        BagWriter(tmp_path / "a.mcap")


@pytest.mark.parametrize("name", ["a.bag", "a", "mcap"])
def test_a_name_that_rosbag2_would_not_take_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InvalidBagPath, match=r"must end in \.mcap"):
        BagWriter(tmp_path / name)


def test_a_missing_folder_is_created(tmp_path: Path) -> None:
    write_bag(tmp_path / "new" / "folder" / "a.mcap").close()
    assert len(readable_positions(tmp_path / "new" / "folder" / "a.mcap")) == 100


def test_a_folder_that_cannot_be_created_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match=r"cannot create .*file/a\.mcap: "):
        BagWriter(tmp_path / "file" / "a.mcap")


def test_closing_twice_does_nothing(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.mcap")
    bag.close()
    bag.close()
    assert bag.closed


def test_writing_to_a_closed_bag_is_an_error(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "a.mcap")
    bag.close()
    with pytest.raises(BagError, match=r"a\.mcap is closed"):
        bag.write("/joint_states", b"", 1, 1)
