"""What a process asks of the kernel to run in time.

Nothing here raises: on a machine that refuses, a node runs as it always did, and says so.
"""

import ctypes
import gc
import os
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from fastswing_planner.lifecycle.parameters import Parameter

REAL_TIME = (
    Parameter(
        "realtime_priority",
        0,
        "SCHED_FIFO priority of the whole process; 0: as it was started. What the kernel refuses "
        "is a warning, in the log and in diagnostics.",
        low=0,
        high=99,
    ),
    Parameter(
        "cpu_affinity",
        [],
        "Cores that the process may run on, by number; empty: as it was started. Refusals are "
        "warnings, too.",
        low=0,
        high=1023,
        item=int,
    ),
)

_PR_SET_TIMERSLACK = 29
_SHORTEST_SLACK_NS = 1
_NO_LATENCY_US = bytes(4)  # as the kernel's s32


def ask_for_real_time(priority: int, cores: Sequence[int]) -> list[str]:
    """Ask for everything here, for all threads of this process; return what failed.

    priority  `realtime_priority` of REAL_TIME
    cores     `cpu_affinity` of REAL_TIME
    """
    asked = (tighten_timers(), use_cores(cores), use_priority(priority))
    return [text for text in asked if text]


def tighten_timers() -> str:
    """Wake this thread, and those that it starts, when they asked to be woken and not 50 us later.

    Returns what failed; empty if nothing did.
    """
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(_SHORTEST_SLACK_NS), 0, 0, 0) == 0:
        return ""
    return f"timer slack stays at the kernel's: {os.strerror(ctypes.get_errno())}"


def use_cores(cores: Sequence[int]) -> str:
    """Run all threads of this process on these cores only; none named: leave them as they are.

    Returns what failed; empty if nothing did.
    """
    if not cores:
        return ""
    try:
        for thread in _threads():
            os.sched_setaffinity(thread, cores)
    except (OSError, ValueError, OverflowError) as error:
        return f"cpu_affinity {list(cores)} refused: {_reason(error)}"
    return ""


def use_priority(priority: int) -> str:
    """Run all threads of this process under SCHED_FIFO; 0: leave them as they are.

    Returns what failed; empty if nothing did. Threads and processes started later inherit it.
    """
    if not priority:
        return ""
    try:
        for thread in _threads():
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return (
            f"realtime_priority {priority} refused: {_reason(error)}; it needs CAP_SYS_NICE or an "
            "rtprio limit"
        )
    return ""


def prevent_core_sleep(default: bool, when: str) -> Parameter:
    """Return the parameter of a node that uses CoreSleep; `when` begins its description."""
    return Parameter(
        "prevent_core_sleep",
        default,
        f"{when} no core of this machine sleeps: messages are answered sooner and periods are more "
        "regular, idle cores use power. Needs write access to /dev/cpu_dma_latency; a refusal is a "
        "warning.",
    )


class CoreSleep:
    """Keeps all cores of the machine from sleeping while it counts.

    A core that slept wakes late and with cold caches: a message is answered later by as much as
    its own work takes. The kernel offers this to whoever may write its PM QoS file, for as long as
    the file is open (Documentation/power/pm_qos_interface.rst).
    """

    def __init__(self, wanted: bool, path: Path = Path("/dev/cpu_dma_latency")) -> None:
        """Change nothing yet; never, unless it is `wanted`: `prevent_core_sleep`."""
        self._wanted = wanted
        self._path = path
        self._held: BinaryIO | None = None

    def prevent(self) -> str:
        """Let no core sleep until `allow`; returns what failed; empty if nothing did."""
        if self._wanted and self._held is None:
            try:
                # Not "wb": where the kernel has no such file, that would make one.
                self._held = self._path.open("r+b", buffering=0)
                self._held.write(_NO_LATENCY_US)
            except OSError as error:
                self.allow()
                return f"{self._path} refused: {_reason(error)}; cores may sleep"
        return ""

    def allow(self) -> None:
        """Let the cores sleep again."""
        if self._held is not None:
            self._held.close()
            self._held = None


def keep_what_there_is() -> None:
    """Let the garbage collector look only at what is made from now on.

    What a node was built of stays for good, and looking through it takes tens of milliseconds.
    """
    gc.collect()
    gc.freeze()


def _threads() -> list[int]:
    return [int(entry.name) for entry in Path("/proc/self/task").iterdir()]


def _reason(error: Exception) -> str:
    return error.strerror if isinstance(error, OSError) and error.strerror else str(error)
