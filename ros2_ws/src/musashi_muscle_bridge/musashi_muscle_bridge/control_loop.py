"""The control thread: one frame out and one back per period, on absolute deadlines."""

import threading
import time
from collections.abc import Callable

from musashi_muscle_bridge.bus import Bus
from musashi_muscle_bridge.control import ControlPeriod
from musashi_muscle_bridge.errors import BusError, BusTimeout, FrameError
from musashi_muscle_bridge.protocol import StateFrame, is_newer

_MAX_FRAMES_PER_PERIOD = 64  # whatever floods the bus, the next command goes out


class ControlLoop:
    """Runs a ControlPeriod against a bus. `lock` guards the ControlPeriod."""

    def __init__(
        self,
        bus: Bus,
        control: ControlPeriod,
        lock: threading.Lock,
        rate: float,
        publish: Callable[[StateFrame], None],
    ) -> None:
        """Rate [Hz]; `publish` is called in the control thread with each state."""
        self._bus = bus
        self._control = control
        self._lock = lock
        self._period = 1.0 / rate
        self._publish = publish
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)
        self._replies = 0
        self._misses = 0
        self._overruns = 0
        self._worst_lateness = 0.0
        self._worst_round_trip = 0.0
        self._last_error = ""
        self._dropped = {"damaged": 0, "foreign": 0}
        self.misses_in_a_row = 0

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread and close the bus; frames stop."""
        self._stop.set()
        self._thread.join()
        self._bus.close()

    def statistics(self) -> dict[str, object]:
        """Return counts and times for diagnostics."""
        total = self._replies + self._misses
        return {
            "replies": self._replies,
            "misses": self._misses,
            "misses_in_a_row": self.misses_in_a_row,
            "success_rate": round(self._replies / total, 4) if total else 0.0,
            "overruns": self._overruns,
            "worst_lateness_ms": round(self._worst_lateness * 1e3, 3),
            "worst_round_trip_ms": round(self._worst_round_trip * 1e3, 3),
            "last_bus_error": self._last_error,
            **{f"dropped_{reason}": count for reason, count in self._dropped.items()},
            **{f"bus_{reason}": count for reason, count in self._bus.dropped.items()},
        }

    def _run(self) -> None:
        state: StateFrame | None = None
        deadline = time.monotonic()
        while not self._stop.is_set():
            fresh = self._exchange(state)
            if fresh is not None:
                state = fresh
                self._publish(fresh)
            deadline += self._period
            late = time.monotonic() - deadline
            if late > self._period:
                self._overruns += 1
                deadline = time.monotonic()
            elif late < 0.0:
                time.sleep(-late)
                self._worst_lateness = max(self._worst_lateness, time.monotonic() - deadline)

    def _exchange(self, last: StateFrame | None) -> StateFrame | None:
        """Send one command; return the newest state, or None if there is no new one."""
        with self._lock:
            # A missed answer changes nothing: the arbiter goes on from the last one.
            command = (
                self._control.first_command()
                if last is None
                else self._control.next_command(last, time.monotonic())
            )
        sent = time.monotonic()
        oldest = -1 if last is None else last.sequence
        try:
            self._bus.send(command.encode())
            state = self._await(command.sequence, oldest, sent + self._period)
        except (BusError, FrameError) as error:
            self._misses += 1
            self.misses_in_a_row += 1
            self._last_error = str(error)
            return None
        self._replies += 1
        self.misses_in_a_row = 0
        self._worst_round_trip = max(self._worst_round_trip, time.monotonic() - sent)
        return state

    def _await(self, sequence: int, oldest: int, deadline: float) -> StateFrame:
        """Return the answer to this frame, or at the deadline the newest late one."""
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
            if is_newer(state.sequence, oldest):
                newest, oldest = state, state.sequence
            if newest is not None and newest.sequence == sequence:
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
        if state.session != self._control.session:
            self._dropped["foreign"] += 1
            raise FrameError(f"an answer to another bridge, of session {state.session:#x}")
        self._control.check(state)
        return state
