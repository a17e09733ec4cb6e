"""How much faster than real time the loop without ROS runs, and how that grows with the arm."""

import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
from growth_picture import draw
from limbed_arm import write_limbed_arm
from rounds import Row, Samples, in_turns, row

from fastswing_planner.execution.settings import ExecutionSettings
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, SwingRequest
from fastswing_planner.qp.solvers import solver_from
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.buses.protocol import Mode, WatchdogAction
from musashi_muscle_bridge.control.command_limits import command_limits
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.emulation.plant import arm_mjcf
from musashi_muscle_bridge.simulation.closed_loop import ClosedLoop

QUESTION = "How much faster than real time is the loop without ROS at 1 kHz, and with larger arms?"
RATE = 1000.0  # [Hz]
MOST_MS = 50.0
"""[ms] for a second of the arm: 20 times real time."""
SIZES = ((10, 5), (20, 5), (40, 5), (74, 5), (74, 33))
ALONE = "MuJoCo alone"


def run(scale: float, plots: Path | None = None) -> list[Row]:
    """Measure; 1.0 takes about two minutes."""
    robot = load_robot(MUSASHI)
    rounds = max(1, round(10 * scale))
    rows = _swing_rows(robot, rounds)
    grown: dict[str, list[tuple[float, float]]] = {"frames, boards and arm": [], ALONE: []}
    with tempfile.TemporaryDirectory() as folder:
        for muscles, joints in SIZES if scale >= 0.1 else SIZES[:1]:
            arm = load_robot(write_limbed_arm(Path(folder), muscles, joints))
            found = in_turns(
                {"periods": partial(held, arm, 0.2), ALONE: partial(alone, arm, 0.2)},
                max(2, rounds),
            )
            title = f"frames, boards and arm, {muscles} muscles, {joints} joints"
            rows.append(_told(row(title, found["periods"], against=(ALONE, found[ALONE]))))
            if joints == SIZES[0][1]:
                for name, samples in zip(grown, found.values(), strict=True):
                    cost = float(np.median(np.concatenate(samples)))
                    grown[name].append((muscles, cost * 1e3))
    if plots is not None:
        panels = {f"muscles, {SIZES[0][1]} joints": grown}
        draw(panels, "wall time for a second [ms]", plots / "performance_headless.png")
    return rows


def _swing_rows(robot: Robot, rounds: int) -> list[Row]:
    planner = SwingPlanner(robot.model, robot.limits, solver_from("daqp"))
    rows = []
    for method in (Method.BASIC, Method.INHIBIT, Method.ELONGATE):
        plan = planner.plan(SwingRequest(robot.postures["start"], robot.postures["end"], method))
        found = in_turns(
            {
                "loop": partial(swung, robot, planner, plan),
                ALONE: partial(alone, robot, 1.0),
            },
            rounds,
        )
        title = f"a whole swing, {method.name.lower()}"
        against = (ALONE, found[ALONE])
        rows.append(_told(row(title, found["loop"], against=against, at_most=MOST_MS)))
    return rows


def _told(one: Row) -> Row:
    """Return the row with its real-time factor as a note."""
    return replace(one, note=f"{1e3 / one.median:.1f} times real time")


def swung(robot: Robot, planner: SwingPlanner, plan: SwingPlan) -> list[float]:
    """Swing; returns the wall time for each second of the arm [s]."""
    loop = ClosedLoop(robot, planner, RATE)
    begin = time.perf_counter()
    loop.run(plan, ExecutionSettings())
    return [(time.perf_counter() - begin) / (len(loop.samples) / RATE)]


def held(robot: Robot, seconds: float) -> Samples:
    """Exchange frames with boards that hold their lengths; wall time per second of the arm [s]."""
    boards = Boards(robot)
    limits = command_limits(robot, 0.1, 0.2, 0.2)
    control = ControlPeriod(robot, limits, WatchdogAction.ZERO_CURRENT, 0.1)
    state = boards.handle(control.first_command())
    lengths = state.rows["length"].astype(float)
    control.arbiter.command(Mode.LENGTH, slice(None), lengths, 0.0)
    begin = time.perf_counter()
    for step in range(round(seconds * RATE)):
        boards.advance(1.0 / RATE)
        state = boards.handle(control.next_command(state, (step + 1) / RATE))
    return np.array([(time.perf_counter() - begin) / seconds])


def alone(robot: Robot, seconds: float) -> Samples:
    """Let MuJoCo step the same arm with slack wires; wall time per second of the arm [s]."""
    model = arm_mjcf(robot)
    data = mujoco.MjData(model)
    data.qpos[:] = robot.model.full_position(robot.postures["home"])
    steps = round(seconds / model.opt.timestep)
    begin = time.perf_counter()
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return np.array([(time.perf_counter() - begin) / seconds])
