"""One arm's recording as arrays. All times are in seconds since the recording began."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fastswing_planner.arrays import BoolVector, Matrix, Vector

ZERO_CURRENT = 0
"""MODE_ZERO_CURRENT of `fastswing_msgs/MuscleState`."""
_LARGEST = 1e6
"""In SI units, beyond anything that an arm can do."""


@dataclass(frozen=True)
class JointSpeed:
    """How fast the arm was in every joint state of the recording.

    time     [s] their stamps, shape (k,)
    speed    [rad/s] of the fastest joint, shape (k,); NaN: not measured
    fastest  the joint that was fastest of all; empty without any speed
    """

    time: Vector
    speed: Vector
    fastest: str = ""


@dataclass(frozen=True)
class Burst:
    """Joint states first to last, both included, in which the arm moved without a rest.

    fastest      index of the fastest one
    begins_cut   the recording begins, or goes on after a gap, in the middle of it
    ends_cut     the recording ends, or has a gap, before the arm rested
    armed        the inhibitor was armed meanwhile
    hole         [s] longest pause of known speeds in it that could hide a rest; 0: none
    """

    first: int
    last: int
    fastest: int
    begins_cut: bool
    ends_cut: bool
    armed: bool = False
    hole: float = 0.0


@dataclass(frozen=True)
class JointSeries:
    """Measured joint states, as many as are needed.

    row       which joint states of the recording these are, rising, shape (k,)
    time      [s] their stamps, shape (k,)
    position  [rad] shape (k, n); NaN if the bag holds none
    velocity  [rad/s] shape (k, n)
    """

    names: tuple[str, ...]
    row: NDArray[np.int64]
    time: Vector
    position: Matrix
    velocity: Matrix


@dataclass(frozen=True)
class MuscleSeries:
    """Measured muscle states.

    time      [s] their stamps, shape (k,)
    velocity  [m/s] longer is positive, shape (k, m)
    tension   [N] shape (k, m)
    current   [A] shape (k, m)
    mode      MODE_* of MuscleState, shape (k, m)
    fault     FAULT_* of MuscleState, shape (k, m)
    """

    names: tuple[str, ...]
    time: Vector
    velocity: Matrix
    tension: Matrix
    current: Matrix
    mode: NDArray[np.uint8]
    fault: NDArray[np.uint8]


@dataclass(frozen=True)
class OverrideSeries:
    """Zero-current overrides.

    stamp     [s] of the joint state that each was decided on, shape (k,)
    received  [s] when it was recorded, shape (k,)
    lease     [s] shape (k,)
    muscles   the muscles of each, k tuples
    """

    stamp: Vector
    received: Vector
    lease: Vector
    muscles: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class StatusSeries:
    """What the inhibitor said of itself.

    time      [s] stamps of the joint states decided on, shape (k,)
    armed     shape (k,)
    rejected  joint states that could not be used since it was armed, shape (k,); NaN: not recorded
    reason    its REASON_* text; empty while armed, k texts
    """

    time: Vector
    armed: BoolVector
    rejected: Vector
    reason: tuple[str, ...]


@dataclass(frozen=True)
class CommandSeries:
    """Length commands.

    time  [s] shape (k,)
    step  [m] largest change of a muscle's commanded length, shape (k,)
    """

    time: Vector
    step: Vector


@dataclass(frozen=True)
class RecordedPlan:
    """A plan as it was published.

    received         [s] on the clock of the joint states' stamps
    start, end       [rad] shape (n,)
    kept             the paper's mask as flags, shape (m,)
    inhibited        masked because Method 1 is predicted to inhibit the muscle, shape (m,)
    elongation       [m] shape (m,)
    speed_index      [s/rad] shape (m,)
    time_cost        [s]
    time             [s] ends of the steps, shape (j,)
    joint_velocity   [rad/s] means over the steps, shape (j, n)
    muscle_velocity  [m/s] means over the steps, shape (j, m)
    """

    received: float
    method: str
    joint_names: tuple[str, ...]
    start: Vector
    end: Vector
    muscle_names: tuple[str, ...]
    kept: BoolVector
    inhibited: BoolVector
    elongation: Vector
    speed_index: Vector
    time_cost: float
    time: Vector
    joint_velocity: Matrix
    muscle_velocity: Matrix

    @property
    def masked(self) -> tuple[str, ...]:
        """The muscles that are inhibited or elongated."""
        return tuple(np.array(self.muscle_names, dtype=object)[~self.kept])


@dataclass(frozen=True)
class TopicTimes:
    """When a topic's messages came.

    name      with its namespace
    received  [s] shape (k,)
    stamp     [s] of the headers, shape (k,); None: it has none
    sequence  the publisher's count, shape (k,); None: not recorded
    steady    its messages come in a fixed period
    """

    name: str
    type_name: str
    received: Vector
    stamp: Vector | None = None
    sequence: NDArray[np.int64] | None = None
    steady: bool = False


@dataclass(frozen=True)
class Recording:
    """Everything of one arm that the analysis uses; None and empty: not in the bag.

    source     the bag's name, for people
    namespace  of its topics, without a slash at the end; empty: none
    began_ns   when it began, since 1970
    speed      of all joint states
    bursts     the fast motions that were found in it; their indices are of `speed`
    joints     the joint states around the fast motions, at least
    muscles    the muscle states around them
    counters   increase of the counted rejections and losses, node -> name -> count
    warnings   what is wrong with the bag itself
    """

    source: str
    namespace: str
    speed: JointSpeed
    joints: JointSeries
    bursts: tuple[Burst, ...] = ()
    began_ns: int = 0
    muscles: MuscleSeries | None = None
    overrides: OverrideSeries | None = None
    status: StatusSeries | None = None
    commands: CommandSeries | None = None
    plans: tuple[RecordedPlan, ...] = ()
    topics: tuple[TopicTimes, ...] = ()
    counters: Mapping[str, Mapping[str, int]] | None = None
    warnings: tuple[str, ...] = ()


def plausible(values: ArrayLike) -> Matrix:
    """Return numbers as floats; what no arm can measure, infinity included, is unknown."""
    numbers = np.asarray(values, dtype=float)
    beyond = ~(np.abs(numbers) <= _LARGEST)
    return np.where(beyond, np.nan, numbers) if beyond.any() else numbers
