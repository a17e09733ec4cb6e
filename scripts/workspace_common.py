"""What the set-up and the build share: paths, messages, the lock, child processes."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import FrameType

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
WORKSPACE = ROOT / "ros2_ws"
LOCK_FILE = ROOT / ".workspace.lock"
INTERRUPTED = 130
KILL_AFTER_SEC = 5.0

# Variables that would let a user's other Python, other ROS or an enclosing make into our children.
FOREIGN_VARIABLES = (
    "MAKEFLAGS",
    "MAKELEVEL",
    "MFLAGS",
    "PIP_PREFIX",
    "PIP_TARGET",
    "PYTHONHOME",
    "PYTHONPATH",
    "__PYVENV_LAUNCHER__",
)


class WorkspaceError(Exception):
    """Something the user has to know or to do; its text is one line."""


def say(text: str) -> None:
    """Print one line of progress at once."""
    print(text, flush=True)


def clean_environment() -> dict[str, str]:
    """Return this process's environment without what would leak into a child."""
    environment = {k: v for k, v in os.environ.items() if k not in FOREIGN_VARIABLES}
    environment["PYTHONNOUSERSITE"] = "1"
    return environment


@contextlib.contextmanager
def exclusive_lock() -> Iterator[int]:
    """Hold the workspace's lock; wait for another set-up or build to finish first.

    Children inherit the file descriptor, so that a child outliving its killed parent still
    holds the lock.
    """
    descriptor = os.open(LOCK_FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("another set-up or build is running in this directory, waiting for it to end")
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield descriptor
    finally:
        os.close(descriptor)


def run_child(
    command: list[str],
    lock: int,
    environment: dict[str, str],
    on_line: Callable[[str], None] | None = None,
) -> int:
    """Run a command to its end and return its exit code; an interruption ends it and its children.

    With `on_line`, its output goes there line by line instead of to the terminal.
    """
    child = subprocess.Popen(
        command,
        cwd=ROOT,
        env=environment,
        pass_fds=(lock,),
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE if on_line else None,
        stderr=subprocess.STDOUT if on_line else None,
        encoding="utf-8",
        errors="replace",
    )
    try:
        if child.stdout is not None and on_line is not None:
            for line in child.stdout:
                on_line(line.rstrip("\n"))
        return child.wait()
    except BaseException:
        _end_group(child)
        raise


def _end_group(child: subprocess.Popen[str]) -> None:
    """End a child and whatever it started: politely first, then for certain."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            child.wait(KILL_AFTER_SEC)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def run_program(name: str, program: Callable[[], None]) -> int:
    """Run a program's body; every expected trouble becomes one line and an exit code."""
    signal.signal(signal.SIGTERM, _interrupt)
    signal.signal(signal.SIGHUP, _interrupt)
    try:
        program()
    except WorkspaceError as error:
        say(f"{name}: {error}")
        return 1
    except KeyboardInterrupt:
        say(f"{name}: interrupted; the next run repairs what is half done")
        return INTERRUPTED
    except OSError as error:
        say(f"{name}: {error.strerror or error}: {error.filename or ROOT}")
        return 1
    return 0
