"""When frames passed the emulated boards: columns of the mock driver's board log."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_ZERO_CURRENT = ord("0")
_EARLY = 0.25
"""Periods by which a frame may come before its time."""


@dataclass(frozen=True)
class BoardTimes:
    """Of each command that was answered, in order; monotonic times [s], shape (k,).

    arrived   its frame came to this computer
    measured  the state in the answer was measured
    sent      the answer left
    off       muscles that the command leaves without current, shape (k, m)
    """

    arrived: NDArray[np.float64]
    measured: NDArray[np.float64]
    sent: NDArray[np.float64]
    off: NDArray[np.bool_]

    def answer_before(self, time: float) -> int:
        """Return which answer was the newest that had left at a time [s]; -1: none."""
        return int(np.searchsorted(self.sent, time)) - 1

    def first_off(self, muscle: int, since: float) -> int | None:
        """Return the first command arrived at or after `since` [s] with the muscle off."""
        first = int(np.searchsorted(self.arrived, since))
        found = np.flatnonzero(self.off[first:, muscle])
        return first + int(found[0]) if found.size else None


def missed_periods(arrived: NDArray[np.float64], period: float) -> list[tuple[float, float, int]]:
    """Return where periods have no frame: from one frame to the next [s], and how many are missing.

    arrived  when frames came [s], shape (k,)
    period   [s] from one to the next

    A frame that only came late has its period: those behind it have theirs. Frames are sent at
    absolute times, so most tell where the periods begin.
    """
    turns = arrived / period
    phase = np.angle(np.exp(2j * np.pi * turns).mean()) / (2.0 * np.pi)
    newest = np.floor(turns - phase + _EARLY)
    # Of a late frame this is a later period than its own: each frame behind it has one, too.
    order = np.arange(arrived.size)
    own = np.minimum.accumulate((newest - order)[::-1])[::-1] + order
    missing = np.diff(own) - 1.0
    return [
        (float(arrived[gap]), float(arrived[gap + 1]), int(missing[gap]))
        for gap in np.flatnonzero(missing).tolist()
    ]


def read_board_log(path: Path) -> BoardTimes:
    """Read a finished log of boards on one bus, with one bridge."""
    modes: dict[str, str] = {}
    times: list[tuple[float, float, float]] = []
    answered: list[str] = []
    for line in path.read_text().splitlines():
        cells = line.split("\t")
        if cells[0] == "command":
            modes[cells[4]] = cells[5]
        elif cells[0] == "answer":
            _, sent, _, sequence, arrived, measured = cells
            times.append((float(arrived), float(measured), float(sent)))
            answered.append(modes[sequence])
    digits = np.frombuffer("".join(answered).encode(), np.uint8).reshape(len(answered), -1)
    arrived, measured, sent = np.array(times).T
    return BoardTimes(arrived, measured, sent, digits == _ZERO_CURRENT)
