"""`analyse` against the executor's own figures of the same swing: no ROS, no noise, no chance."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from made_up_recording import searched

from fastswing_planner.analysis.finding import fastest_joint_speed
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.measuring import measure_swings
from fastswing_planner.analysis.recording import (
    CommandSeries,
    JointSeries,
    JointSpeed,
    MuscleSeries,
    RecordedPlan,
    Recording,
)
from fastswing_planner.execution.figures import SwingFigures
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, SwingRequest
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.simulation.closed_loop import ClosedLoop, Sample

RATE = 500.0
PERIOD = 1.0 / RATE
SETTINGS = ExecutionSettings()
Swing = tuple[SwingPlan, SwingFigures, MeasuredSwing]


def recorded_plan(plan: SwingPlan) -> RecordedPlan:
    return RecordedPlan(
        0.0,
        plan.method.name.lower(),
        plan.joint_names,
        plan.start,
        plan.end,
        plan.muscle_names,
        plan.kept,
        plan.inhibited,
        plan.elongation,
        plan.speed_index,
        plan.time_cost,
        plan.trajectory.time,
        plan.trajectory.joint_velocity,
        plan.trajectory.muscle_velocity,
    )


def recording(robot: Robot, plan: SwingPlan, samples: list[Sample]) -> Recording:
    time = np.array([sample.time for sample in samples])
    joints = {
        name: np.array([sample.state.joints[name] for sample in samples], dtype=float)
        for name in ("position", "velocity")
    }
    rows = {
        name: np.array([sample.state.rows[name] for sample in samples])
        for name in ("velocity", "tension", "current", "mode", "fault")
    }
    # The executor's step is made after the last sample before the phase changes.
    command = next(before.time for before, after in pairwise(samples) if after.phase is Phase.SWING)
    return Recording(
        source="simulated",
        namespace="",
        speed=JointSpeed(time, fastest_joint_speed(joints["velocity"])),
        joints=JointSeries(
            robot.model.joint_names,
            np.arange(time.size),
            time,
            joints["position"],
            joints["velocity"],
        ),
        muscles=MuscleSeries(
            robot.model.muscle_names,
            time,
            rows["velocity"].astype(float),
            rows["tension"].astype(float),
            rows["current"].astype(float),
            rows["mode"],
            rows["fault"],
        ),
        commands=CommandSeries(np.array([command]), np.array([0.1])),
        plans=(recorded_plan(plan),),
    )


@pytest.fixture(scope="module")
def swing_by() -> Callable[[Method], Swing]:
    robot = load_robot(MUSASHI)
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())

    def swing(method: Method) -> Swing:
        request = SwingRequest(robot.postures["start"], robot.postures["end"], method)
        plan = planner.plan(request)
        loop = ClosedLoop(robot, planner, RATE)
        figures = loop.run(plan, SETTINGS)
        found = measure_swings(searched(recording(robot, plan, loop.samples)))
        assert len(found) == 1
        return plan, figures, found[0]

    return swing


@pytest.mark.parametrize("method", list(Method))
def test_one_swing_is_found_with_the_executors_figures(
    method: Method, swing_by: Callable[[Method], Swing]
) -> None:
    plan, figures, swing = swing_by(method)
    assert swing.notes == ()
    assert swing.method == method.name.lower()
    assert swing.arrival == pytest.approx(figures.time_cost, abs=1.5 * PERIOD)
    speeds = [joint.peak_speed for joint in swing.joints]
    assert speeds == pytest.approx(figures.peak_joint_velocity.tolist(), rel=1e-6)
    muscle_speeds = [muscle.peak_speed for muscle in swing.muscles]
    assert muscle_speeds == pytest.approx(figures.peak_muscle_velocity.tolist(), rel=1e-6)
    tensions = [muscle.peak_tension for muscle in swing.muscles]
    assert tensions == pytest.approx(figures.peak_tension.tolist(), rel=1e-6)
    assert swing.predicted_time == plan.time_cost
