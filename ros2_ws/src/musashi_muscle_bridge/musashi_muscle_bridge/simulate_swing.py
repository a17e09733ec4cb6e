"""Swings the emulated arm without ROS: `ros2 run musashi_muscle_bridge simulate_swing`."""

import argparse
import sys

from fastswing_planner.errors import PlannerError
from fastswing_planner.managed_node import ROBOT_DESCRIPTION, resolve_path
from fastswing_planner.plan import Method, SwingPlanner, SwingRequest
from fastswing_planner.qp import ProxSuiteSolver
from fastswing_planner.robot import Robot, load_robot
from fastswing_planner.swing_execution import ExecutionSettings
from musashi_muscle_bridge.closed_loop import ClosedLoop


def swing_report(robot: Robot, method: Method, rate: float) -> str:
    """Plan and carry out one swing between the robot's postures; return its figures as text."""
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    request = SwingRequest(robot.postures["start"], robot.postures["end"], method)
    plan = planner.plan(request)
    figures = ClosedLoop(robot, planner, rate).run(plan, ExecutionSettings())
    lines = [f"{method.name.lower()}: predicted {plan.trajectory.time_cost:.2f} s, "]
    lines[0] += f"measured {figures.time_cost:.2f} s"
    for name, peak in zip(robot.model.joint_names, figures.peak_joint_velocity, strict=True):
        lines.append(f"  {name:>4} {peak:6.2f} rad/s")
    rows = zip(
        robot.model.muscle_names,
        plan.kept,
        figures.peak_muscle_velocity,
        figures.peak_tension,
        strict=True,
    )
    for name, kept, velocity, tension in rows:
        note = "" if kept else "  masked"
        lines.append(f"  {name:>4} {velocity:6.3f} m/s {tension:6.0f} N{note}")
    return "\n".join(lines)


def main() -> int:
    """Run the command; returns 0, or 2 for wrong input."""
    parser = argparse.ArgumentParser(prog="simulate_swing", description=__doc__)
    parser.add_argument(
        "--robot", default=ROBOT_DESCRIPTION.default, help="YAML file of the robot, or package://"
    )
    parser.add_argument("--method", choices=[method.name.lower() for method in Method])
    parser.add_argument("--rate", type=float, default=1000.0, help="control rate [Hz]")
    arguments = parser.parse_args()
    methods = [Method[arguments.method.upper()]] if arguments.method else list(Method)
    try:
        robot = load_robot(resolve_path(arguments.robot))
        for method in methods:
            print(swing_report(robot, method, arguments.rate))
    except PlannerError as error:
        print(f"simulate_swing: {error}", file=sys.stderr)
        return 2
    return 0
