"""Measured and predicted figures of a swing to their message."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastswing_msgs.msg import SwingFigures
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_planner.arrays import Matrix
from fastswing_planner.errors import WrongLength
from fastswing_planner.execution.figures import SwingFigures as Figures


def predicted_figures(message: SwingPlanMessage) -> SwingFigures:
    """Return a plan's figures in the form of the measured ones; raises WrongLength."""
    trajectory = message.trajectory
    steps, joints, muscles = (
        len(names)
        for names in (trajectory.time_from_start, message.joint_name, message.muscle_name)
    )
    if not steps:
        raise WrongLength("the plan's trajectory has no step")
    return SwingFigures(
        peak_joint_velocity=_peaks(table(trajectory.joint_velocity, steps, joints)),
        time_cost=message.time_cost,
        peak_muscle_velocity=_peaks(table(trajectory.muscle_velocity, steps, muscles)),
        peak_tension=[float("nan")] * muscles,
    )


def figures_to_message(figures: Figures) -> SwingFigures:
    """Return the message of measured figures."""
    return SwingFigures(
        peak_joint_velocity=figures.peak_joint_velocity.tolist(),
        time_cost=figures.time_cost,
        peak_muscle_velocity=figures.peak_muscle_velocity.tolist(),
        peak_tension=figures.peak_tension.tolist(),
    )


def table(numbers: Sequence[float], steps: int, width: int) -> NDArray[Any]:
    """Return a table of a trajectory's message, shape (steps, width); raises WrongLength."""
    if len(numbers) != steps * width:
        raise WrongLength(
            f"a table of the plan's trajectory has {len(numbers)} values, expected {width} for "
            f"each of {steps} steps"
        )
    return np.reshape(numbers, (steps, width))


def _peaks(values: Matrix) -> list[float]:
    return [float(peak) for peak in np.abs(values).max(axis=0)]
