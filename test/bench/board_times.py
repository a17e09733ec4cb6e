"""When frames passed the emulated boards: columns of the mock driver's board log."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

_ZERO_CURRENT = ord("0")


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
