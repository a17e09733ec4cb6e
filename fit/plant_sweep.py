"""Peak speeds of both methods against the friction and inertia of the winches.

The paper conjectures that with less back-drivability Method 1 can be worse than Method 2.
"""

from collections.abc import Mapping
from dataclasses import replace

import matplotlib as mpl
import numpy as np
from kinematic_fit import REPOSITORY
from matplotlib import pyplot as plt
from numpy.typing import NDArray
from robot_targets import swing_outcome

from fastswing_planner.execution.settings import ExecutionSettings
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot

IMAGE = REPOSITORY / "docs/images/back_drivability.png"
FRICTION = np.array([1.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0, 100.0])
"""[N] Coulomb friction of a winch."""
MASS = np.array([0.5, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0])
"""[kg] inertia of a winch, at the wire."""
_SETTINGS = ExecutionSettings(swing_limit=1.5, recover_time=0.01)

Matrix = NDArray[np.float64]


def draw_sweep(robot: Robot, plans: Mapping[Method, SwingPlan]) -> str:
    """Draw the sweep into docs/images and return what it shows in a sentence."""
    mpl.use("Agg")
    inhibit = swept_speeds(robot, plans[Method.INHIBIT])
    # A driven winch feels neither: Method 2 does not depend on them.
    elongate = _peak(robot, plans[Method.ELONGATE])
    figure, axis = plt.subplots(figsize=(7.2, 4.8))
    shades = axis.contourf(FRICTION, MASS, inhibit, levels=14, cmap="viridis")
    figure.colorbar(shades, label="Method 1: peak E-p speed [rad/s]")
    level = axis.contour(FRICTION, MASS, inhibit, levels=[elongate], colors="white")
    axis.clabel(level, fmt=f"Method 2: {elongate:.2f} rad/s")
    plant = robot.plant
    axis.plot(plant["winch_friction"], plant["winch_mass"], "w*", markersize=14)
    axis.set_xlabel("friction of a winch [N]")
    axis.set_ylabel("inertia of a winch, at the wire [kg]")
    axis.set_title("Beyond the white line Method 2 is faster (star: the emulated arm)")
    figure.tight_layout()
    figure.savefig(IMAGE, dpi=130)
    return _sentence(robot, inhibit, elongate)


def swept_speeds(robot: Robot, plan: SwingPlan) -> Matrix:
    """Return peak E-p speeds [rad/s], shape (masses, frictions)."""
    rows = []
    for mass in MASS:
        winches = [{"winch_friction": float(f), "winch_mass": float(mass)} for f in FRICTION]
        arms = [replace(robot, plant={**robot.plant, **winch}) for winch in winches]
        rows.append([_peak(arm, plan) for arm in arms])
    return np.array(rows)


def _peak(robot: Robot, plan: SwingPlan) -> float:
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    arm = replace(robot, postures={**robot.postures, "home": robot.postures["start"]})
    return swing_outcome(arm, planner, plan, _SETTINGS).elbow_speed


def _sentence(robot: Robot, inhibit: Matrix, elongate: float) -> str:
    plant = robot.plant
    row = int(np.abs(MASS - plant["winch_mass"]).argmin())
    column = int(np.abs(FRICTION - plant["winch_friction"]).argmin())
    friction = _crossing(FRICTION, inhibit[row], elongate)
    mass = _crossing(MASS, inhibit[:, column], elongate)
    return (
        f"Method 2 ({elongate:.2f} rad/s) overtakes Method 1 at "
        f"{_said(friction, FRICTION, 'N')} of friction (inertia {MASS[row]:g} kg), "
        f"and at {_said(mass, MASS, 'kg')} of inertia "
        f"(friction {FRICTION[column]:g} N)"
    )


def _said(place: float, places: NDArray[np.float64], unit: str) -> str:
    return f"more than {places[-1]:g} {unit}" if np.isnan(place) else f"{place:.0f} {unit}"


def _crossing(places: NDArray[np.float64], speeds: NDArray[np.float64], level: float) -> float:
    """Return where falling speeds cross the level; NaN if they do not."""
    below = np.flatnonzero(speeds < level)
    if not below.size or below[0] == 0:
        return np.nan
    index = int(below[0])
    share = (speeds[index - 1] - level) / (speeds[index - 1] - speeds[index])
    return float(places[index - 1] + share * (places[index] - places[index - 1]))
