"""Checks of incoming commands, before the arbiter sees them."""

from collections.abc import Sequence

import numpy as np

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.cdr.stamps import StampFault, age_sec, stamp_fault
from musashi_muscle_bridge.errors import CommandRejected


def checked_index(names: Sequence[str], muscle_names: Sequence[str]) -> list[int]:
    """Return the muscles' indices; raises CommandRejected for unknown or repeated names."""
    positions = {name: index for index, name in enumerate(muscle_names)}
    index = []
    for name in names:
        if name not in positions:
            choices = ", ".join(muscle_names)
            raise CommandRejected(
                "unknown_name", f"unknown muscle '{name}', choose from: {choices}"
            )
        index.append(positions[name])
    if len(set(index)) != len(index):
        raise CommandRejected("duplicate_name", f"a muscle is named twice: {', '.join(names)}")
    return index


def checked_values(names: Sequence[str], values: Sequence[float]) -> Vector:
    """Return the values; raises CommandRejected unless there is a finite one for each name."""
    if len(values) != len(names):
        raise CommandRejected("wrong_length", f"{len(values)} values for {len(names)} muscles")
    vector = frozen(values)
    if not np.isfinite(vector).all():
        bad = int(np.flatnonzero(~np.isfinite(vector))[0])
        raise CommandRejected("not_finite", f"the value of {names[bad]} is {vector[bad]}")
    return vector


def check_lease(lease: float, max_lease: float, age: float = 0.0) -> None:
    """Raise CommandRejected for a lease [s] that is not positive, too long or over already.

    age  [s] of the override that asks for it
    """
    if not 0.0 < lease <= max_lease:
        raise CommandRejected(
            "lease", f"lease is {lease:g} s, expected 0 < lease <= {max_lease:g} s"
        )
    if age >= lease:
        raise CommandRejected(
            "expired", f"the override is {age:.3f} s old, its lease of {lease:g} s is over"
        )


def check_stream(age: float, timeout: float) -> None:
    """Raise CommandRejected for a tension or current command that is older than it would last.

    age, timeout  [s]
    """
    if age >= timeout:
        raise CommandRejected(
            "expired", f"the command is {age:.3f} s old, it would have ended after {timeout:g} s"
        )


def checked_age(stamp_ns: int, now_ns: int, max_age: float, max_ahead: float = 0.05) -> float:
    """Return how old a command is [s], never less than 0.

    max_age, max_ahead  [s]

    Raises CommandRejected for a stamp [ns] that is zero, old or in the future.
    """
    age = age_sec(stamp_ns, now_ns)
    fault = stamp_fault(stamp_ns, now_ns, max_age, max_ahead)
    if fault is not None:
        text = {
            StampFault.ZERO: "the stamp is zero: fill in when the command was made",
            StampFault.OLD: f"the stamp is {age:.3f} s old, at most {max_age:g} s",
            StampFault.FUTURE: f"the stamp is {-age:.3f} s in the future",
        }
        raise CommandRejected(fault.value, text[fault])
    return max(age, 0.0)
