"""When the messages of a bag's topics came, noted while they are read."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.analysis.recording import TopicTimes
from fastswing_planner.arrays import Vector
from fastswing_planner.bags import Bag
from fastswing_planner.cdr.columns import Columns

JOINT_STATE = "sensor_msgs/msg/JointState"
MUSCLE_STATE = "fastswing_msgs/msg/MuscleState"
_STEADY = (JOINT_STATE, MUSCLE_STATE)
"""Come at a rate of their own."""


class TimedTopics:
    """Reads topics by their stamps, and keeps when their messages came.

    began_ns  [ns] since 1970; times are counted from it
    topics    what was read so far
    """

    def __init__(self, bag: Bag, began_ns: int) -> None:
        """Read nothing yet."""
        self._bag = bag
        self.began_ns = began_ns
        self.topics: list[TopicTimes] = []

    def seconds(self, time_ns: NDArray[np.int64]) -> Vector:
        """Return times [ns] as [s] since the bag began."""
        return np.asarray((time_ns - self.began_ns) * 1e-9)

    def stamps(self, part: Columns) -> Vector:
        """Return the headers' stamps [s]; a header without one counts as just recorded."""
        return self.seconds(np.where(part.time_ns == 0, part.log_time_ns, part.time_ns))

    def parts(self, topic: str, *fields: str) -> Iterator[Columns]:
        """Read a topic by its stamps, once noting when its messages came."""
        known = {"header.stamp.sec", *self._bag.fields(topic)}
        wanted = [name for name in fields if name in known]
        log_times, stamps, sequences = [], [], []
        for part in self._bag.stream(topic, time="header", fields=wanted):
            log_times.append(self.seconds(part.log_time_ns))
            stamps.append(self.stamps(part))
            sequences.append(part.sequence)
            yield part
        if topic in {one.name for one in self.topics}:
            return
        type_name = self._bag.topics[topic].type
        steady = type_name in _STEADY
        self.topics.append(
            TopicTimes(
                topic,
                type_name,
                np.concatenate(log_times),
                np.concatenate(stamps) if steady else None,
                np.concatenate(sequences).astype(np.int64),
                steady,
            )
        )

    def add_times(self, topic: str | None) -> None:
        """Note when the messages of a topic came that is read otherwise; None: of none."""
        if topic is not None:
            self.topics += topic_times(self._bag, [topic], self.began_ns)


def topic_times(bag: Bag, topics: Sequence[str], began_ns: int) -> list[TopicTimes]:
    """Return when the messages of topics came that are read otherwise."""
    found = []
    for topic in topics:
        parts = list(bag.stream(topic, fields=[]))
        found.append(
            TopicTimes(
                topic,
                bag.topics[topic].type,
                np.concatenate([(part.log_time_ns - began_ns) * 1e-9 for part in parts]),
                sequence=np.concatenate([part.sequence for part in parts]).astype(np.int64),
            )
        )
    return found
