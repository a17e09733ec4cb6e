"""Shows the emulated arm swing in MuJoCo's viewer: `ros2 run musashi_muscle_bridge view_swing`."""

import argparse
import importlib
import os
import sys
import time
from collections.abc import Mapping

import mujoco

from fastswing_planner.errors import PlannerError
from fastswing_planner.planning.request import Method
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.mujoco_model import load_mjcf
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.commands.simulate_swing import simulated_swing
from musashi_muscle_bridge.simulation.camera import VideoError
from musashi_muscle_bridge.simulation.video import frames_of

_PAUSE_SEC = 1.0


def require_screen(environment: Mapping[str, str]) -> None:
    """Raise VideoError unless there is a screen to open a window on."""
    if not (environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")):
        raise VideoError(
            "no screen: neither DISPLAY nor WAYLAND_DISPLAY is set; simulate_swing --video "
            "renders without one"
        )


def show(robot: Robot, methods: list[Method]) -> None:
    """Repeat the swings until the window is closed; raises VideoError if it does not open."""
    mjcf = load_mjcf(robot.mjcf)
    data = mujoco.MjData(mjcf)
    swings = [simulated_swing(robot, method, 1000.0)[1] for method in methods]
    try:
        window = importlib.import_module("mujoco.viewer").launch_passive(mjcf, data)
    except Exception as error:  # whatever the window system thinks of
        raise VideoError(f"MuJoCo's viewer does not open: {error}") from error
    with window:
        while window.is_running():
            for samples in swings:
                chosen = list(frames_of([sample.time for sample in samples]))
                for index in chosen:
                    if not window.is_running():
                        return
                    position = samples[index].state.joints["position"].astype(float)
                    data.qpos[:] = robot.model.full_position(position)
                    mujoco.mj_forward(mjcf, data)
                    window.sync()
                    time.sleep(0.02)
                time.sleep(_PAUSE_SEC)


def main() -> int:
    """Run the command; returns 0, or 2 for wrong input or without a screen."""
    parser = argparse.ArgumentParser(prog="view_swing", description=__doc__)
    parser.add_argument("--robot", default=MUSASHI, help="YAML file of the robot, or package://")
    parser.add_argument("--method", choices=[method.name.lower() for method in Method])
    arguments = parser.parse_args()
    methods = [Method[arguments.method.upper()]] if arguments.method else list(Method)
    try:
        require_screen(os.environ)
        show(load_robot(arguments.robot), methods)
    except PlannerError as error:
        print(f"view_swing: {error}", file=sys.stderr)
        return 2
    return 0
