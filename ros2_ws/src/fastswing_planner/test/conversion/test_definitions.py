"""The definition of a message type explains its bags years later."""

import pytest
from rclpy.serialization import serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import JointState

from fastswing_planner.conversion.definitions import (
    SEPARATOR,
    UnknownMessageType,
    definition_text,
    type_hash,
)

TYPES = (
    "sensor_msgs/msg/JointState",
    "diagnostic_msgs/msg/DiagnosticArray",
    "fastswing_msgs/msg/MuscleState",
    "fastswing_msgs/msg/CurrentOverride",
    "fastswing_msgs/msg/InhibitionStatus",
    "fastswing_msgs/msg/SwingPlan",
)


def sections(type_name: str) -> list[str]:
    return definition_text(type_name).split(f"{SEPARATOR}\nMSG: ")


def test_the_text_begins_with_the_type_itself() -> None:
    assert "float64[] effort" in sections("sensor_msgs/msg/JointState")[0]


def test_every_dependency_follows_once_in_depth_first_order() -> None:
    names = [section.split("\n", 1)[0] for section in sections("fastswing_msgs/msg/SwingPlan")[1:]]
    assert names == [
        "fastswing_msgs/MaskTrial",
        "fastswing_msgs/SwingTrajectory",
        "std_msgs/Header",
        "builtin_interfaces/Time",
    ]


def test_a_separator_is_eighty_equals_signs() -> None:
    assert SEPARATOR == "=" * 80
    text = definition_text("std_msgs/msg/Header")
    assert f"\n\n{'=' * 80}\nMSG: builtin_interfaces/Time\n# " in text


def test_a_type_of_primitives_is_its_own_text() -> None:
    assert SEPARATOR not in definition_text("builtin_interfaces/msg/Time")


def test_the_short_and_the_long_name_mean_the_same() -> None:
    assert definition_text("sensor_msgs/JointState") == definition_text(
        "sensor_msgs/msg/JointState"
    )


@pytest.mark.parametrize("type_name", TYPES)
def test_rosbags_computes_the_installed_hash_from_the_text(type_name: str) -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition_text(type_name), type_name))
    assert store.hash_rihs01(type_name) == type_hash(type_name)


def test_rosbags_decodes_with_nothing_but_the_text() -> None:
    name = "sensor_msgs/msg/JointState"
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition_text(name), name))
    message = JointState(name=["E-p"], position=[1.5], velocity=[-2.0], effort=[3.0])
    message.header.stamp.sec = 7
    decoded = store.deserialize_cdr(serialize_message(message), name)
    assert decoded.header.stamp.sec == 7  # type: ignore[attr-defined]
    assert decoded.position.tolist() == [1.5]  # type: ignore[attr-defined]


def test_a_package_that_is_not_installed_is_named() -> None:
    with pytest.raises(UnknownMessageType, match="message package 'no_such_msgs' is not installed"):
        definition_text("no_such_msgs/msg/Thing")


def test_a_message_that_its_package_lacks_is_named() -> None:
    with pytest.raises(UnknownMessageType, match="package 'std_msgs' has no message 'Thing'"):
        definition_text("std_msgs/msg/Thing")


@pytest.mark.parametrize("name", ["std_srvs/srv/Trigger", "String", "a/b/c/d", "", "../etc/passwd"])
def test_what_is_no_message_type_is_refused(name: str) -> None:
    with pytest.raises(UnknownMessageType, match=r"is no message type, expected package/msg/Name"):
        definition_text(name)


def test_a_type_without_an_installed_hash_has_an_empty_one() -> None:
    assert type_hash("std_msgs/msg/Thing") == ""
