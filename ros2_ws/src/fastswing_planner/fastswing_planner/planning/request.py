"""What a user asks of the planner, and how it is checked."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fastswing_planner.errors import (
    UnknownMethod,
)
from fastswing_planner.planning.swing import SwingSettings
from fastswing_planner.robot.muscle_model import Payload


class Method(IntEnum):
    """How to swing; the values are those of `fastswing_msgs/SwingOptions`."""

    BASIC = 0
    INHIBIT = 1
    ELONGATE = 2
    HYBRID = 3

    @property
    def inhibits(self) -> bool:
        """Whether muscles are at zero current during the swing."""
        return self in (Method.INHIBIT, Method.HYBRID)

    @property
    def elongates(self) -> bool:
        """Whether muscles are paid out before the swing."""
        return self in (Method.ELONGATE, Method.HYBRID)


class Search(IntEnum):
    """How masks are searched; the values are those of `fastswing_msgs/SwingOptions`."""

    GREEDY = 0
    EXHAUSTIVE = 1


@dataclass(frozen=True)
class MuscleConstants:
    """What replaces the robot's own values for the named muscles; empty arrays replace nothing.

    muscle_names    empty: all muscles, in the model's order
    velocity, acceleration, tension_min, tension_max  as in MuscleLimits, one number per muscle
    holding_weight  their block of W1 (eq. 6): its diagonal, or the whole block, row by row
    """

    muscle_names: Sequence[str] = ()
    velocity: ArrayLike = ()
    acceleration: ArrayLike = ()
    tension_min: ArrayLike = ()
    tension_max: ArrayLike = ()
    holding_weight: ArrayLike = ()


@dataclass(frozen=True)
class SwingRequest:
    """What a user asks for.

    start, end      [rad] in the order of joint_names; empty joint_names: the model's order
    kept_muscles    muscles that are never masked
    constants       values that differ from the robot's
    threshold       C [s/rad] of eq. 5 of the paper
    swing_weight    W2 (eq. 7) in the order of joint_names: its diagonal, or all of it, row by row
    search          how the mask is searched
    time_limit      [s] of the search; infinite: none
    """

    start: ArrayLike
    end: ArrayLike
    method: Method = Method.BASIC
    joint_names: Sequence[str] = ()
    kept_muscles: Sequence[str] = ()
    constants: MuscleConstants = field(default_factory=MuscleConstants)
    threshold: float = 0.0
    payload: Payload | None = None
    settings: SwingSettings = field(default_factory=SwingSettings)
    swing_weight: ArrayLike = ()
    search: Search = Search.GREEDY
    time_limit: float = np.inf


_Choice = TypeVar("_Choice", Method, Search)


def choice_from(kind: type[_Choice], what: str, value: int) -> _Choice:
    """Return the Method or Search of a number; raises UnknownMethod listing the choices."""
    try:
        return kind(value)
    except ValueError as error:
        choices = ", ".join(f"{one.value} ({one.name.lower()})" for one in kind)
        raise UnknownMethod(f"unknown {what} {value}, choose from: {choices}") from error
