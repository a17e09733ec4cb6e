"""Measures the swings of a recording."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fastswing_planner.analysis.finding import (
    STAMP_JITTER_SEC,
    Burst,
    swing_command,
)
from fastswing_planner.analysis.inhibition_intervals import InhibitionInterval, inhibitions, within
from fastswing_planner.analysis.latency import inhibition_latency
from fastswing_planner.analysis.measured_swing import JointFigures, MeasuredSwing, MuscleFigures
from fastswing_planner.analysis.plan_matching import is_no_swing, plan_of
from fastswing_planner.analysis.recording import JointSeries, MuscleSeries, RecordedPlan, Recording
from fastswing_planner.arrays import Matrix, Vector, frozen

SHOWN_BEFORE_SEC = 0.1
"""Shown of a recording before a swing begins."""
SHOWN_AFTER_SEC = 0.3
"""Shown of a recording after the arm came to rest."""


def measure_swings(recording: Recording, tolerance: float = 0.1) -> list[MeasuredSwing]:
    """Measure the fast motions of a recording that are swings.

    tolerance  [rad] norm of the distance to the end posture that counts as arrived
    """
    joints = recording.joints
    inhibited = inhibitions(recording.overrides)
    swings: list[MeasuredSwing] = []
    for found in recording.bursts:
        first, last, fastest = np.searchsorted(
            joints.row, (found.first, found.last, found.fastest)
        ).tolist()
        burst = replace(found, first=first, last=last, fastest=fastest)
        plan, planned_other = plan_of(recording, burst)
        if plan is not None and not burst.armed and is_no_swing(joints, plan, burst):
            continue
        after = max((one.start for one in swings if one.commanded), default=-np.inf)
        swing = _measure(
            recording, burst, plan, inhibited, tolerance, _command(recording, burst, after)
        )
        notes = (*_notes(recording, swing, burst, planned_other), *_unknown(swing))
        swings.append(replace(swing, number=len(swings) + 1, notes=notes))
    return swings


def _command(recording: Recording, burst: Burst, after: float) -> float | None:
    """Return when a motion was commanded [s]; `after` [s] is when the swing before was."""
    if burst.begins_cut:
        return None
    time = recording.joints.time
    begin, fastest = float(time[burst.first]), float(time[burst.fastest])
    return swing_command(recording.commands, begin, fastest, after)


def _measure(
    recording: Recording,
    burst: Burst,
    plan: RecordedPlan | None,
    overridden: Sequence[InhibitionInterval],
    tolerance: float,
    command: float | None,
) -> MeasuredSwing:
    """Measure a motion that was commanded at `command` [s]; None: nobody knows when."""
    joints, muscles = recording.joints, recording.muscles
    begin, finish = float(joints.time[burst.first]), float(joints.time[burst.last])
    start = begin if command is None else command
    shown = (start - SHOWN_BEFORE_SEC, finish + SHOWN_AFTER_SEC)
    joint_series = _joints_between(joints, _piece(burst, joints, shown), start)
    muscle_series = None if muscles is None else _muscles_between(muscles, *shown, start)
    inhibited = tuple(
        InhibitionInterval(one.start - start, one.end - start, one.muscles)
        for one in within(overridden, *shown)
    )
    rejected, ended = _inhibitor_report(recording, *shown)
    return MeasuredSwing(
        source=recording.source,
        namespace=recording.namespace,
        number=1,
        method="unplanned" if plan is None else plan.method,
        start=start,
        commanded=command is not None,
        arrival=_arrival(joints, burst, plan, start, tolerance),
        tolerance=tolerance,
        rest=finish - start,
        plan=plan,
        joints=_joint_figures(joint_series, plan, finish - start),
        muscles=_muscle_figures(muscle_series, plan, inhibited, finish - start),
        joint_series=joint_series,
        muscle_series=muscle_series,
        inhibited=inhibited,
        latency=inhibition_latency(recording.overrides, muscles, *shown),
        rejected=rejected,
        ended=ended,
        faulty=_faulty(muscle_series),
        notes=(),
    )


def _piece(burst: Burst, joints: JointSeries, shown: tuple[float, float]) -> slice:
    """Return the rows around a motion whose times rise without a break."""
    time, row = joints.time, joints.row
    first, last = burst.first, burst.last
    while (
        first > 0
        and row[first - 1] == row[first] - 1
        and shown[0] <= time[first - 1] <= time[first] + STAMP_JITTER_SEC
    ):
        first -= 1
    while (
        last + 1 < time.size
        and row[last + 1] == row[last] + 1
        and time[last] - STAMP_JITTER_SEC <= time[last + 1] <= shown[1]
    ):
        last += 1
    return slice(first, last + 1)


def _joints_between(joints: JointSeries, rows: slice, start: float) -> JointSeries:
    return JointSeries(
        joints.names,
        joints.row[rows],
        frozen(joints.time[rows] - start),
        frozen(joints.position[rows]),
        frozen(joints.velocity[rows]),
    )


def _muscles_between(
    muscles: MuscleSeries, begin: float, end: float, start: float
) -> MuscleSeries | None:
    rows = np.flatnonzero((muscles.time >= begin) & (muscles.time <= end))
    if rows.size == 0:
        return None
    # Where a clock jumped back the same times come twice: the longer piece is this swing's.
    back = np.diff(muscles.time[rows]) < -STAMP_JITTER_SEC
    pieces = np.split(rows, np.flatnonzero(back) + 1)
    rows = max(pieces, key=len)
    return MuscleSeries(
        muscles.names,
        frozen(muscles.time[rows] - start),
        frozen(muscles.velocity[rows]),
        frozen(muscles.tension[rows]),
        frozen(muscles.current[rows]),
        muscles.mode[rows],
        muscles.fault[rows],
    )


def _arrival(
    joints: JointSeries, burst: Burst, plan: RecordedPlan | None, start: float, tolerance: float
) -> float:
    """Return when the arm first was near the end [s] after `start`; NaN if it was not.

    Without a plan the end is where the arm came to rest. NaN if nobody knows when the swing began.
    """
    if burst.begins_cut or (plan is None and burst.ends_cut):
        return np.nan
    names = joints.names if plan is None else plan.joint_names
    columns = [joints.names.index(name) for name in names]
    end = joints.position[burst.last, columns] if plan is None else plan.end
    rows = np.arange(burst.first, burst.last + 1)
    distance = np.linalg.norm(joints.position[rows][:, columns] - end, axis=1)
    near = rows[(distance < tolerance) & (joints.time[rows] >= start)]
    return float(joints.time[near[0]] - start) if near.size else np.nan


def _notes(
    recording: Recording, swing: MeasuredSwing, burst: Burst, planned_other: bool
) -> list[str]:
    """Return what a reader has to know of a swing; `planned_other`: its bag's plan is another's."""
    notes = []
    if burst.begins_cut:
        notes.append("half a swing: the recording begins, or has a gap, in the middle of it")
    if burst.ends_cut:
        notes.append("half a swing: the recording ends, or has a gap, before the arm rested")
    if burst.hole:
        notes.append(
            f"no joint speed is known for {burst.hole:.2f} s of it: "
            "peaks and a rest may be missed, its time may be too long"
        )
    if planned_other:
        notes.append("the plan in the bag is another swing's: nothing is predicted")
    elif swing.plan is None:
        notes.append("no plan in the bag: nothing is predicted, the end is where the arm rested")
    if not swing.commanded and not burst.begins_cut:
        notes.append("no length command before it: time counts from the first motion")
    if recording.muscles is None:
        notes.append("no muscle states in the bag: muscle speed and tension are unknown")
    if np.isnan(swing.arrival) and not (burst.ends_cut or burst.begins_cut):
        notes.append(f"the arm did not come within {swing.tolerance:g} rad of the end posture")
    return notes


def _unknown(swing: MeasuredSwing) -> list[str]:
    unknown = [one.name for one in swing.muscles if np.isnan(one.peak_speed + one.peak_tension)]
    return [f"speed or tension is unknown of {' '.join(unknown)}"] if unknown else []


def _peaks(values: Matrix) -> Vector:
    """Return the largest magnitude of each column; NaN where all are NaN or there is no row."""
    known = ~np.isnan(values)
    largest = np.max(np.abs(values), axis=0, where=known, initial=0.0)
    return np.where(known.any(axis=0), largest, np.nan)


def _joint_figures(
    joints: JointSeries, plan: RecordedPlan | None, rest: float
) -> tuple[JointFigures, ...]:
    swinging = (joints.time > 0.0) & (joints.time <= rest)
    measured = _peaks(joints.velocity[swinging])
    predicted: dict[str, float] = {}
    if plan is not None:
        peaks = _peaks(plan.joint_velocity).tolist()
        predicted = dict(zip(plan.joint_names, peaks, strict=True))
    return tuple(
        JointFigures(name, float(peak), predicted.get(name, np.nan))
        for name, peak in zip(joints.names, measured, strict=True)
    )


def _muscle_figures(
    muscles: MuscleSeries | None,
    plan: RecordedPlan | None,
    inhibited: tuple[InhibitionInterval, ...],
    rest: float,
) -> tuple[MuscleFigures, ...]:
    if muscles is None:
        return ()
    swinging = (muscles.time > 0.0) & (muscles.time <= rest)
    speeds, tensions = _peaks(muscles.velocity[swinging]), _peaks(muscles.tension[swinging])
    predicted: dict[str, tuple[float, float, bool]] = {}
    if plan is not None:
        peaks = _peaks(plan.muscle_velocity).tolist()
        rows = zip(peaks, plan.elongation.tolist(), (~plan.kept).tolist(), strict=True)
        predicted = dict(zip(plan.muscle_names, rows, strict=True))
    swing = within(inhibited, 0.0, rest)
    figures = []
    for name, speed, tension in zip(muscles.names, speeds, tensions, strict=True):
        expected, elongation, masked = predicted.get(name, (np.nan, np.nan, False))
        time = sum((one.end - one.start for one in swing if name in one.muscles), 0.0)
        figures.append(
            MuscleFigures(name, float(speed), expected, float(tension), time, elongation, masked)
        )
    return tuple(figures)


def _faulty(muscles: MuscleSeries | None) -> tuple[str, ...]:
    if muscles is None:
        return ()
    flags = np.any(muscles.fault != 0, axis=0).tolist()
    return tuple(name for name, flag in zip(muscles.names, flags, strict=True) if flag)


def _inhibitor_report(recording: Recording, begin: float, end: float) -> tuple[float, str]:
    """Return how many joint states the inhibitor rejected meanwhile, and why it disarmed.

    NaN and no reason if no status says that it was armed.
    """
    status = recording.status
    if status is None:
        return np.nan, ""
    rows = np.flatnonzero((status.time >= begin) & (status.time <= end))
    armed = rows[status.armed[rows]]
    if armed.size == 0:
        return np.nan, ""
    later = int(armed[-1]) + np.flatnonzero(~status.armed[armed[-1] :])
    ended = status.reason[later[0]] if later.size else ""
    return float(status.rejected[armed].max()), ended
