"""Fit 2: makes the emulated arm swing as the paper's real robot does.

Changes the physical constants of `plant_parameters.py` within their ranges until the loop without
ROS (`closed_loop.py`) shows the robot's speeds and tensions, writes them into the description, and
draws what both methods owe to the winches. Run it again with `python fit/plant_fit.py`; an
interrupted run goes on where it stopped, `--restart` begins anew.
"""

import argparse
import hashlib
import json
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from evolution import Fitted, Vector, evolve
from kinematic_fit import OUT, ROBOT_MJCF, ROBOT_YAML
from plant_parameters import PARAMETERS, candidate_robot, edited_mjcf, edited_yaml, values_of
from plant_sweep import draw_sweep
from robot_targets import PEAK, TENSION, Outcome, cost, swing_outcome

from fastswing_planner.errors import SwingAborted
from fastswing_planner.execution.settings import ExecutionSettings
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, SwingRequest
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot, load_robot

SIGMA = 0.05
"""First standard deviation; the ranges of the parameters are -1 to 1."""
NEARNESS = 0.05
"""Weight of the mean squared distance from the middle of the ranges."""
NEVER_BEGUN = 1e4
"""Cost of an arm that does not come to rest in the start posture."""
HASTY = ExecutionSettings(
    rest_time=0.1, rest_speed=0.2, settle_limit=1.5, swing_limit=1.2, recover_time=0.01
)
"""Every candidate begins in the start posture and is watched no longer than needed."""


def main() -> None:
    """Fit, write the description, and say how near it came."""
    arguments = _arguments()
    OUT.mkdir(parents=True, exist_ok=True)
    state_file = OUT / f"plant_fit_seed_{arguments.seed}_{description_digest()}.pickle"
    if arguments.restart:
        state_file.unlink(missing_ok=True)
    robot = load_robot(ROBOT_YAML)
    with tempfile.TemporaryDirectory() as folder:
        judge = candidate_cost(robot, ROBOT_MJCF.read_text(), Path(folder))
        first = first_guess()
        fitted = evolve(judge, first, SIGMA, state_file, arguments.seed, arguments.generations)
    write_description(values_of(fitted.best))
    robot = load_robot(ROBOT_YAML)
    outcomes = full_outcomes(robot)
    summary = summarise(robot, fitted, outcomes)
    (OUT / "plant_summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    for line in report_lines(outcomes):
        print(line)
    print(draw_sweep(robot, planned(robot)))
    print(f"written: {ROBOT_MJCF.name}, {ROBOT_YAML.name}, out/fit/plant_summary.json")


def first_guess() -> Vector:
    """Return where every fit begins, from -1 to 1 within the ranges, shape (parameters,)."""
    low, high, initial = (
        np.array([getattr(parameter, name) for parameter in PARAMETERS])
        for name in ("low", "high", "initial")
    )
    return 2.0 * np.log(initial / low) / np.log(high / low) - 1.0


def planned(robot: Robot) -> dict[Method, SwingPlan]:
    """Return the three swings' plans; they do not depend on the plant."""
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    start, end = robot.postures["start"], robot.postures["end"]
    return {method: planner.plan(SwingRequest(start, end, method)) for method in PEAK}


def candidate_cost(robot: Robot, mjcf_text: str, folder: Path) -> Callable[[Vector], float]:
    """Return the function to minimise: coordinates of shape (parameters,) to a cost."""
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    plans = planned(robot)

    def judge(unit: Vector) -> float:
        plausibility = NEARNESS * float(np.mean(unit**2))
        arm = begun_at_start(candidate_robot(robot, mjcf_text, values_of(unit).tolist(), folder))
        try:
            outcomes = {m: swing_outcome(arm, planner, p, HASTY) for m, p in plans.items()}
        except SwingAborted:
            return NEVER_BEGUN + plausibility
        return cost(outcomes, robot.model.muscle_names) + plausibility

    return judge


def begun_at_start(robot: Robot) -> Robot:
    """Return the robot whose emulated arm begins in the start posture: no need to raise it."""
    return replace(robot, postures={**robot.postures, "home": robot.postures["start"]})


def full_outcomes(robot: Robot) -> dict[Method, Outcome]:
    """Return what the three swings do, raised from home as the executor raises them."""
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    settings = ExecutionSettings()
    return {m: swing_outcome(robot, planner, p, settings) for m, p in planned(robot).items()}


def description_digest() -> str:
    """Return a digest of all that the fit builds on: another arm begins a fit of its own."""
    guess = values_of(first_guess()).tolist()
    texts = (
        edited_mjcf(ROBOT_MJCF.read_text(), guess),
        edited_yaml(ROBOT_YAML.read_text(), guess),
    )
    return hashlib.sha256("".join(texts).encode()).hexdigest()[:8]


def write_description(values: Vector) -> None:
    """Write the constants into MJCF and YAML, each file replaced in one step."""
    for path, edit in ((ROBOT_MJCF, edited_mjcf), (ROBOT_YAML, edited_yaml)):
        part = path.with_suffix(f".part{path.suffix}")
        part.write_text(edit(path.read_text(), values.tolist()))
        part.replace(path)


def summarise(
    robot: Robot, fitted: Fitted, outcomes: Mapping[Method, Outcome]
) -> dict[str, object]:
    """Return what was fitted and what the written description does."""
    names = robot.model.muscle_names
    constants = zip(PARAMETERS, values_of(fitted.best).tolist(), strict=True)
    return {
        "generations": fitted.generation,
        "cost": fitted.best_cost,
        "constants": {parameter.label: value for parameter, value in constants},
        "swings": {
            method.name.lower(): {
                "peak_elbow_speed_rad_per_s": round(outcome.elbow_speed, 3),
                "largest_tension_N": round(float(outcome.tension.max()), 1),
                "time_cost_s": round(outcome.time_cost, 3),
                "inhibited_tension_N": round(outcome.inhibited_tension, 1),
                "joint_speed_rad_per_s": outcome.joint_speed.round(2).tolist(),
                "tension_N": dict(zip(names, outcome.tension.round(0).tolist(), strict=True)),
                "payout_speed_m_per_s": dict(
                    zip(names, outcome.muscle_speed.round(3).tolist(), strict=True)
                ),
            }
            for method, outcome in outcomes.items()
        },
    }


def report_lines(outcomes: Mapping[Method, Outcome]) -> list[str]:
    """Return the table of what the paper's robot did beside what the emulated arm does."""
    lines = ["method    peak E-p [rad/s] (robot)  largest tension [N] (robot)"]
    for method, outcome in outcomes.items():
        lines.append(
            f"{method.name.lower():<10}{outcome.elbow_speed:>8.2f} ({PEAK[method]})"
            f"{outcome.tension.max():>22.0f} ({TENSION[method]:.0f})"
        )
    return lines


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Fit the emulated arm to the paper's robot.")
    parser.add_argument("--generations", type=int, default=12, help="default: %(default)s")
    parser.add_argument("--seed", type=int, default=2, help="default: %(default)s")
    parser.add_argument("--restart", action="store_true", help="forget a saved state")
    return parser.parse_args()


if __name__ == "__main__":
    main()
