"""Protocol, buses, arbitration, boards and arm need no ROS."""

import subprocess
import sys
from pathlib import Path

import musashi_muscle_bridge

ROS = (
    "rclpy",
    "ament_index_python",
    "fastswing_msgs",
    "geometry_msgs",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
    "visualization_msgs",
)
# Commands that find the installed robot.
WITH_ROS = ("simulate_swing", "view_swing", "__init__")
PROGRAM = """
import importlib, sys
for package in sys.argv[1].split():
    sys.modules[package] = None
for module in sys.argv[2].split():
    importlib.import_module(f"musashi_muscle_bridge.{module}")
"""
CORE = sorted(
    path.stem
    for path in Path(str(musashi_muscle_bridge.__file__)).parent.glob("*.py")
    if not path.stem.endswith(("_node", "_conversion")) and path.stem not in WITH_ROS
)


def test_every_core_module_is_imported_without_ros() -> None:
    command = [sys.executable, "-c", PROGRAM, " ".join(ROS), " ".join(CORE)]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (result.returncode, result.stderr) == (0, "")


def test_what_boards_and_bridge_compute_is_core() -> None:
    assert {"protocol", "board_link", "arbiter", "control", "injected_faults", "cobs"} <= set(CORE)


def test_what_dashboard_and_picture_show_is_core() -> None:
    assert {"dashboard", "dashboard_picture", "arm_shapes", "muscle_lines"} <= set(CORE)
