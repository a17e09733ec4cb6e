"""What the paper measured on its robot, and how far the emulated arm is from it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.errors import SwingAborted
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import Mode
from musashi_muscle_bridge.simulation.closed_loop import ClosedLoop

Vector = NDArray[np.float64]

PEAK = {Method.BASIC: 2.6, Method.INHIBIT: 3.7, Method.ELONGATE: 3.4}
"""Largest |E-p| speed [rad/s] of the paper's robot."""
TENSION = {Method.BASIC: 290.0, Method.INHIBIT: 180.0, Method.ELONGATE: 140.0}
"""Largest tension [N]."""
SPEED_TOLERANCE, TENSION_TOLERANCE = 0.05, 0.15
"""Share of the target that counts as met."""
LIMIT = 0.30
"""[m/s]"""
INHIBITED_TENSION = 20.0
"""[N] our reading of "almost no muscle tension was observed", after the first 0.1 s."""


@dataclass(frozen=True)
class Outcome:
    """What the emulated arm did in one swing; vectors of shape (n,) or (m,).

    elbow_speed        [rad/s] largest |E-p| speed
    joint_speed        [rad/s] largest speeds
    muscle_speed       [m/s] largest payout speeds
    tension            [N] largest tensions
    inhibited_tension  [N] largest tension at zero current, after the first 0.1 s; 0 if never
    time_cost          [s]
    """

    elbow_speed: float
    joint_speed: Vector
    muscle_speed: Vector
    tension: Vector
    inhibited_tension: float
    time_cost: float


def swing_outcome(
    robot: Robot,
    planner: SwingPlanner,
    plan: SwingPlan,
    settings: ExecutionSettings,
    rate: float = 1000.0,
) -> Outcome:
    """Carry out a plan on the emulated arm, at a control rate [Hz].

    A swing that does not arrive has a time_cost of NaN; raises SwingAborted if it never begins.
    """
    loop = ClosedLoop(robot, planner, rate)
    time_cost = np.nan
    try:
        time_cost = loop.run(plan, settings).time_cost
    except SwingAborted:
        if loop.samples[-1].phase < Phase.SWING:
            raise
    swing = [sample for sample in loop.samples if sample.phase is Phase.SWING]
    rows = np.array([sample.state.rows for sample in swing])
    joints = np.array([sample.state.joints["velocity"] for sample in swing])
    late = np.array([sample.time for sample in swing]) > swing[0].time + 0.1
    limp = (rows["mode"] == int(Mode.ZERO_CURRENT)) & late[:, None]
    joint_speed = np.abs(joints).max(axis=0).astype(float)
    return Outcome(
        elbow_speed=float(joint_speed[robot.model.joint_names.index("E-p")]),
        joint_speed=joint_speed,
        muscle_speed=rows["velocity"].max(axis=0).astype(float),
        tension=rows["tension"].max(axis=0).astype(float),
        inhibited_tension=float(rows["tension"][limp].max(initial=0.0)),
        time_cost=time_cost,
    )


def cost(outcomes: Mapping[Method, Outcome], names: tuple[str, ...]) -> float:
    """Return how far the outcomes are from the paper, without unit.

    Leaving a tolerance costs most; within it the middle and a calm arm are preferred.

    names  of the muscles
    """
    terms: list[float] = []
    for method, outcome in outcomes.items():
        speed = float(np.log(outcome.elbow_speed / PEAK[method]))
        tension = float(np.log(outcome.tension.max() / TENSION[method]))
        terms += [speed / 0.1, tension / 0.3]
        terms.append(_above(abs(speed), 0.7 * SPEED_TOLERANCE, 0.008))
        terms.append(_above(abs(tension), 0.75 * TENSION_TOLERANCE, 0.015))
        # S-p moves, E-p swings; nothing asks S-r, S-y and E-y to.
        terms += [_above(float(speed), 0.9, 0.8) for speed in outcome.joint_speed[[1, 2, 4]]]
        terms.append(0.0 if np.isfinite(outcome.time_cost) else 10.0)
    basic, inhibit = outcomes[Method.BASIC], outcomes[Method.INHIBIT]
    for muscle in (names.index("#9"), names.index("#10")):
        terms.append(_above(LIMIT - float(basic.muscle_speed[muscle]), 0.001, 0.005))
        terms.append(_above(1.1 * LIMIT - float(inhibit.muscle_speed[muscle]), 0.0, 0.01))
    terms.append(_above(inhibit.inhibited_tension, 0.85 * INHIBITED_TENSION, 1.0))
    return float(np.square(terms).sum())


def _above(value: float, most: float, scale: float) -> float:
    return max(0.0, value - most) / scale
