"""Fit 1: makes the Musashi-like arm swing as the paper's simulation does.

Changes via points, wrapping radii and the start and end postures until the planner's own
simulation (QP 2) shows the paper's peak speeds and time costs, and writes them into the
description. Run it again with `python fit/kinematic_fit.py`; an interrupted run goes on where it
stopped, a finished one ends at once, `--restart` begins anew.
"""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from arm_parameters import PARAMETERS, edited_mjcf, edited_yaml, values_of
from evolution import Fitted, Vector, evolve
from swing_targets import (
    ELBOW_PITCH,
    EPSILON,
    JOINTS,
    MUSCLES,
    PEAK,
    STEPS,
    Arm,
    arrival_steps,
    cost,
    kept,
    peak_elbow_speed,
    stiffness_eigenvalues,
    travel_arms,
)

from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, SwingRequest
from fastswing_planner.planning.swing import SwingSettings
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.mujoco_model import MujocoMuscleModel

REPOSITORY = Path(__file__).resolve().parents[1]
DESCRIPTION = REPOSITORY / "ros2_ws/src/musashi_muscle_bridge/description"
ROBOT_YAML = DESCRIPTION / "musashi_left_arm.yaml"
ROBOT_MJCF = DESCRIPTION / "musashi_left_arm.xml"
OUT = REPOSITORY / "out/fit"

SIGMA = 0.25
"""First standard deviation, in units of the parameters' spans."""
NEARNESS = 0.3
"""Weight of the mean squared distance from the initial parameters, in spans."""


