"""What this machine allows a control loop: the C program udp_pace, beside what is measured."""

import os
import subprocess
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from baselines import baseline
from numpy.typing import NDArray
from processes import free_udp_port


@dataclass(frozen=True)
class Pace:
    """Of each period; monotonic times [s], shape (k,).

    began       when it began
    lateness    how much later than its deadline
    round_trip  to the echo and back; without those that were not answered
    """

    began: NDArray[np.float64]
    lateness: NDArray[np.float64]
    round_trip: NDArray[np.float64]

    def stalled(self, begin: float, end: float, limit: float) -> bool:
        """Whether it was later than `limit` [s] between two monotonic times [s]."""
        stalls = self.lateness > limit
        deadline = self.began - self.lateness
        return bool(np.any(stalls & (deadline < end) & (self.began > begin)))


class PaceBaseline:
    """The program, running.

    has_priority  it has what was asked for
    """

    def __init__(
        self,
        frame_size: int,
        period: float,
        seconds: float,
        core: int | None = None,
        priority: int = 0,
    ) -> None:
        """Build and start it: frames of `frame_size` bytes, one per `period` [s].

        Of 0 bytes: it exchanges nothing and only sees stalls.

        core      the only one that it runs on, so that it sees this one's stalls
        priority  of SCHED_FIFO; 0: an ordinary program, as it is too where the kernel refuses
        """
        program = baseline("udp_pace")
        port = str(free_udp_port())
        self._processes: list[subprocess.Popen[Any]] = []
        if frame_size:
            self._processes.append(subprocess.Popen([program, "echo", port]))
        microseconds = str(round(period * 1e6))
        count = str(round(seconds / period))
        self._loop = subprocess.Popen(
            [program, "loop", port, str(frame_size), microseconds, count],
            stdout=subprocess.PIPE,
            text=True,
        )
        self._processes.append(self._loop)
        if core is not None:
            os.sched_setaffinity(self._loop.pid, {core})
        self.has_priority = not priority
        if priority:
            with suppress(OSError):
                os.sched_setscheduler(self._loop.pid, os.SCHED_FIFO, os.sched_param(priority))
                self.has_priority = True

    def result(self) -> Pace:
        """Wait for its end."""
        text, _ = self._loop.communicate()
        for process in self._processes:
            process.wait()
        nanoseconds = np.array([line.split() for line in text.splitlines()], dtype=np.int64)
        began, lateness, round_trip = nanoseconds.T * 1e-9
        return Pace(began, lateness, round_trip[round_trip > 0.0])

    def stop(self) -> None:
        """End it, if it still runs."""
        for process in self._processes:
            process.kill()
            process.wait()
