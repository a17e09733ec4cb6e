"""What a bag's files say of its topics."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import yaml
from mcap.records import Channel

from fastswing_planner.bags.mcap_file import McapFile


@dataclass(frozen=True)
class Topic:
    """One topic of a bag.

    type           'package/msg/Name'
    message_count  what the bag says, or what was recovered
    qos            of each publisher in rosbag2's words; empty if the bag does not say
    definition     text of the type
    encoding       of the definition; only 'ros2msg' can be read
    type_hash      'RIHS01_...'; empty if the bag does not say
    """

    name: str
    type: str
    message_count: int
    qos: tuple[Mapping[str, Any], ...] = ()
    definition: str = ""
    encoding: str = "ros2msg"
    type_hash: str = ""


def topics_of(files: Sequence[McapFile]) -> dict[str, Topic]:
    """Return the topics of several files by name."""
    found: dict[str, Topic] = {}
    for file in files:
        for channel in sorted(file.channels.values(), key=lambda channel: channel.id):
            count = file.counts.get(channel.id, 0)
            known = found.get(channel.topic)
            if known is None or (known.message_count == 0 and count):
                found[channel.topic] = _topic(file, channel, count)
            else:
                known_count = known.message_count + count
                found[channel.topic] = replace(known, message_count=known_count)
    return dict(sorted(found.items()))


def _topic(file: McapFile, channel: Channel, count: int) -> Topic:
    schema = file.schemas.get(channel.schema_id)
    return Topic(
        channel.topic,
        schema.name if schema else "",
        count,
        _qos(channel.metadata.get("offered_qos_profiles", "")),
        schema.data.decode("utf-8", "replace") if schema else "",
        schema.encoding if schema else "",
        channel.metadata.get("topic_type_hash", ""),
    )


def _qos(text: str) -> tuple[Mapping[str, Any], ...]:
    try:
        profiles = yaml.safe_load(text)
    except yaml.YAMLError:
        return ()
    if not isinstance(profiles, list):
        return ()
    return tuple(profile for profile in profiles if isinstance(profile, dict))


def lost_in(notes: Mapping[str, str]) -> dict[str, int]:
    """Return what one file's recorder says it lost, by topic."""
    try:
        counts = json.loads(notes["lost"])
        return {str(topic): int(count) for topic, count in counts.items()}
    except (KeyError, ValueError, TypeError, AttributeError):
        return {}