def main() -> None:
    """Fit, write the description, and say how near it came."""
    arguments = _arguments()
    OUT.mkdir(parents=True, exist_ok=True)
    state_file = OUT / f"kinematic_fit_seed_{arguments.seed}.pickle"
    if arguments.restart:
        state_file.unlink(missing_ok=True)
    judge = candidate_cost(load_robot(ROBOT_YAML), ROBOT_MJCF.read_text())
    first = np.zeros(len(PARAMETERS))
    fitted = evolve(judge, first, SIGMA, state_file, arguments.seed, arguments.generations)
    write_description(values_of(fitted.best))
    summary = summarise(load_robot(ROBOT_YAML), fitted, arguments.seed)
    (OUT / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    for line in report_lines(summary["reached"]):
        print(line)
    print(f"written: {ROBOT_MJCF.name}, {ROBOT_YAML.name}, out/fit/summary.json")


def candidate_cost(robot: Robot, mjcf_text: str) -> Callable[[Vector], float]:
    """Return the function to minimise: x in spans, shape (n,), to a cost without unit."""

    def judge(unit: Vector) -> float:
        plausibility = NEARNESS * float(np.mean(unit**2))
        return cost(candidate_arm(robot, mjcf_text, values_of(unit))) + plausibility

    return judge


def candidate_arm(robot: Robot, mjcf_text: str, values: Vector) -> Arm:
    """Return the arm with these parameters."""
    postures = {"start": np.zeros(len(JOINTS)), "end": np.zeros(len(JOINTS))}
    for parameter, value in zip(PARAMETERS, values, strict=True):
        if parameter.attribute == "posture":
            postures[parameter.element][parameter.index] = round(value, 4)
    mjcf = mujoco.MjModel.from_xml_string(edited_mjcf(mjcf_text, list(values)))
    return Arm(
        model=MujocoMuscleModel(mjcf, JOINTS, MUSCLES),
        limits=robot.limits,
        **postures,
    )


def write_description(values: Vector) -> None:
    """Write the parameters into MJCF and YAML, each file replaced in one step."""
    for path, edit in ((ROBOT_MJCF, edited_mjcf), (ROBOT_YAML, edited_yaml)):
        part = path.with_suffix(f".part{path.suffix}")
        part.write_text(edit(path.read_text(), list(values)))
        part.replace(path)


def summarise(robot: Robot, fitted: Fitted, seed: int) -> dict[str, dict[str, Any]]:
    """Return what was fitted and what the written description reaches, through the planner."""
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    plans = {method: _plan(planner, robot, method) for method in PEAK}
    return {
        "fit": {
            "seed": seed,
            "generations": fitted.generation,
            "cost": fitted.best_cost,
            "epsilon_rad": EPSILON,
            "parameters": _parameter_table(values_of(fitted.best)),
        },
        "reached": {
            **{method.name.lower(): _swing_figures(plan) for method, plan in plans.items()},
            "speed_index_s_per_rad": _rounded(MUSCLES, plans[Method.BASIC].speed_index),
            "greedy": _trials(plans[Method.ELONGATE]),
            "holding": _holding_figures(robot, planner),
            "moment_arm_range_m_per_rad": _arm_ranges(robot),
        },
    }


def report_lines(reached: dict[str, Any]) -> list[str]:
    """Return the table of what the paper prints beside what the written arm reaches."""
    lines = ["method    peak E-p [rad/s] (paper)  steps (paper)  masked"]
    for method in PEAK:
        row = reached[method.name.lower()]
        lines.append(
            f"{method.name.lower():<10}{row['peak_rad_per_s']:>8.3f} ({row['peak_paper']})"
            f"{row['steps']:>16} ({row['steps_paper']})     {' '.join(row['masked']) or '-'}"
        )
    return lines


def _plan(planner: SwingPlanner, robot: Robot, method: Method) -> SwingPlan:
    settings = SwingSettings(epsilon=EPSILON)
    start, end = robot.postures["start"], robot.postures["end"]
    return planner.plan(SwingRequest(start, end, method, settings=settings))


def _rounded(names: tuple[str, ...], values: Vector, digits: int = 4) -> dict[str, float]:
    return {name: round(float(value), digits) for name, value in zip(names, values, strict=True)}


def _parameter_table(values: Vector) -> dict[str, dict[str, float]]:
    return {
        parameter.label: {"initial": parameter.initial, "fitted": round(float(value), 5)}
        for parameter, value in zip(PARAMETERS, values, strict=True)
    }


def _swing_figures(plan: SwingPlan) -> dict[str, object]:
    trajectory = plan.trajectory
    peak = peak_elbow_speed(trajectory)
    return {
        "peak_rad_per_s": round(peak, 4),
        "peak_paper": PEAK[plan.method],
        "peak_error_percent": round(100 * (peak / PEAK[plan.method] - 1), 2),
        "steps": trajectory.time.size - 1,
        "steps_paper": STEPS[plan.method],
        "arrival_steps": round(arrival_steps(trajectory, plan.end), 2),
        "masked": [name for name, stays in zip(MUSCLES, plan.kept, strict=True) if not stays],
        "elongation_m": _rounded(MUSCLES, plan.elongation),
        "joint_min_rad": _rounded(JOINTS, trajectory.joint_position.min(axis=0)),
        "joint_max_rad": _rounded(JOINTS, trajectory.joint_position.max(axis=0)),
    }


def _trials(plan: SwingPlan) -> list[dict[str, object]]:
    return [
        {
            "masked": [name for name, stays in zip(MUSCLES, t.kept, strict=True) if not stays],
            "verdict": t.verdict.value,
            "missing_torque_N_m": round(t.holding_residual, 4),
            "time_cost_s": None if np.isnan(t.time_cost) else round(t.time_cost, 2),
        }
        for t in plan.trials
    ]


def _holding_figures(robot: Robot, planner: SwingPlanner) -> dict[str, object]:
    start, end = robot.postures["start"], robot.postures["end"]
    arm = Arm(robot.model, robot.limits, start, end)
    figures: dict[str, object] = {}
    for name, posture in robot.postures.items():
        tension = planner.hold(posture).tension
        figures[name] = {
            "tension_N": _rounded(MUSCLES, tension, 1),
            "stiffness_eigenvalues_N_m_per_rad": [
                round(float(x), 2) for x in stiffness_eigenvalues(arm, posture, tension)
            ],
        }
    without_9 = planner.hold(start, kept=kept("#9"))
    figures["start without #9"] = {"tension_N": _rounded(MUSCLES, without_9.tension, 1)}
    without_both = planner.hold(start, kept=kept("#9", "#10"))
    figures["start without #9 and #10"] = {"missing_torque_N_m": round(without_both.residual, 3)}
    line = [planner.hold(part * start) for part in np.linspace(0, 1, 41)]
    figures["line from home to start"] = {
        "feasible": all(holding.feasible for holding in line),
        "largest_tension_N": round(max(float(holding.tension.max()) for holding in line), 1),
    }
    return figures


def _arm_ranges(robot: Robot) -> dict[str, dict[str, list[float]]]:
    arms = travel_arms(robot.model, robot.postures["start"], robot.postures["end"])
    return {
        name: {
            joint: [
                round(float(arms[:, row, column].min()), 4),
                round(float(arms[:, row, column].max()), 4),
            ]
            for joint, column in (("S-p", 0), ("E-p", ELBOW_PITCH))
        }
        for row, name in enumerate(MUSCLES)
    }


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Fit the Musashi-like arm to the paper's figures.")
    parser.add_argument("--generations", type=int, default=400, help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=2, help="default: %(default)s")
    parser.add_argument("--restart", action="store_true", help="forget a saved state")
    return parser.parse_args()


if __name__ == "__main__":
    main()
