"""The topics of one robot are those of its namespace, and of no other that begins like it."""

from pathlib import Path

import pytest
from bag_builder import JOINT_STATE_NAME, START, Builder, joint_state

from fastswing_planner.bags import Bag, open_bag
from fastswing_planner.bags.robot_topics import namespace_of, robot_topic, robot_topics
from fastswing_planner.errors import UnknownTopic

NAMES = ("/joint_states", "/lab/left/joint_states", "/left/joint_states", "/left_2/joint_states")


@pytest.fixture
def bag(tmp_path: Path) -> Bag:
    with Builder(tmp_path / "a.mcap") as made:
        for name in NAMES:
            made.joints(name)
            made.write(name, joint_state([1.0]), START)
        made.joints("/left/silent")
    return open_bag(tmp_path / "a.mcap")


@pytest.mark.parametrize(
    ("namespace", "expected"),
    [
        ("", set(NAMES)),
        ("/left", {"/left/joint_states"}),
        ("/left/", {"/left/joint_states"}),
        ("/lab", {"/lab/left/joint_states"}),
        ("/le", set()),
    ],
)
def test_a_robots_topics_stand_in_its_namespace_or_below(
    bag: Bag, namespace: str, expected: set[str]
) -> None:
    assert set(robot_topics(bag, JOINT_STATE_NAME, namespace)) == expected


def test_the_topic_with_most_messages_is_first(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as made:
        made.joints("/a").joints("/b")
        for name in ("/a", "/b", "/b"):
            made.write(name, joint_state([1.0]), START)
    assert robot_topics(open_bag(tmp_path / "a.mcap"), JOINT_STATE_NAME, "") == ["/b", "/a"]


def test_the_one_topic_of_a_robot_is_found(bag: Bag) -> None:
    assert robot_topic(bag, JOINT_STATE_NAME, "/left") == "/left/joint_states"


def test_no_topic_names_type_and_namespace(bag: Bag) -> None:
    with pytest.raises(UnknownTopic) as caught:
        robot_topic(bag, JOINT_STATE_NAME, "/right")
    assert str(caught.value) == f"no messages of type {JOINT_STATE_NAME} below /right"


def test_several_topics_are_named(bag: Bag) -> None:
    with pytest.raises(UnknownTopic) as caught:
        robot_topic(bag, JOINT_STATE_NAME, "")
    assert str(caught.value) == (
        f"more than one topic of type {JOINT_STATE_NAME}: {', '.join(NAMES)}; choose with --prefix"
    )


@pytest.mark.parametrize(
    ("topic", "namespace"), [("/a", ""), ("/left/a", "/left"), ("/lab/left/a", "/lab/left")]
)
def test_a_topic_has_the_namespace_before_its_last_slash(topic: str, namespace: str) -> None:
    assert namespace_of(topic) == namespace
