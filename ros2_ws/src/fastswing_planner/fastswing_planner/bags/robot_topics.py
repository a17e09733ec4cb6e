"""Which of a bag's topics belong to one robot."""

from fastswing_planner.bags.reader import Bag
from fastswing_planner.errors import UnknownTopic


def robot_topics(bag: Bag, type_name: str, namespace: str) -> list[str]:
    """Return the topics of a type with messages in a robot's namespace, that with most first.

    namespace  such as '/left', or below it; empty: the bag holds one robot, wherever it is
    """
    below = namespace.rstrip("/") + "/"
    names = bag.topics_of_type(type_name)
    return [name for name in names if not namespace or name.startswith(below)]


def robot_topic(bag: Bag, type_name: str, namespace: str) -> str:
    """Return the one topic of a type of a robot; raises UnknownTopic for none and for several."""
    names = robot_topics(bag, type_name, namespace)
    if not names:
        where = f" below {namespace}" if namespace else ""
        raise UnknownTopic(f"no messages of type {type_name}{where}")
    if len(names) > 1:
        raise UnknownTopic(
            f"more than one topic of type {type_name}: {', '.join(names)}; choose with --prefix"
        )
    return names[0]


def namespace_of(topic: str) -> str:
    """Return a topic's namespace without the slash at its end; empty for the root."""
    return topic.rpartition("/")[0]
