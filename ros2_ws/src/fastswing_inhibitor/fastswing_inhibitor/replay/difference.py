"""In what decisions made again differ from the recorded ones."""

from array import array
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from fastswing_inhibitor.inhibition import Reason
from fastswing_inhibitor.replay.recorded import OVERRIDE_TYPE, Status
from fastswing_inhibitor.replay.result import Told
from fastswing_planner.bags import Bag
from fastswing_planner.bags.robot_topics import robot_topics
from fastswing_planner.robot.muscle_model import MuscleModel


def difference(names: Sequence[str], published: Told, made: Told, passed_over: bool) -> str:
    """Say in words what differs between two decisions; empty if nothing does.

    passed_over  whether the bag has joint states from between it and the decision before
    """
    if published.reason is not made.reason:
        hint = ""
        if made.reason is Reason.STALE_STATE:
            hint = ": is state_timeout the node's?"
            if passed_over:
                hint = ": it had not decided on the joint states before it, which are in the bag"
        return f"published {_reason(published.reason)}, replayed {_reason(made.reason)}{hint}"
    if published.direction_from_goal != made.direction_from_goal:
        which = {True: "to the goal", False: "of motion"}
        return (
            f"published q along the direction {which[published.direction_from_goal]}, replayed "
            f"along that {which[made.direction_from_goal]}: is velocity_threshold the node's?"
        )
    same_bits = _bits(published.speed_index) == _bits(made.speed_index)
    if same_bits and published.inhibited == made.inhibited:
        return ""
    other = np.flatnonzero(np.not_equal(published.inhibited, made.inhibited))
    before, after = np.array(published.speed_index), np.array(made.speed_index)
    unequal = before.view(np.int64) != after.view(np.int64)
    unequal &= ~(np.isnan(before) & np.isnan(after))
    if unequal.any():
        at = int(np.nanargmax(np.where(unequal, np.abs(before - after), -1.0)))
        text = (
            f"q of {names[at]} published {published.speed_index[at]!r} s/rad, replayed "
            f"{made.speed_index[at]!r}"
        )
        return text + (f"; inhibited differ: {_listed(names, other)}" if other.size else "")
    if other.size:
        return f"same q, but inhibited differ: {_listed(names, other)}"
    return ""


def _bits(numbers: Sequence[float]) -> bytes:
    return array("d", numbers).tobytes()


def _listed(names: Sequence[str], places: Any) -> str:
    return ", ".join(names[place] for place in places)


def _reason(reason: Reason) -> str:
    return "a decision" if reason is Reason.NONE else f"the end {reason.name}"


def override_differences(
    bag: Bag, model: MuscleModel, statuses: Sequence[Status], prefix: str
) -> Iterator[str]:
    """Yield a line for each override that is missing, or not what the status of its stamp says."""
    said = {status.stamp_ns: np.array(status.decision.inhibited) for status in statuses}
    names = np.array(model.muscle_names)
    found = set()
    for topic in robot_topics(bag, OVERRIDE_TYPE, prefix):
        for part in bag.stream(topic, "header", ["name"]):
            for stamp, chosen in zip(part.time_ns.tolist(), part["name"], strict=True):
                found.add(stamp)
                if stamp in said and set(chosen) != set(names[said[stamp]]):
                    yield (
                        f"the override of stamp {stamp} ns names {', '.join(chosen) or 'nothing'}, "
                        f"its status {', '.join(names[said[stamp]]) or 'nothing'}"
                    )
    for stamp, inhibited in said.items():
        if inhibited.any() and stamp not in found:
            yield (
                f"the override of stamp {stamp} ns is not in the bag, its status names "
                f"{', '.join(names[inhibited])}"
            )
