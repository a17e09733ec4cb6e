"""A recording is analysed where ROS is not installed."""

import subprocess
import sys
from pathlib import Path

import pytest

from fastswing_planner import analysis

PROGRAM = """
import importlib, sys
for package in ("rclpy", "ament_index_python", "fastswing_msgs", "sensor_msgs", "std_msgs"):
    sys.modules[package] = None
importlib.import_module(sys.argv[1])
"""
MODULES = sorted(
    path.stem
    for path in Path(str(analysis.__file__)).parent.glob("*.py")
    if path.stem != "__init__"
)


@pytest.mark.parametrize("module", MODULES)
def test_a_module_of_the_analysis_is_imported_without_ros(module: str) -> None:
    command = [sys.executable, "-c", PROGRAM, f"fastswing_planner.analysis.{module}"]
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (result.returncode, result.stderr) == (0, "")


def test_there_are_modules_to_import() -> None:
    assert {"measured_swing", "page", "recording_reading", "analyse_command"} <= set(MODULES)
