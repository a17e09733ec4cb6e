"""Stamps of ROS: seconds and nanoseconds, and whether one is too old to act on."""

from enum import Enum
from typing import Any, NamedTuple

NS_PER_SEC = 1_000_000_000


class Stamp(NamedTuple):
    """A time or a duration as messages carry it."""

    sec: int
    nanosec: int


class StampFault(Enum):
    """What is wrong with a stamp; the value is a short name for counting."""

    ZERO = "zero_stamp"
    OLD = "old_stamp"
    FUTURE = "future_stamp"


def to_ns(sec: Any, nanosec: Any) -> Any:
    """Return a stamp in [ns]: plain integers, or columns of them, shape (k,)."""
    return sec * NS_PER_SEC + nanosec


def to_seconds(sec: Any, nanosec: Any) -> Any:
    """Return a duration in [s]: plain numbers, or columns of them, shape (k,)."""
    return sec + nanosec * 1e-9


def from_ns(time_ns: int) -> Stamp:
    """Return [ns] as a stamp; before 1970 `sec` is negative and `nanosec` is not."""
    return Stamp(*divmod(time_ns, NS_PER_SEC))


def from_seconds(seconds: float) -> Stamp:
    """Return a duration [s] as a stamp, rounded to the nanosecond."""
    return from_ns(round(seconds * 1e9))


def age_sec(stamp_ns: int, now_ns: int) -> float:
    """Return how old a stamp [ns] is at `now_ns` [ns], in [s]; negative in the future."""
    return (now_ns - stamp_ns) * 1e-9


def stamp_fault(stamp_ns: int, now_ns: int, max_age: float, max_ahead: float) -> StampFault | None:
    """Return why nobody may act on a message with this stamp [ns]; None if it is fine.

    max_age    [s] the oldest that is taken
    max_ahead  [s] the farthest into the future: such a clock says nothing about the age
    """
    if stamp_ns == 0:
        return StampFault.ZERO
    age = age_sec(stamp_ns, now_ns)
    if age > max_age:
        return StampFault.OLD
    return StampFault.FUTURE if age < -max_ahead else None
