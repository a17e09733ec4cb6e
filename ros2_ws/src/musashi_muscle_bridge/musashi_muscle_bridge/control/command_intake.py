"""Messages that command muscles become orders, each checked once; what is refused is counted."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from fastswing_planner.cdr.stamps import to_ns, to_seconds
from musashi_muscle_bridge.buses.protocol import Mode
from musashi_muscle_bridge.control.command_checks import (
    check_lease,
    check_stream,
    checked_age,
    checked_index,
    checked_values,
)
from musashi_muscle_bridge.control.orders import Command, Order, Override
from musashi_muscle_bridge.errors import CommandRejected

COMMANDS = {
    "length_command": (Mode.LENGTH, "length"),
    "tension_command": (Mode.TENSION, "tension"),
    "current_command": (Mode.CURRENT, "current"),
}
"""Mode, and the field with the values, of each command's topic."""
OVERRIDE = "current_override"
COMMAND_TOPICS = (*COMMANDS, OVERRIDE)


@dataclass
class CommandTally:
    """What was wrong with commands.

    counts  by `rejected_TOPIC_REASON` and `contested_TOPIC`
    last    the last rejection, for people; empty if there was none
    """

    counts: Counter[str] = field(default_factory=Counter)
    last: str = ""

    def reject(self, topic: str, error: CommandRejected) -> None:
        """Count a command that was not taken."""
        self.counts[f"rejected_{topic}_{error.reason}"] += 1
        self.last = f"{topic}: {error}"

    def contest(self, topic: str) -> None:
        """Count a command on a topic that has more than one publisher."""
        self.counts[f"contested_{topic}"] += 1


@dataclass(frozen=True)
class CommandIntake:
    """Judges the messages of all command topics.

    muscle_names     the robot's
    command_max_age  [s] older messages are rejected
    command_timeout  [s] tension and current commands last so long
    max_lease        [s] longest lease of an override
    """

    muscle_names: Sequence[str]
    command_max_age: float
    command_timeout: float
    max_lease: float

    def order(self, topic: str, message: Any, now: float, clock_ns: int) -> Order:
        """Return what a message asks for; raises CommandRejected.

        topic     one of COMMAND_TOPICS, without namespace
        message   its type, or what has its attributes
        now       monotonic time [s]
        clock_ns  [ns] the same moment on the clock of the message's stamp

        What is asked counts from when it was made, not from now: a message that waited while the
        node stood still gets no longer lease, and no longer stream, by that.
        """
        stamp = message.header.stamp
        age = checked_age(to_ns(stamp.sec, stamp.nanosec), clock_ns, self.command_max_age)
        index = checked_index(message.name, self.muscle_names)
        if topic == OVERRIDE:
            return self._override(message.lease, index, now, age)
        mode, values_field = COMMANDS[topic]
        values = checked_values(message.name, getattr(message, values_field))
        if mode is not Mode.LENGTH:
            check_stream(age, self.command_timeout)
        return Command(mode, index, values, now - age)

    def _override(self, duration: Any, index: list[int], now: float, age: float) -> Override:
        lease = to_seconds(duration.sec, duration.nanosec)
        if index:
            check_lease(lease, self.max_lease, age)
        return Override(index, lease, now - age)
