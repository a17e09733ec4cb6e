"""Which of the recorded plans a swing carried out."""

import numpy as np

from fastswing_planner.analysis.finding import Burst, moved_towards
from fastswing_planner.analysis.recording import JointSeries, RecordedPlan, Recording
from fastswing_planner.arrays import Vector

_NEAR_PLAN_RAD = 0.3
"""A plan whose start is farther from the arm is another swing's."""
_LEAST_WAY = 0.1
"""Share of a plan's way; a motion that went less of it is not that plan's swing."""


def plan_of(recording: Recording, burst: Burst) -> tuple[RecordedPlan | None, bool]:
    """Return the plan in force, and whether there was one that is not this motion's."""
    joints = recording.joints
    before = [plan for plan in recording.plans if plan.received <= joints.time[burst.fastest]]
    meanwhile = [plan for plan in recording.plans if plan.received <= joints.time[burst.last]]
    if not meanwhile:
        return None, False
    plan = before[-1] if before else meanwhile[0]
    if not set(plan.joint_names) <= set(joints.names):
        return None, True
    if burst.begins_cut:
        return plan, False
    begin = _posture(joints, plan.joint_names, burst.first)
    distances = [float(np.linalg.norm(begin - end)) for end in (plan.start, plan.end)]
    # A motion away from the plan's end, or to its start, is judged by its way.
    if min(distances) > _NEAR_PLAN_RAD and not _raises(joints, plan, burst):
        return None, True
    return plan, False


def is_no_swing(joints: JointSeries, plan: RecordedPlan, burst: Burst) -> bool:
    """Whether a motion only raises the arm to the plan's start, or hardly follows the plan."""
    return _raises(joints, plan, burst) or _way(joints, plan, burst) < _LEAST_WAY


def _raises(joints: JointSeries, plan: RecordedPlan, burst: Burst) -> bool:
    """Whether a motion goes to the plan's start posture, from wherever the arm hung."""
    begin, finish = (
        float(np.linalg.norm(_posture(joints, plan.joint_names, row) - plan.start))
        for row in (burst.first, burst.last)
    )
    return finish <= _NEAR_PLAN_RAD < begin


def _posture(joints: JointSeries, names: tuple[str, ...], row: int) -> Vector:
    columns = [joints.names.index(name) for name in names]
    return np.asarray(joints.position[row, columns], dtype=float)


def _way(joints: JointSeries, plan: RecordedPlan, burst: Burst) -> float:
    """Return how far the motion went along the plan; NaN positions count as all of it."""
    begin = _posture(joints, plan.joint_names, burst.first)
    finish = _posture(joints, plan.joint_names, burst.last)
    way = moved_towards(plan.start, plan.end, begin, finish)
    return 1.0 if np.isnan(way) else way
