"""The frame of nodes that only watch: they look at topics now and then."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.parameters import Parameter

NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""A slow reader of this kind makes no publisher wait, and none send again."""


@dataclass(frozen=True)
class Sample:
    """A topic's newest message.

    received  monotonic time [s] of its arrival
    sequence  how many messages its publisher had published with it; 0 if the middleware does not
              tell
    """

    message: Any
    received: float
    sequence: int


class PolledTopic:
    """A subscription whose newest message is taken when somebody asks for it."""

    def __init__(self, kind: type, subscription: Subscription) -> None:
        """`kind` is the type of the messages."""
        self.subscription = subscription
        self._kind = kind
        self._looked = -float("inf")

    def take(self, now: float) -> Sample | None:
        """Return what arrived last since the last call, if anything did.

        now  monotonic time [s]
        """
        handle = self.subscription.handle
        with handle:
            taken = handle.take_message(self._kind, False)
        looked, self._looked = self._looked, now
        if taken is None:
            return None
        message, info = taken
        # The system's clock may have jumped meanwhile; it cannot have arrived before the last look.
        waited = max((time.time_ns() - info["received_timestamp"]) * 1e-9, 0.0)
        return Sample(
            message, max(now - waited, looked), info.get("publication_sequence_number") or 0
        )


class PollingNode(ManagedNode):
    """A managed node that no topic wakes: watching 1 kHz of states costs it little."""

    def __init__(self, name: str, table: Sequence[Parameter]) -> None:
        """Declare `table`, as ManagedNode does."""
        self._polled: list[PolledTopic] = []
        super().__init__(name, table)

    @property
    def subscriptions(self) -> Iterator[Subscription]:
        """The subscriptions that the executor serves: all but the polled ones."""
        polled = [topic.subscription for topic in self._polled]
        yield from (one for one in super().subscriptions if one not in polled)

    def poll(self, kind: type, topic: str) -> PolledTopic:
        """Begin to watch a topic, best effort and only its newest message."""
        subscription = self.create_subscription(kind, topic, lambda _message: None, NEWEST)
        polled = PolledTopic(kind, subscription)
        self._polled.append(polled)
        # The executor may have looked at the subscriptions before this one was known as polled.
        self._wake_executor()
        return polled

    def end_polling(self) -> None:
        """Watch no topic any more."""
        while self._polled:
            self.destroy_subscription(self._polled.pop().subscription)
