"""One swing of a recording: what was measured, beside what was predicted."""

from dataclasses import dataclass

import numpy as np

from fastswing_planner.analysis.inhibition_intervals import InhibitionInterval
from fastswing_planner.analysis.latency import InhibitionLatency
from fastswing_planner.analysis.recording import (
    JointSeries,
    MuscleSeries,
    RecordedPlan,
)


@dataclass(frozen=True)
class JointFigures:
    """Of one joint: peak speeds [rad/s], magnitudes; NaN if unknown or not predicted."""

    name: str
    peak_speed: float
    predicted_peak_speed: float


@dataclass(frozen=True)
class MuscleFigures:
    """Of one muscle; NaN if unknown or not predicted.

    peak_speed, predicted_peak_speed  [m/s] magnitudes
    peak_tension                      [N]
    inhibited                         [s] time under an override
    elongation                        [m] paid out before the swing, as planned
    masked                            the plan inhibits or elongates it
    """

    name: str
    peak_speed: float
    predicted_peak_speed: float
    peak_tension: float
    inhibited: float
    elongation: float
    masked: bool


@dataclass(frozen=True)
class MeasuredSwing:
    """One swing. `start` is in the recording's time; all other times [s] count from `start`.

    source        the bag
    namespace     of its topics
    number        1 for the first of its bag
    method        as in the plan; 'unplanned' without one
    start         [s] the swing's command, or when the motion began
    commanded     whether `start` is a command's
    arrival       [s] the arm first was within `tolerance` of the end; NaN: it was not
    tolerance     [rad]
    rest          [s] the last motion before the arm rested
    plan          None: no plan, or none of this swing
    joints        each joint's figures
    muscles       each muscle's figures; empty without muscle states
    joint_series, muscle_series  what was measured around the swing
    inhibited     what was forced to zero current
    latency       of the overrides in this swing
    rejected      joint states that the inhibitor could not use; NaN if it did not tell
    ended         why the inhibitor disarmed; empty if it was not armed
    faulty        muscles that reported a fault
    notes         what a reader has to know before trusting the figures
    """

    source: str
    namespace: str
    number: int
    method: str
    start: float
    commanded: bool
    arrival: float
    tolerance: float
    rest: float
    plan: RecordedPlan | None
    joints: tuple[JointFigures, ...]
    muscles: tuple[MuscleFigures, ...]
    joint_series: JointSeries
    muscle_series: MuscleSeries | None
    inhibited: tuple[InhibitionInterval, ...]
    latency: InhibitionLatency
    rejected: float
    ended: str
    faulty: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def fastest_joint(self) -> JointFigures:
        """The joint with the highest measured speed, perhaps one that only swings along."""
        return max(self.joints, key=lambda joint: np.nan_to_num(joint.peak_speed, nan=-1.0))

    @property
    def main_joint(self) -> JointFigures:
        """The joint that the plan moves farthest; without a plan the fastest."""
        if self.plan is None:
            return self.fastest_joint
        name = self.plan.joint_names[int(np.argmax(np.abs(self.plan.end - self.plan.start)))]
        return next(joint for joint in self.joints if joint.name == name)

    @property
    def fastest_muscle(self) -> MuscleFigures | None:
        """The muscle with the highest measured speed; None without muscle states."""
        return _largest(self.muscles, "peak_speed")

    @property
    def tightest_muscle(self) -> MuscleFigures | None:
        """The muscle with the largest measured tension; None without muscle states."""
        return _largest(self.muscles, "peak_tension")

    @property
    def predicted_time(self) -> float:
        """[s] NaN without a plan."""
        return self.plan.time_cost if self.plan is not None else np.nan


def _largest(muscles: tuple[MuscleFigures, ...], figure: str) -> MuscleFigures | None:
    known = [muscle for muscle in muscles if not np.isnan(getattr(muscle, figure))]
    return max(known, key=lambda muscle: float(getattr(muscle, figure)), default=None)


def swing_label(swing: MeasuredSwing) -> str:
    """Return what names a swing in one line: bag, namespace, number, method, time."""
    space = f" {swing.namespace}" if swing.namespace else ""
    return f"{swing.source}{space} swing {swing.number} ({swing.method}, at {swing.start:.2f} s)"
