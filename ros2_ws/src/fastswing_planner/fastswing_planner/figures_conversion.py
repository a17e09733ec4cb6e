"""Measured and predicted figures of a swing to their message."""

from collections.abc import Sequence

import numpy as np

from fastswing_msgs.msg import SwingFigures
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_planner.arrays import Matrix
from fastswing_planner.figures import SwingFigures as Figures


def predicted_figures(message: SwingPlanMessage) -> SwingFigures:
    """Return a plan's figures in the form of the measured ones."""
    trajectory = message.trajectory
    return SwingFigures(
        peak_joint_velocity=_peaks(table(trajectory.joint_velocity, len(message.joint_name))),
        time_cost=message.time_cost,
        peak_muscle_velocity=_peaks(table(trajectory.muscle_velocity, len(message.muscle_name))),
        peak_tension=[float("nan")] * len(message.muscle_name),
    )


def figures_to_message(figures: Figures) -> SwingFigures:
    """Return the message of measured figures."""
    return SwingFigures(
        peak_joint_velocity=figures.peak_joint_velocity.tolist(),
        time_cost=figures.time_cost,
        peak_muscle_velocity=figures.peak_muscle_velocity.tolist(),
        peak_tension=figures.peak_tension.tolist(),
    )


def table(numbers: Sequence[float], width: int) -> Matrix:
    """Return a table of a trajectory's message, shape (k + 1, width); raises ValueError."""
    return np.reshape(numbers, (-1, width))


def _peaks(values: Matrix) -> list[float]:
    return [float(peak) for peak in np.abs(values).max(axis=0)]
