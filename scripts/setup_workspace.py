"""Makes the virtual environment that the workspace is built and run in.

Beside an installed ROS 2 Jazzy ("system" mode) it sees the system's packages and gets only what
ROS does not bring; elsewhere ("wheels" mode) it gets ROS itself too. A stamp inside the finished
environment, written last, tells what it was made for: anything else than a match is made anew.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import workspace_common as common
import workspace_python as pythons
from workspace_common import ROOT, VENV, WorkspaceError, say
from workspace_pip import LOG, pip_install

SETUP_VERSION = "1"
STAMP = VENV / "fastswing-setup"
REQUIREMENTS = ROOT / "requirements"
DEFAULT_ROS_PREFIX = "/opt/ros/jazzy"
WHEELS_MODULES = "rclpy, mujoco, proxsuite, daqp, mcap, serial, yaml, colcon_core, pytest"
# What must be there beside a system ROS: Python module and Debian package.
SYSTEM_PACKAGES = {
    "rclpy": "ros-jazzy-ros-base",
    "rosidl_generator_py": "ros-jazzy-rosidl-default-generators",
    "colcon_core": "python3-colcon-common-extensions",
    "catkin_pkg": "python3-catkin-pkg-modules",
    "em": "python3-empy",
    "lark": "python3-lark",
    "numpy": "python3-numpy",
}
PRINT_INCLUDES = (
    "import numpy, sysconfig; print(sysconfig.get_path('include')); print(numpy.get_include())"
)
PRINT_NUMPY_VERSION = "import numpy; print(numpy.__version__)"
SYSTEM_MODULES = "mujoco, proxsuite, daqp, mcap, serial, yaml, pytest"
BAKED_NUMPY = re.compile(r"/opt/python/[^;\"\s]*/site-packages/numpy/[^;\"\s]*/include")
BAKED_PYTHON = re.compile(r"/opt/python/[^;\"\s]*/include/python3\.\d+")


@dataclass(frozen=True)
class Plan:
    """What kind of environment is wanted."""

    mode: str
    ros_prefix: str
    python: str

    @property
    def files(self) -> list[Path]:
        """The requirement files that are installed, in order."""
        names = ["runtime.txt", "dev.txt"]
        if self.mode == "wheels":
            names.insert(0, "ros.txt")
        return [REQUIREMENTS / name for name in names]

    def digest(self) -> str:
        """Return the fingerprint of everything that the environment depends on but its Python."""
        parts = [SETUP_VERSION, self.mode, self.ros_prefix, str(VENV)]
        for path in [*self.files, REQUIREMENTS / "build.txt", REQUIREMENTS / "constraints.txt"]:
            parts.append(path.read_text(encoding="utf-8"))
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def wanted() -> Plan:
    """Return the plan for this machine."""
    prefix = os.environ.get("FASTSWING_ROS_PREFIX") or DEFAULT_ROS_PREFIX
    python = os.environ.get("FASTSWING_PYTHON", "")
    if (Path(prefix) / "setup.bash").is_file():
        return Plan("system", prefix, python)
    return Plan("wheels", "", python)


def read_stamp() -> dict[str, str]:
    """Return the finished environment's stamp, empty if there is none."""
    try:
        lines = STAMP.read_text(encoding="utf-8").splitlines()
    except OSError:
        return {}
    return dict(line.split("=", 1) for line in lines if "=" in line)


def _same_python(wish: str, made_with: str) -> bool:
    """Whether the environment's Python still exists and is the one that the user names, if any."""
    if not (made_with and Path(made_with).exists() and (VENV / "bin" / "python").exists()):
        return False
    if not wish or Path(wish).resolve() == Path(made_with).resolve():
        return True
    interpreter = pythons.probe(shutil.which(wish) or wish)
    return interpreter is not None and Path(interpreter.path).resolve() == Path(made_with).resolve()


def is_finished(plan: Plan) -> bool:
    """Whether the environment is complete and made for this plan."""
    stamp = read_stamp()
    return stamp.get("digest") == plan.digest() and _same_python(
        plan.python, stamp.get("python", "")
    )


def choose_python(plan: Plan) -> pythons.Interpreter:
    """Return the Python to make the environment with, after every check that needs no network."""
    pythons.check_location(ROOT)
    pythons.check_tools()
    if plan.mode == "wheels":
        pythons.check_machine()
        return pythons.chosen_python(plan.python) if plan.python else pythons.find_python()
    interpreter = pythons.chosen_python(plan.python or "/usr/bin/python3")
    _check_system_ros(plan, interpreter)
    return interpreter


def _check_system_ros(plan: Plan, interpreter: pythons.Interpreter) -> None:
    """Raise unless the installed ROS belongs to this Python."""
    name = f"python{interpreter.version[0]}.{interpreter.version[1]}"
    if not (Path(plan.ros_prefix) / "lib" / name).is_dir():
        raise WorkspaceError(
            f"{plan.ros_prefix} is not built for Python {interpreter.text} ({interpreter.path}); "
            "name its Python with FASTSWING_PYTHON=/path/to/python"
        )
    missing = pythons.missing_modules(interpreter, plan.ros_prefix, SYSTEM_PACKAGES)
    if missing:
        raise WorkspaceError(
            f"{plan.ros_prefix} lacks parts that the build needs; install {' '.join(missing)}"
        )


