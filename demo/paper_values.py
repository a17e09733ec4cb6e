"""What the paper prints of its three swings: simulation (predicted) and robot (measured)."""

from typing import Any

PAPER: dict[str, dict[str, Any]] = {
    "basic": {
        "predicted": {"peak_elbow_pitch_velocity_rad_s": 2.4, "time_cost_s": 0.99},
        "measured": {"peak_elbow_pitch_velocity_rad_s": 2.6, "max_tension_n": 290.0},
        "masked_muscles": [],
    },
    "method_1": {
        "predicted": {"peak_elbow_pitch_velocity_rad_s": 4.4, "time_cost_s": 0.60},
        "measured": {"peak_elbow_pitch_velocity_rad_s": 3.7, "max_tension_n": 180.0},
        "masked_muscles": ["#2", "#3", "#9", "#10"],
    },
    "method_2": {
        "predicted": {"peak_elbow_pitch_velocity_rad_s": 3.3, "time_cost_s": 0.78},
        "measured": {"peak_elbow_pitch_velocity_rad_s": 3.4, "max_tension_n": 140.0},
        "masked_muscles": ["#9"],
    },
}
