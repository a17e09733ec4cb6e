"""Reads the log of the emulated boards while it grows: the truth about commands and modes."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

LENGTH, TENSION, CURRENT, ZERO = "3", "2", "1", "0"
WATCHDOG = "5"
_QUIET_SEC = 0.4  # without a change of commands: what follows is not a consequence any more


@dataclass(frozen=True)
class CommandLine:
    """One command frame that the boards took; times [s] monotonic."""

    time: float
    group: int
    session: int
    sequence: int
    modes: str
    setpoints: tuple[float, ...]
    tension_limit: float
    board_modes: str
    faults: str
    tension: float


@dataclass(frozen=True)
class BoardsLine:
    """One change of the boards' modes or faults; silence [s] is their own time without command."""

    time: float
    modes: str
    faults: str
    silence: float
    tension: float


@dataclass
class BoardLines:
    """Lines of one log, oldest first; `poll` takes what was added."""

    path: Path
    commands: list[CommandLine] = field(default_factory=list)
    boards: list[BoardsLine] = field(default_factory=list)
    _offset: int = 0

    def poll(self) -> None:
        """Take the whole lines that were added since the last call."""
        if not self.path.exists():
            return
        with self.path.open("rb") as file:
            file.seek(self._offset)
            added = file.read()
        whole = added[: added.rfind(b"\n") + 1]
        self._offset += len(whole)
        for line in whole.decode().splitlines():
            self._take(line.split("\t"))

    def _take(self, cells: list[str]) -> None:
        if cells[0] == "boards":
            _, time, modes, faults, silence, tension = cells
            self.boards.append(
                BoardsLine(float(time), modes, faults, float(silence), float(tension))
            )
            return
        if cells[0] != "command":
            return
        _, time, group, session, sequence, modes, setpoints, limit, board_modes, faults, tension = (
            cells
        )
        self.commands.append(
            CommandLine(
                float(time),
                int(group),
                int(session),
                int(sequence),
                modes,
                tuple(map(float, setpoints.split(","))),
                float(limit),
                board_modes,
                faults,
                float(tension),
            )
        )

    def forget(self, time: float) -> None:
        """Drop what was taken before a time [s]."""
        self.commands = self.commands_since(time)
        self.boards = [line for line in self.boards if line.time >= time]

    def commands_since(self, time: float) -> list[CommandLine]:
        """Return the commands taken at or after a time [s]."""
        found = []
        for line in reversed(self.commands):
            if line.time < time:
                break
            found.append(line)
        return found[::-1]

    def longest_gap(self, time: float) -> float:
        """Return the longest time [s] without a command since a time [s]."""
        times = [line.time for line in self.commands_since(time)]
        return max((later - earlier for earlier, later in pairwise(times)), default=inf)

    def letting_go(self, time: float) -> bool:
        """Whether the last command until a time [s] let a muscle go."""
        before = next((line for line in reversed(self.commands) if line.time <= time), None)
        return before is not None and ZERO in before.modes

    # What counts as safe: each returns when it was reached [s], None if not yet.

    def held_since(self, time: float, without: frozenset[int] = frozenset()) -> float | None:
        """All muscles but `without` are driven to lengths that do not change any more."""
        lines = self.commands_since(time - _QUIET_SEC)
        if len(lines) < 2 or lines[-1].time < time + _QUIET_SEC:
            return None

        chosen = [index for index in range(len(lines[-1].modes)) if index not in without]

        def others(values: Sequence[T]) -> list[T]:
            return [values[index] for index in chosen]

        if set(others(lines[-1].modes)) != {LENGTH} or set(others(lines[-1].faults)) != {"0"}:
            return None
        last = lines[-1]
        for line in reversed(lines):
            if (line.modes, others(line.setpoints)) != (last.modes, others(last.setpoints)):
                changed = line.time
                break
        else:
            changed = time
        return max(changed, time) if last.time - changed >= _QUIET_SEC else None

    def in_watchdog_since(self, time: float) -> float | None:
        """Every board is in its watchdog action."""
        for line in self.boards:
            if line.time >= time and set(line.faults) == {WATCHDOG}:
                return line.time
        return None

    def without_current_since(self, time: float) -> float | None:
        """No board drives its motor."""
        for line in self.boards:
            if line.time >= time and set(line.modes) == {ZERO}:
                return line.time
        return None

    # What is claimed of every row.

    def frames_without_current(self, time: float, period: float) -> int:
        """Return how many command frames sent after a time let go a muscle, in an unbroken row.

        Boards that were not scheduled take what waited all at once. The bridge sends at most one
        frame each `period` [s], but for one that it catches up: so of frames that were taken too
        near to each other, some were certainly sent before that time, and do not count.
        """
        lines = self.commands_since(time)
        latest_sending = [line.time for line in lines]
        for index in reversed(range(len(lines) - 1)):
            limit = latest_sending[index + 1] - period
            latest_sending[index] = min(latest_sending[index], limit)
        count = 0
        for line, sent in zip(lines, latest_sending, strict=True):
            if ZERO not in line.modes:
                break
            count += sent + period >= time
        return count

    def silence_of_watchdog(self, time: float) -> float | None:
        """Return the boards' own time [s] from the last command to the watchdog's action."""
        for line in self.boards:
            if line.time >= time and set(line.faults) == {WATCHDOG}:
                return line.silence
        return None
