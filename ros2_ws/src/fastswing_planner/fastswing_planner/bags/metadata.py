"""What rosbag2 (Jazzy) writes about a bag: the QoS of its publishers, and the bag's metadata."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from fastswing_planner.cdr.stamps import from_ns

VERSION = 9
"""Version of rosbag2's metadata in ROS 2 Jazzy."""

INFINITE_NS = 2**63 - 1
"""[ns] an unlimited duration, as the middleware reports it."""

_NEVER_NS = 2**63 - 1


@dataclass(frozen=True)
class OfferedQos:
    """A publisher's QoS in rosbag2's words; durations in ns.

    A discovered publisher does not tell its history: 'unknown' with depth 0.
    """

    history: str = "unknown"
    depth: int = 0
    reliability: str = "reliable"
    durability: str = "volatile"
    deadline_ns: int = INFINITE_NS
    lifespan_ns: int = INFINITE_NS
    liveliness: str = "automatic"
    liveliness_lease_ns: int = INFINITE_NS
    avoid_ros_namespace_conventions: bool = False


@dataclass(frozen=True)
class BagTopic:
    """What a bag says of a topic.

    name         fully qualified
    type_name    'package/msg/Name'
    definition   text of the type with all its dependencies, encoding ros2msg
    type_hash    'RIHS01_...'; empty if unknown
    offered_qos  of each publisher
    """

    name: str
    type_name: str
    definition: str
    type_hash: str = ""
    offered_qos: tuple[OfferedQos, ...] = ()


@dataclass(frozen=True)
class BagSummary:
    """What a bag holds; times in ns, 0 if it holds nothing."""

    file_name: str
    ros_distro: str
    start_ns: int
    end_ns: int
    topics: Sequence[BagTopic]
    message_counts: Mapping[str, int]

    @property
    def message_count(self) -> int:
        """Messages of all topics."""
        return sum(self.message_counts.values())


def _seconds(duration_ns: int) -> dict[str, int]:
    sec, nsec = from_ns(duration_ns)
    return {"sec": sec, "nsec": nsec}


def _qos_node(qos: OfferedQos) -> dict[str, Any]:
    return {
        "history": qos.history,
        "depth": qos.depth,
        "reliability": qos.reliability,
        "durability": qos.durability,
        "deadline": _seconds(qos.deadline_ns),
        "lifespan": _seconds(qos.lifespan_ns),
        "liveliness": qos.liveliness,
        "liveliness_lease_duration": _seconds(qos.liveliness_lease_ns),
        "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
    }


def qos_yaml(profiles: Sequence[OfferedQos]) -> str:
    """Return the text of a channel's `offered_qos_profiles`: a YAML sequence."""
    return _dump([_qos_node(profile) for profile in profiles])


def metadata_yaml(summary: BagSummary) -> str:
    """Return the text of `serialized_metadata` in the MCAP metadata record 'rosbag2'.

    Below the key `rosbag2_bagfile_information` it is the content of a bag's metadata.yaml.
    """
    return _dump(metadata_node(summary))


def folder_yaml(summaries: Sequence[BagSummary]) -> str:
    """Return the text of `metadata.yaml` beside the files of one bag."""
    return _dump({"rosbag2_bagfile_information": metadata_node(*summaries)})


def metadata_node(*summaries: BagSummary) -> dict[str, Any]:
    """Return rosbag2's metadata of a bag of one or more files as a mapping."""
    topics = {topic.name: topic for summary in summaries for topic in summary.topics}
    return {
        "version": VERSION,
        "storage_identifier": "mcap",
        **_extent(*summaries),
        "topics_with_message_count": [
            _topic_node(topic, sum(one.message_counts.get(topic.name, 0) for one in summaries))
            for topic in topics.values()
        ],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [summary.file_name for summary in summaries],
        "files": [{"path": summary.file_name, **_extent(summary)} for summary in summaries],
        "custom_data": None,
        "ros_distro": summaries[-1].ros_distro,
    }


def _extent(*summaries: BagSummary) -> dict[str, Any]:
    filled = [summary for summary in summaries if summary.message_count]
    start = min((summary.start_ns for summary in filled), default=_NEVER_NS)
    end = max((summary.end_ns for summary in filled), default=start)
    return {
        "duration": {"nanoseconds": end - start},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": sum(summary.message_count for summary in summaries),
    }


def _topic_node(topic: BagTopic, message_count: int) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type_name,
            "serialization_format": "cdr",
            "offered_qos_profiles": [_qos_node(profile) for profile in topic.offered_qos],
            "type_description_hash": topic.type_hash,
        },
        "message_count": message_count,
    }


class _PlainDumper(yaml.SafeDumper):
    """Repeats equal values instead of referring to them by anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        """Never use an anchor."""
        return True


def _dump(node: Any) -> str:
    return yaml.dump(node, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True).rstrip("\n")
