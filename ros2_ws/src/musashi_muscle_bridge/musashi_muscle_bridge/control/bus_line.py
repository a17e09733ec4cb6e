"""One bus of the bridge: a frame out, the answer in, and what came instead."""

import time

from musashi_muscle_bridge.buses.bus import Bus
from musashi_muscle_bridge.buses.protocol import CommandFrame, StateFrame, is_newer
from musashi_muscle_bridge.control.board_group import GroupControl
from musashi_muscle_bridge.errors import BusError, BusTimeout, FrameError

_MAX_FRAMES_PER_PERIOD = 64  # whatever floods the bus, the next command goes out
_REMEMBERED = 256  # commands whose answers are told in time; later ones are none


class BusLine:
    """Exchanges frames with one group of boards; only the control thread calls it.

    state            the newest answer so far
    measured         monotonic time [s] by which its measurements were made, at the earliest if it
                     came late: the boards answer at once, what takes its time is the bus
    late             answers that were not to the frame sent last
    misses_in_a_row  periods without an answer since the last one
    """

    def __init__(self, bus: Bus, group: GroupControl) -> None:
        self._bus = bus
        self._group = group
        self._sequence = 0
        self._sent: dict[int, float] = {}  # when each frame was sent [s], the oldest first
        self._problem: BusError | None = None
        self._dropped = {"damaged": 0, "foreign": 0}
        self.state: StateFrame | None = None
        self.measured = 0.0
        self.late = 0
        self.replies = 0
        self.misses = 0
        self.misses_in_a_row = 0
        self.last_error = ""
        self.round_trip = 0.0
        self.worst_round_trip = 0.0

    @property
    def dropped(self) -> dict[str, int]:
        """What came and did not count, by reason."""
        return {
            **{f"dropped_{reason}": count for reason, count in self._dropped.items()},
            **{f"bus_{reason}": count for reason, count in self._bus.dropped.items()},
        }

    def close(self) -> None:
        """Release the port; frames stop."""
        self._bus.close()

    def send(self, command: CommandFrame) -> None:
        """Send this period's command."""
        self._sequence, self._problem = command.sequence, None
        if len(self._sent) >= _REMEMBERED:
            del self._sent[next(iter(self._sent))]
        self._sent[command.sequence] = time.monotonic()
        try:
            self._bus.send(command.encode())
        except BusError as error:
            self._problem = error

    def answered(self, deadline: float) -> bool:
        """Whether a new state came until the monotonic time `deadline` [s]."""
        try:
            if self._problem is not None:
                raise self._problem
            self.state = state = self._await(deadline)
        except (BusError, FrameError) as error:
            self.misses += 1
            self.misses_in_a_row += 1
            self.last_error = str(error)
            return False
        self.replies += 1
        self.misses_in_a_row = 0
        now, sent = time.monotonic(), self._sent[state.sequence]
        late = state.sequence != self._sequence
        self.late += late
        self.measured = sent if late else now
        self.round_trip = now - sent
        self.worst_round_trip = max(self.worst_round_trip, self.round_trip)
        return True

    def _await(self, deadline: float) -> StateFrame:
        """Return the answer to this frame, or at the deadline the newest late one."""
        oldest = -1 if self.state is None else self.state.sequence
        newest: StateFrame | None = None
        problem: BusError | FrameError | None = None
        for _ in range(_MAX_FRAMES_PER_PERIOD):
            try:
                state = self._receive(deadline - time.monotonic())
            except FrameError as error:
                # Anybody's noise: the answer may still come.
                problem = error
                continue
            except BusTimeout as error:
                problem = problem or error
                break
            if is_newer(state.sequence, oldest) and state.sequence in self._sent:
                newest, oldest = state, state.sequence
            if newest is not None and newest.sequence == self._sequence:
                break
        if newest is None:
            raise problem or BusTimeout("the boards only repeat old answers")
        return newest

    def _receive(self, timeout: float) -> StateFrame:
        frame = self._bus.receive(timeout)
        try:
            state = StateFrame.decode(frame)
        except FrameError:
            self._dropped["damaged"] += 1
            raise
        if state.session != self._group.session:
            self._dropped["foreign"] += 1
            raise FrameError(f"an answer to another bridge, of session {state.session:#x}")
        self._group.check(state)
        return state
