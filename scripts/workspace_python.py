"""Finds a usable Python and the tools that compiling messages needs."""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from workspace_common import WorkspaceError, clean_environment

SUPPORTED = ((3, 10), (3, 11), (3, 12), (3, 13))
# Jazzy's own Python first, then the nearest; within one name every directory of PATH is tried.
CANDIDATES = ("python3.12", "python3.11", "python3.13", "python3.10", "python3")
AWKWARD_CHARACTERS = " \t\n:;\"'\\$`&()<>|*?[]{}#!"
PROBE_TIMEOUT_SEC = 20.0
PROBE = """
import importlib.util, json, os, platform, sys, sysconfig
header = os.path.join(sysconfig.get_path("include"), "Python.h")
print(json.dumps({
    "path": getattr(sys, "_base_executable", None) or sys.executable,
    "version": list(sys.version_info[:3]),
    "usual": platform.python_implementation() == "CPython" and sys.maxsize > 2**32
             and not sysconfig.get_config_var("Py_GIL_DISABLED"),
    "venv": all(importlib.util.find_spec(m) for m in ("venv", "ensurepip")),
    "headers": os.path.exists(header),
}))
"""
TOOLS = ((("c++", "g++", "clang++"), "g++"), (("cmake",), "cmake"), (("make",), "make"))


@dataclass(frozen=True)
class Interpreter:
    """A Python that was run and told about itself."""

    path: str
    version: tuple[int, int, int]
    usual: bool
    venv: bool
    headers: bool

    @property
    def supported(self) -> bool:
        """Whether the wheels exist for it."""
        return self.usual and self.version[:2] in SUPPORTED

    @property
    def text(self) -> str:
        """Its version as text, such as 3.11.7."""
        return ".".join(map(str, self.version))

    def missing_packages(self) -> list[str]:
        """Return the Debian packages that it lacks."""
        name = f"python{self.version[0]}.{self.version[1]}"
        missing = [] if self.headers else [f"{name}-dev"]
        return missing if self.venv else [*missing, f"{name}-venv"]


def probe(path: str) -> Interpreter | None:
    """Run a Python and ask it about itself; None if it does not run (a version manager's stub)."""
    try:
        answer = subprocess.run(
            [path, "-I", "-c", PROBE],
            capture_output=True,
            check=True,
            encoding="utf-8",
            env=clean_environment(),
            stdin=subprocess.DEVNULL,
            timeout=PROBE_TIMEOUT_SEC,
        )
        fields = json.loads(answer.stdout)
    except (OSError, subprocess.SubprocessError, ValueError):
        return None
    fields["version"] = tuple(fields["version"])
    return Interpreter(**fields)


def _candidate_paths() -> list[str]:
    directories = [d for d in os.environ.get("PATH", os.defpath).split(os.pathsep) if d]
    paths = [str(Path(d) / name) for name in CANDIDATES for d in directories]
    return list(dict.fromkeys([*filter(os.path.exists, paths), sys.executable]))


def _require(interpreter: Interpreter) -> Interpreter:
    """Return the interpreter if nothing is missing for it."""
    missing = interpreter.missing_packages()
    if missing:
        raise WorkspaceError(
            f"Python {interpreter.text} ({interpreter.path}) lacks parts that the build needs; "
            f"install {' '.join(missing)}"
        )
    return interpreter


def chosen_python(path: str) -> Interpreter:
    """Return the interpreter that the user named."""
    interpreter = probe(shutil.which(path) or path)
    if interpreter is None:
        raise WorkspaceError(f"FASTSWING_PYTHON={path} does not run; name a Python 3.10 to 3.13")
    if not interpreter.supported:
        raise WorkspaceError(
            f"FASTSWING_PYTHON={path} is Python {interpreter.text}; needed: CPython 3.10 to 3.13"
        )
    return _require(interpreter)


def find_python() -> Interpreter:
    """Return the first complete Python 3.10 to 3.13 on PATH."""
    incomplete = None
    for path in _candidate_paths():
        interpreter = probe(path)
        if interpreter is None or not interpreter.supported:
            continue
        if not interpreter.missing_packages():
            return interpreter
        incomplete = incomplete or interpreter
    if incomplete is not None:
        return _require(incomplete)
    raise WorkspaceError(
        "no Python 3.10 to 3.13 found on PATH; install python3.12 python3.12-dev python3.12-venv "
        "(or another of these versions), or name one with FASTSWING_PYTHON=/path/to/python"
    )


def missing_modules(
    interpreter: Interpreter, ros_prefix: str, packages: dict[str, str]
) -> list[str]:
    """Return the Debian packages of the modules that Python lacks beside an installed ROS."""
    code = (
        "import importlib.util as u, sys; print(*(m for m in sys.argv[1:] if not u.find_spec(m)))"
    )
    script = 'source "$1/setup.bash" >&2 && shift && exec "$@"'
    answer = subprocess.run(
        ["bash", "-c", script, "bash", ros_prefix, interpreter.path, "-c", code, *packages],
        capture_output=True,
        check=False,
        encoding="utf-8",
        env=clean_environment(),
        stdin=subprocess.DEVNULL,
    )
    if answer.returncode != 0:
        raise WorkspaceError(f"{ros_prefix}/setup.bash cannot be used: {answer.stderr.strip()}")
    return [packages[module] for module in answer.stdout.split()]


def check_tools() -> None:
    """Raise naming the Debian packages of the build tools that are missing."""
    missing = [package for names, package in TOOLS if not any(map(shutil.which, names))]
    if missing:
        raise WorkspaceError(f"build tools are missing; install {' '.join(missing)}")


def check_location(root: Path) -> None:
    """Raise where colcon's scripts and the nodes' first lines would break on the path."""
    wrong = sorted(set(str(root)) & set(AWKWARD_CHARACTERS))
    if wrong:
        raise WorkspaceError(
            f"the path {str(root)!r} holds characters that colcon cannot work with "
            f"({', '.join(map(repr, wrong))}); move this directory to a path without them"
        )


def check_machine() -> None:
    """Raise where no ROS wheels exist."""
    system, machine = platform.system(), platform.machine()
    if (system, machine) != ("Linux", "x86_64"):
        raise WorkspaceError(
            f"ROS 2 Jazzy comes as wheels for Linux on x86_64 only, this is {system} on {machine}; "
            "install ROS 2 Jazzy under /opt/ros/jazzy"
        )