def _remove_old() -> None:
    """Remove the old environment and what was built with it, the stamp first."""
    STAMP.unlink(missing_ok=True)
    old = [VENV, *(common.WORKSPACE / name for name in ("build", "install", "log"))]
    for path in old:
        if path.is_symlink() or path.is_file():
            path.unlink()
        elif path.exists():
            shutil.rmtree(path)


def _make_venv(plan: Plan, interpreter: pythons.Interpreter, lock: int) -> None:
    options = ["--system-site-packages"] if plan.mode == "system" else []
    command = [interpreter.path, "-m", "venv", *options, str(VENV)]
    lines: list[str] = []
    if common.run_child(command, lock, common.clean_environment(), lines.append):
        raise WorkspaceError(f"python -m venv failed: {' '.join(lines)[-300:]}")


def _install(plan: Plan, lock: int) -> None:
    arguments = [text for path in plan.files for text in ("-r", str(path))]
    arguments += ["-c", str(REQUIREMENTS / "constraints.txt")]
    if plan.mode == "wheels":
        pip_install(lock, "-r", str(REQUIREMENTS / "build.txt"))
        arguments += ["--no-build-isolation", "--use-pep517"]
    else:
        # The very numpy that the system's ROS was compiled against: already there, so kept.
        arguments.append(f"numpy=={_answer(PRINT_NUMPY_VERSION)}")
    pip_install(lock, *arguments)


def _answer(code: str) -> str:
    """Return what the environment's Python prints for a piece of code."""
    environment = common.clean_environment()
    # Another ROS distribution's libraries would come before the wheels' own.
    environment.pop("LD_LIBRARY_PATH", None)
    answer = subprocess.run(
        [str(VENV / "bin" / "python"), "-c", code],
        capture_output=True,
        check=False,
        encoding="utf-8",
        env=environment,
        stdin=subprocess.DEVNULL,
    )
    if answer.returncode != 0:
        reason = (answer.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise WorkspaceError(f"the new environment does not work: {reason} (from: {code})")
    return answer.stdout.strip()


def patch_baked_paths() -> None:
    """Replace the wheels' build machine's include folders by this environment's.

    Some CMake files name the folders of the Python and the numpy that the wheels were made
    with; CMake refuses folders that do not exist.
    """
    python_include, numpy_include = _answer(PRINT_INCLUDES).splitlines()
    for path in sorted((VENV / "share").glob("*/cmake/*.cmake")):
        text = path.read_text(encoding="utf-8")
        if "/opt/python/" in text:
            path.write_text(_patched(text, python_include, numpy_include), encoding="utf-8")


def _patched(text: str, python_include: str, numpy_include: str) -> str:
    text = BAKED_NUMPY.sub(lambda _: numpy_include, text)
    return BAKED_PYTHON.sub(lambda _: python_include, text)


def _add_local_setup() -> None:
    """Add the (empty) set-up script that colcon looks for in every prefix and warns about."""
    (VENV / "local_setup.bash").write_text("# Nothing to do.\n", encoding="utf-8")


def _write_stamp(plan: Plan, interpreter: pythons.Interpreter) -> None:
    lines = {
        "digest": plan.digest(),
        "mode": plan.mode,
        "ros_prefix": plan.ros_prefix,
        "python": interpreter.path,
        "version": interpreter.text,
    }
    unfinished = STAMP.with_suffix(".new")
    unfinished.write_text("".join(f"{k}={v}\n" for k, v in lines.items()), encoding="utf-8")
    unfinished.replace(STAMP)


def _make(plan: Plan, lock: int) -> None:
    """Make the environment from nothing."""
    started = time.monotonic()
    interpreter = choose_python(plan)
    origin = f"from {plan.ros_prefix}" if plan.mode == "system" else "from wheels"
    say(f"set-up: ROS 2 Jazzy {origin}, Python {interpreter.text} ({interpreter.path})")
    _remove_old()
    _make_venv(plan, interpreter, lock)
    say("set-up: installing packages, this takes a minute or two")
    _install(plan, lock)
    if plan.mode == "wheels":
        patch_baked_paths()
        _add_local_setup()
    _answer(f"import {WHEELS_MODULES if plan.mode == 'wheels' else SYSTEM_MODULES}")
    _write_stamp(plan, interpreter)
    LOG.unlink(missing_ok=True)
    say(f"set-up: done in {time.monotonic() - started:.0f} s")


def ensure_environment() -> Plan:
    """Make the environment if it is missing, unfinished or made for something else."""
    plan = wanted()
    if is_finished(plan):
        return plan
    with common.exclusive_lock() as lock:
        if not is_finished(plan):
            _make(plan, lock)
    return plan


def main() -> None:
    """Set the workspace up."""
    ensure_environment()


if __name__ == "__main__":
    sys.exit(common.run_program("set-up", main))
