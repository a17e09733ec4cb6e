"""What a replay says of a bag."""

from dataclasses import dataclass
from typing import NamedTuple

from fastswing_inhibitor.inhibition import Reason


@dataclass(frozen=True)
class WhatIf:
    """What to change; None: as published.

    threshold       C [s/rad]
    velocity_limit  [m/s] of every muscle
    """

    threshold: float | None = None
    velocity_limit: float | None = None


class Told(NamedTuple):
    """What a status tells of a decision, in the model's order of muscles.

    speed_index  q [s/rad]; NaN if not evaluated
    """

    inhibited: tuple[bool, ...]
    speed_index: tuple[float, ...]
    direction_from_goal: bool
    reason: Reason


@dataclass(frozen=True)
class Compared:
    """One decision, published and replayed.

    stamp_ns       of the joint state
    replayed       by the rule; None if its joint state is not in the bag
    difference     in words; empty if both are equal, q bit for bit
    """

    stamp_ns: int
    published: Told
    replayed: Told | None
    difference: str


@dataclass(frozen=True)
class ReplayedSwing:
    """One armed time.

    start_ns   [ns] stamp of the arming, or of the first decision if that is not in the bag
    threshold  C [s/rad] as published
    protected  muscles taken for the request's kept_muscle: above C, never inhibited, and kept in
               the plan
    decisions  in the order of publishing
    end        why it was over as published; None if the bag ends before
    rejected   joint states that the inhibitor could not use
    missing    what was published, or should have been, and is not in the bag, a line each
    complaint  why it could not be replayed; empty if it was
    """

    start_ns: int
    threshold: float
    protected: tuple[str, ...]
    decisions: tuple[Compared, ...]
    end: Reason | None
    rejected: int
    missing: tuple[str, ...] = ()
    complaint: str = ""

    @property
    def agreed(self) -> int:
        """Decisions that were replayed as published."""
        return sum(not one.difference for one in self.decisions)

    @property
    def first_difference(self) -> Compared | None:
        """The first decision that differs."""
        return next((one for one in self.decisions if one.difference), None)


@dataclass(frozen=True)
class Replay:
    """All armed times of a bag.

    muscle_names         of the model
    override_differences lines about overrides that are not what the status of their stamp says
    """

    muscle_names: tuple[str, ...]
    swings: tuple[ReplayedSwing, ...]
    override_differences: tuple[str, ...]

    @property
    def agrees(self) -> bool:
        """Whether every decision was replayed as it was published."""
        return not self.override_differences and all(
            not swing.complaint and not swing.missing and swing.agreed == len(swing.decisions)
            for swing in self.swings
        )
