"""What is published of a bag again: states, unless topics are named; never misread bytes."""

from pathlib import Path

import pytest
from bag_builder import HEADER, JOINT_STATE_NAME, START, TIME, Builder, joint_state, text

from fastswing_inhibitor.player.topics import PlayableTopics, playable_topics
from fastswing_planner.bags import Bag, open_bag
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.errors import NotReady, UnknownName

TEXT_NAME = "std_msgs/msg/String"
OLD_PLAN = f"std_msgs/Header header\nfloat64[] goal\n{HEADER}{TIME}"
PLAN_CHANGED = (
    "/swing_plan cannot be published: recorded with other fields than the installed messages have"
)


def bag_of(path: Path, *topics: str) -> Bag:
    """Return a bag with some of: joint states, a text, and a plan with other fields than today."""
    with Builder(path) as bag:
        if "/joint_states" in topics:
            bag.topic("/joint_states", JOINT_STATE_NAME, definition_text(JOINT_STATE_NAME))
            bag.write("/joint_states", joint_state([1.0]), START)
        if "/text" in topics:
            bag.topic("/text", TEXT_NAME, definition_text(TEXT_NAME))
            bag.write("/text", text("hello"), START)
        if "/swing_plan" in topics:
            bag.topic("/swing_plan", "fastswing_msgs/msg/SwingPlan", OLD_PLAN)
    return open_bag(path)


def test_states_are_published_unless_topics_are_named(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "a.mcap", "/joint_states", "/text")
    assert playable_topics(bag, None) == PlayableTopics(["/joint_states"], "")
    assert playable_topics(bag, ["/text"]) == PlayableTopics(["/text"], "")


def test_a_topic_with_other_fields_is_left_out_and_told(tmp_path: Path) -> None:
    bag = bag_of(tmp_path / "a.mcap", "/joint_states", "/swing_plan")
    assert playable_topics(bag, None) == PlayableTopics(["/joint_states"], PLAN_CHANGED)


@pytest.mark.parametrize(
    ("topics", "named"),
    [
        (("/swing_plan",), None),
        (("/joint_states", "/swing_plan"), ["/joint_states", "/swing_plan"]),
    ],
)
def test_nothing_else_to_publish_or_a_named_one_is_an_error(
    tmp_path: Path, topics: tuple[str, ...], named: list[str] | None
) -> None:
    with pytest.raises(NotReady) as caught:
        playable_topics(bag_of(tmp_path / "a.mcap", *topics), named)
    assert str(caught.value) == PLAN_CHANGED


def test_a_bag_without_states_says_how_to_publish_others(tmp_path: Path) -> None:
    with pytest.raises(NotReady) as caught:
        playable_topics(bag_of(tmp_path / "a.mcap", "/text"), None)
    assert str(caught.value) == (
        "nothing to publish: the bag has no states; name topics with --topic"
    )


def test_a_topic_that_the_bag_does_not_have_is_named(tmp_path: Path) -> None:
    with pytest.raises(UnknownName) as caught:
        playable_topics(bag_of(tmp_path / "a.mcap", "/text"), ["/no"])
    assert str(caught.value) == "the bag has no topic /no; it has: /text"
