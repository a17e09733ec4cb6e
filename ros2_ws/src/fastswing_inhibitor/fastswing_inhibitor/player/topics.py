"""Which topics of a bag are published again."""

from dataclasses import dataclass

from fastswing_planner.bags import Bag
from fastswing_planner.cdr.schema import parse_ros2msg
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.errors import NotReady, UnknownName

STATES = (
    "sensor_msgs/msg/JointState",
    "fastswing_msgs/msg/MuscleState",
    "fastswing_msgs/msg/SwingPlan",
)
"""Types that are published unless topics are named: what the robot and the executor say. Never of
themselves commands or overrides, which would move an arm that listens."""


@dataclass(frozen=True)
class PlayableTopics:
    """names are published; warning says which cannot be, empty if all can."""

    names: list[str]
    warning: str


def playable_topics(bag: Bag, named: list[str] | None) -> PlayableTopics:
    """Return the topics to publish: those `named`, else the states.

    Left out are those whose messages have other fields than the installed type has.

    Raises UnknownName for one that the bag does not have, NotReady if there is nothing to publish
    or one that was named cannot be, UnknownMessageType, UndecodableMessage.
    """
    chosen = _chosen_topics(bag, named)
    changed = _changed_topics(bag, chosen)
    topics = [name for name in chosen if name not in changed]
    if not changed:
        return PlayableTopics(topics, "")
    warning = (
        f"{', '.join(changed)} cannot be published: recorded with other fields than the installed "
        "messages have"
    )
    if named or not topics:
        raise NotReady(warning)
    return PlayableTopics(topics, warning)


def _chosen_topics(bag: Bag, named: list[str] | None) -> list[str]:
    """Return the topics to publish; raises UnknownName for one that the bag does not have."""
    for name in named or ():
        if name not in bag.topics:
            raise UnknownName(f"the bag has no topic {name}; it has: {', '.join(bag.topics)}")
    chosen = named or [name for name, topic in bag.topics.items() if topic.type in STATES]
    if not chosen:
        raise NotReady("nothing to publish: the bag has no states; name topics with --topic")
    return chosen


def _changed_topics(bag: Bag, topics: list[str]) -> list[str]:
    """Return those whose messages have other fields than the installed type.

    Listeners would misread the recorded bytes. Raises UnknownMessageType, UndecodableMessage.
    """
    installed = {
        name: parse_ros2msg(bag.topics[name].type, definition_text(bag.topics[name].type))
        for name in topics
    }
    return [
        name
        for name, schema in installed.items()
        if any(recorded.types != schema.types for recorded in bag.schemas(name))
    ]
