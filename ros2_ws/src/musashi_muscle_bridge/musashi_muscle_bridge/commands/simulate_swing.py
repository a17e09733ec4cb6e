"""Swings the emulated arm without ROS: `ros2 run musashi_muscle_bridge simulate_swing`."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from fastswing_planner.errors import PlannerError
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, SwingRequest
from fastswing_planner.qp.solvers import solver_from
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.simulation.camera import Camera, Picture
from musashi_muscle_bridge.simulation.closed_loop import ClosedLoop, Sample
from musashi_muscle_bridge.simulation.video import frames_of, write_video


def simulated_swing(robot: Robot, method: Method, rate: float) -> tuple[str, list[Sample]]:
    """Plan and carry out one swing between the robot's postures.

    rate  [Hz] of the control period

    Returns its figures as text, and everything that was measured.
    """
    planner = SwingPlanner(robot.model, robot.limits, solver_from())
    plan = planner.plan(SwingRequest(robot.postures["start"], robot.postures["end"], method))
    loop = ClosedLoop(robot, planner, rate)
    figures = loop.run(plan, ExecutionSettings())
    lines = [
        f"{method.name.lower()}: predicted {plan.trajectory.time_cost:.2f} s, "
        f"measured {figures.time_cost:.2f} s"
    ]
    for name, peak in zip(robot.model.joint_names, figures.peak_joint_velocity, strict=True):
        lines.append(f"  {name:>4} {peak:6.2f} rad/s")
    speeds, tensions = figures.peak_muscle_velocity, figures.peak_tension
    for row in zip(robot.model.muscle_names, _notes(plan), speeds, tensions, strict=True):
        name, note, velocity, tension = row
        lines.append(f"  {name:>4} {velocity:6.3f} m/s {tension:6.0f} N{note}")
    return "\n".join(lines), loop.samples


def _notes(plan: SwingPlan) -> list[str]:
    return ["" if kept else "  masked" for kept in plan.kept]


def _pictures(camera: Camera, samples: Sequence[Sample], slowdown: float) -> list[Picture]:
    """Show a swing and half a second before it."""
    began = next(sample.time for sample in samples if sample.phase is Phase.SWING)
    shown = [sample for sample in samples if sample.time > began - 0.5]
    chosen = frames_of([sample.time for sample in shown], slowdown)
    angles = [shown[index].state.joints["position"].astype(float) for index in chosen]
    return [camera.picture(position) for position in angles]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="simulate_swing", description=__doc__)
    parser.add_argument("--robot", default=MUSASHI, help="YAML file of the robot, or package://")
    parser.add_argument("--method", choices=[method.name.lower() for method in Method])
    parser.add_argument("--rate", type=float, default=1000.0, help="control rate [Hz]")
    parser.add_argument(
        "--video",
        type=Path,
        help="write the swings as .mp4, .gif, .webp or .png (animated), or a folder of frames",
    )
    parser.add_argument(
        "--slowdown", type=float, default=1.0, help="how many times slower the video runs"
    )
    arguments = parser.parse_args()
    # Slower than the boards' watchdog of 0.1 s there is no swing.
    for name, low, high in (("rate", 50.0, 10_000.0), ("slowdown", 0.01, 100.0)):
        value = getattr(arguments, name)
        if not low <= value <= high:
            parser.error(f"--{name} is {value}, expected {low:g} to {high:g}")
    return arguments


def main() -> int:
    """Run the command; returns 0, or 2 for wrong input."""
    arguments = _arguments()
    methods = [Method[arguments.method.upper()]] if arguments.method else list(Method)
    try:
        robot = load_robot(arguments.robot)
        camera = Camera(robot) if arguments.video else None
        pictures: list[Picture] = []
        for method in methods:
            report, samples = simulated_swing(robot, method, arguments.rate)
            print(report)
            if camera is not None:
                pictures += _pictures(camera, samples, arguments.slowdown)
        if camera is not None:
            camera.close()
            write_video(arguments.video, pictures)
            print(f"written: {arguments.video}")
    except PlannerError as error:
        print(f"simulate_swing: {error}", file=sys.stderr)
        return 2
    return 0
