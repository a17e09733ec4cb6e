"""A picture of a plan."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fastswing_planner.planning.plan import Outcome, SwingPlan
from fastswing_planner.robot.limits import MuscleLimits


def save_plan_picture(
    path: Path, plan: SwingPlan, comparison: Sequence[Outcome], limits: MuscleLimits
) -> None:
    """Write joint speeds of all methods, muscle speeds and tensions of the plan to an image file.

    Raises OSError if the file cannot be written, ValueError for an unknown file type.
    """
    figure = Figure(figsize=(8.0, 10.0), layout="constrained")
    joint_axes, muscle_axes, tension_axes = figure.subplots(3)
    _draw_joint_speeds(joint_axes, plan, comparison)
    _draw_muscle_speeds(muscle_axes, plan, limits)
    _draw_tensions(tension_axes, plan, limits)
    figure.savefig(path, dpi=120)


def _draw_joint_speeds(axes: Axes, plan: SwingPlan, comparison: Sequence[Outcome]) -> None:
    joint = int(np.argmax(np.abs(plan.end - plan.start)))
    for outcome in comparison:
        if outcome.plan is not None:
            trajectory = outcome.plan.trajectory
            axes.plot(
                trajectory.time,
                trajectory.joint_velocity[:, joint],
                # Hybrid lies on Method 1.
                linestyle="--" if outcome.method.elongates and outcome.method.inhibits else "-",
                label=f"{outcome.method.name.lower()}, {outcome.plan.time_cost:.2f} s",
            )
    axes.set(
        title=f"Speed of {plan.joint_names[joint]} by each method",
        xlabel="time [s]",
        ylabel="joint speed [rad/s]",
    )
    axes.legend()


def _draw_muscle_speeds(axes: Axes, plan: SwingPlan, limits: MuscleLimits) -> None:
    trajectory = plan.trajectory
    colours = mpl.colormaps["tab20"]
    for index, name in enumerate(plan.muscle_names):
        speeds, limited = trajectory.muscle_velocity[:, index], trajectory.at_limit[:, index]
        axes.plot(
            trajectory.time,
            speeds,
            color=colours(index % 20),
            linestyle="-" if plan.kept[index] else ":",
            label=name if plan.kept[index] else f"{name} (masked)",
        )
        axes.plot(trajectory.time[limited], speeds[limited], ".", color=colours(index % 20))
    for limit in sorted(set(limits.velocity.tolist())):
        for sign in (-1.0, 1.0):
            axes.axhline(sign * limit, color="black", linewidth=0.8, linestyle="--")
    axes.set(
        title=f"Muscle speeds, {plan.method.name.lower()}; dots: this muscle holds the swing back",
        xlabel="time [s]",
        ylabel="muscle speed [m/s]",
    )
    if len(plan.muscle_names) <= 20:
        axes.legend(ncols=5, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.2))


def _draw_tensions(axes: Axes, plan: SwingPlan, limits: MuscleLimits) -> None:
    places = np.arange(len(plan.muscle_names))
    axes.bar(places - 0.2, plan.basic_tension, 0.4, label="all muscles", color="lightgrey")
    axes.bar(places + 0.2, plan.holding_tension, 0.4, label="this mask", color="tab:blue")
    axes.step(
        [*(places - 0.5), places[-1] + 0.5],
        [*limits.tension_max, limits.tension_max[-1]],
        where="post",
        color="black",
        linewidth=0.8,
        linestyle="--",
        label="tension_max",
    )
    axes.set_xticks(places, plan.muscle_names, rotation=0 if places.size <= 20 else 90)
    axes.set(title="Tensions that hold the start posture", ylabel="tension [N]")
    axes.legend()
