"""The planner's mathematics needs no ROS."""

import subprocess
import sys
from pathlib import Path

import pytest

import fastswing_planner

WITH_ROS = (
    "client",
    "error_code",
    "executor_links",
    "learn_model_command",
    "message_definition",
    "plan_command",
    "raw_messages",
    "robot_path",
    "swing_goal",
)
PROGRAM = """
import importlib, sys
for package in sys.argv[2].split():
    sys.modules[package] = None
importlib.import_module(sys.argv[1])
"""
ROS = "rclpy rosidl_runtime_py ament_index_python fastswing_msgs sensor_msgs std_msgs"
CORE = sorted(
    path.stem
    for path in Path(str(fastswing_planner.__file__)).parent.glob("*.py")
    if not path.stem.endswith(("_node", "_conversion")) and path.stem not in (*WITH_ROS, "__init__")
)


def import_alone(module: str, unimportable: str) -> subprocess.CompletedProcess[str]:
    """Import a module in a process of its own in which some packages cannot be imported."""
    command = [sys.executable, "-c", PROGRAM, module, unimportable]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


@pytest.mark.parametrize("module", CORE)
def test_a_core_module_is_imported_without_ros(module: str) -> None:
    result = import_alone(f"fastswing_planner.{module}", ROS)
    assert (result.returncode, result.stderr) == (0, "")


def test_the_obstacle_to_importing_works() -> None:
    assert import_alone("fastswing_planner.swing", "numpy").returncode == 1


def test_the_whole_mathematics_is_core() -> None:
    assert {
        "plan",
        "request",
        "swing",
        "holding",
        "mask_search",
        "swing_execution",
        "robot",
        "bag",
        "length_correction",
    } <= set(CORE)
