"""What the boards were told and what they did, line by line, for tests and post-mortems.

Tab-separated, one line per event, each written at once: a process that is killed loses none.

    command  time  group  session  sequence  modes  setpoints  limit  board modes  faults  tension
    answer   time  group  sequence  arrived  measured
    boards   time  board modes  faults  silence  tension

time [s] is CLOCK_MONOTONIC, the same for all processes of a machine. group counts the buses from 0;
a command is for the muscles of its group. Modes and faults are one digit for each muscle, setpoints
[m], [N] or [A] by mode. limit (of the tension) and tension [N] are the largest of all muscles. An
answer tells the state of `measured` and left at `time`; the frame of that sequence had `arrived` at
this computer then, however late this process read it.
silence [s] is the boards' own time since the last command when the latest fault latched, the
largest of all faulty boards: it does not depend on when the process ran.
"""

from pathlib import Path

from numpy.typing import NDArray

from fastswing_planner.errors import InvalidParameter
from musashi_muscle_bridge.buses.protocol import CommandFrame
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.emulation.bus import Served


def _digits(values: NDArray) -> str:
    return "".join(map(str, values.tolist()))


class BoardLog:
    """Appends to a new file."""

    def __init__(self, path: str) -> None:
        """Raise InvalidParameter if the file cannot be made, or is there already."""
        try:
            self._file = Path(path).expanduser().open("xb", buffering=0)
        except OSError as error:
            raise InvalidParameter(f"board_log: {error}") from error
        self._seen = b"", b""

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def command(self, now: float, group: int, command: CommandFrame, boards: Boards) -> None:
        """Write a command that a group of boards took at `now` [s]; a question is none."""
        rows = command.rows
        if not len(rows):
            return
        setpoints = ",".join(f"{value:.5f}" for value in rows["setpoint"].tolist())
        self._write(
            f"command\t{now:.6f}\t{group}\t{command.session}\t{command.sequence}\t{_digits(rows['mode'])}\t"
            f"{setpoints}\t{rows['tension_limit'].max():.3f}\t{self._condition(boards)}\n"
        )
        self.changes(now, boards)

    def answer(self, sent: float, group: int, served: Served) -> None:
        """Write that an answer of a group of boards left at `sent` [s]."""
        self._write(
            f"answer\t{sent:.6f}\t{group}\t{served.sequence}\t"
            f"{served.arrived:.6f}\t{served.measured:.6f}\n"
        )

    def changes(self, now: float, boards: Boards) -> None:
        """Write the boards' modes and faults if they changed since the last call."""
        seen = boards.mode.tobytes(), boards.fault.tobytes()
        if seen == self._seen:
            return
        self._seen = seen
        faulty = boards.fault > 0
        silence = boards.silence_at_fault[faulty].max(initial=0.0)
        digits = f"{_digits(boards.mode)}\t{_digits(boards.fault)}"
        self._write(
            f"boards\t{now:.6f}\t{digits}\t{silence:.6f}\t{boards.plant.tension.max():.2f}\n"
        )

    def _condition(self, boards: Boards) -> str:
        return f"{_digits(boards.mode)}\t{_digits(boards.fault)}\t{boards.plant.tension.max():.2f}"

    def _write(self, line: str) -> None:
        self._file.write(line.encode())
