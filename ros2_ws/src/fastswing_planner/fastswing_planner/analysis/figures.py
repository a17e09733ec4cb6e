"""The figures of a swing by name: what tables, comparisons and checks have in common."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fastswing_planner.analysis.measured_swing import MeasuredSwing


@dataclass(frozen=True)
class Figure:
    """One number of a swing.

    title     for people
    unit      as printed
    decimals  as printed
    of        returns it; NaN: unknown
    """

    title: str
    unit: str
    decimals: int
    of: Callable[[MeasuredSwing], float]

    def text(self, value: float) -> str:
        """Return a value as it is printed, without its unit; '–' for an unknown one."""
        return f"{value:.{self.decimals}f}" if np.isfinite(value) else "–"


def _over_predicted(swing: MeasuredSwing) -> float:
    return swing.arrival / swing.predicted_time if swing.predicted_time > 0.0 else np.nan


def _largest(parts: str, figure: str) -> Callable[[MeasuredSwing], float]:
    """Return what takes the largest of all joints or muscles; one that is unknown may be it."""

    def of(swing: MeasuredSwing) -> float:
        values = [float(getattr(part, figure)) for part in getattr(swing, parts)]
        return float(np.max(values)) if values else np.nan

    return of


FIGURES: Mapping[str, Figure] = {
    "main_joint_speed": Figure(
        "peak speed of the main joint", "rad/s", 2, lambda swing: swing.main_joint.peak_speed
    ),
    "predicted_main_joint_speed": Figure(
        "predicted peak speed of the main joint",
        "rad/s",
        2,
        lambda swing: swing.main_joint.predicted_peak_speed,
    ),
    "joint_speed": Figure("peak speed of any joint", "rad/s", 2, _largest("joints", "peak_speed")),
    "time": Figure("time to the end posture", "s", 3, lambda swing: swing.arrival),
    "predicted_time": Figure("predicted time", "s", 2, lambda swing: swing.predicted_time),
    "time_over_predicted": Figure("time / predicted time", "", 2, _over_predicted),
    "muscle_speed": Figure("largest muscle speed", "m/s", 3, _largest("muscles", "peak_speed")),
    "tension": Figure("largest tension", "N", 0, _largest("muscles", "peak_tension")),
    "state_to_override": Figure(
        "joint state to override, 99%", "ms", 2, lambda s: 1e3 * s.latency.state_to_override.p99
    ),
    "override_to_zero": Figure(
        "override to zero current, longest",
        "ms",
        2,
        lambda swing: 1e3 * swing.latency.override_to_zero.longest,
    ),
    "state_to_zero": Figure(
        "joint state to zero current, longest",
        "ms",
        2,
        lambda swing: 1e3 * swing.latency.state_to_zero.longest,
    ),
    "rejected": Figure("joint states rejected", "", 0, lambda swing: swing.rejected),
}
"""Every figure by its name in `--json` and in a file of limits."""
