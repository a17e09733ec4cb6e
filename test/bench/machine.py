"""The machine that a benchmark ran on."""

import os
import platform
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TypeVar

from fastswing_planner.lifecycle.real_time import CoreSleep

AWAKE = ", no core sleeps"
"""Ends the names of rows that were measured by `wakeful`."""

Measured = TypeVar("Measured")

TUNED: dict[str, object] = {"prevent_core_sleep": True, "realtime_priority": 50}
"""Parameters of bridge and inhibitor on a robot PC, as docs/on_the_robot.md says."""

# Names under which a package may be installed: as a wheel, or from apt.
_PACKAGES = {
    "rclpy": ("ros-rclpy", "rclpy"),
    "mujoco": ("mujoco",),
    "proxsuite": ("proxsuite",),
    "daqp": ("daqp",),
    "numpy": ("numpy",),
    "quadprog": ("quadprog",),
    "rosbags": ("rosbags",),
    "mcap-ros2-support": ("mcap-ros2-support",),
}


def wakeful(program: Callable[[], Measured]) -> Measured:
    """Return what a program tells while no core sleeps, where the kernel lets us ask for that."""
    core_sleep = CoreSleep(True)
    core_sleep.prevent()
    try:
        return program()
    finally:
        core_sleep.allow()


def machine() -> dict[str, str]:
    """Return what a figure depends on, in words, by name."""
    return {
        "processor": _processor(Path("/proc/cpuinfo").read_text()),
        "cores": f"{len(os.sched_getaffinity(0))} of {os.cpu_count()}",
        "core sleep": _core_sleep(),
        "load before": f"{os.getloadavg()[0]:.1f}",
        "kernel": f"{platform.system()} {platform.release()}",
        "Python": platform.python_version(),
        **{name: _version(names) for name, names in _PACKAGES.items()},
    }


def _processor(cpuinfo: str) -> str:
    lines = (line.partition(":") for line in cpuinfo.splitlines())
    models = [value.strip() for key, _, value in lines if key.strip() == "model name"]
    return models[0] if models else platform.machine()


def _core_sleep() -> str:
    driver = Path("/sys/devices/system/cpu/cpuidle/current_driver")
    name = driver.read_text().strip() if driver.exists() else "unknown"
    core_sleep = CoreSleep(True)
    refused = core_sleep.prevent()
    core_sleep.allow()
    return f"by {name}, {'can not be prevented' if refused else 'can be prevented'}"


def _version(names: tuple[str, ...]) -> str:
    for name in names:
        try:
            return version(name)
        except PackageNotFoundError:
            continue
    return "not installed"
