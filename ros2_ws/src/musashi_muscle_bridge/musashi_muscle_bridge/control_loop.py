"""The control thread: one frame out and one back per bus and period, on absolute deadlines.

It shares no lock with anybody. What others want from it waits in a queue until its next period;
what others may know of it lies in objects that it replaces and never changes.
"""

import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

from musashi_muscle_bridge.bus import Bus
from musashi_muscle_bridge.bus_line import BusLine
from musashi_muscle_bridge.control import ControlPeriod, ControlReport
from musashi_muscle_bridge.loop_timing import LoopTiming
from musashi_muscle_bridge.outlet import Outlet
from musashi_muscle_bridge.protocol import StateFrame

Order = Callable[[], None]


class Measurement(NamedTuple):
    """What one period measured.

    state         of the whole robot; a group that did not answer shows its last measurement
    report        what was latched then
    joints_fresh  whether every group that measures joints answered in this period
    received      monotonic time [s]
    """

    state: StateFrame
    report: ControlReport
    joints_fresh: bool
    received: float


class ControlLoop:
    """Runs a ControlPeriod against one bus for each of its groups.

    report  what was latched in the last period
    """

    def __init__(
        self,
        buses: Sequence[Bus],
        control: ControlPeriod,
        rate: float,
        publish: Callable[[Measurement], None],
        complain: Callable[[str], None],
    ) -> None:
        """Compose the loop.

        rate      [Hz]
        publish   is called with each measurement, in a thread that may wait for others
        complain  is called with the traceback of what ended a thread
        """
        self._control = control
        self._lines = [
            BusLine(bus, group) for bus, group in zip(buses, control.groups, strict=True)
        ]
        self._period = 1.0 / rate
        self._orders: deque[Order] = deque()
        self._outlet = Outlet(publish, complain)
        self._complain = complain
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="control", daemon=True)
        self._timing = LoopTiming(self._period)
        self._overruns = 0
        self._worst_lateness = 0.0
        self.report = control.report(time.monotonic())

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    @property
    def silent(self) -> list[int]:
        """Which buses did not answer in the last period, by position."""
        return [number for number, line in enumerate(self._lines) if line.misses_in_a_row]

    @property
    def misses_in_a_row(self) -> int:
        """Periods without an answer since the last one, on the bus where it is worst."""
        return max(line.misses_in_a_row for line in self._lines)

    def start(self) -> None:
        """Start the threads."""
        self._outlet.start()
        self._thread.start()

    def stop(self) -> None:
        """End the threads and close the buses; frames stop."""
        self._stop.set()
        self._thread.join()
        for line in self._lines:
            line.close()
        self._outlet.stop()

    def order(self, order: Order) -> None:
        """Let the control thread call `order` before its next command; never waits.

        An order must not raise: check before what it does.
        """
        self._orders.append(order)

    def order_first(self, order: Order) -> None:
        """Do the same, and forget all orders that were not carried out yet."""
        self._orders.clear()
        self._orders.append(order)

    def statistics(self) -> dict[str, object]:
        """Return counts and times for diagnostics; all buses together, then each of several."""
        lines = self._lines
        timing = self._timing.latest
        values: dict[str, object] = {
            "rate_hz": round(timing.rate, 1),
            "period_jitter_ms": round(timing.jitter * 1e3, 3),
            "longest_period_ms": round(timing.longest * 1e3, 3),
            "late_periods": self._timing.late,
            "overruns": self._overruns,
            "worst_lateness_ms": round(self._worst_lateness * 1e3, 3),
            "round_trip_ms": round(timing.round_trip * 1e3, 3),
            "worst_round_trip_ms": round(max(line.worst_round_trip for line in lines) * 1e3, 3),
            "unpublished_states": self._outlet.lost,
            **_counts(lines),
            "last_bus_error": next((line.last_error for line in lines if line.last_error), ""),
        }
        for number, line in enumerate(lines if len(lines) > 1 else ()):
            own = {**_counts([line]), "last_bus_error": line.last_error}
            values |= {f"bus{number}_{key}": value for key, value in own.items()}
        return values

    # The control thread.

    def _run(self) -> None:
        try:
            self._live()
        except Exception:
            # Nobody sends frames now: the boards' watchdog acts.
            self._complain(f"the control thread died:\n{traceback.format_exc()}")

    def _live(self) -> None:
        deadline = time.monotonic()
        while not self._stop.is_set():
            self._timing.begin(time.monotonic())
            self._carry_out_orders()
            self._exchange()
            deadline += self._period
            late = time.monotonic() - deadline
            if late > self._period:
                self._overruns += 1
                deadline = time.monotonic()
            elif late < 0.0:
                time.sleep(-late)
                self._worst_lateness = max(self._worst_lateness, time.monotonic() - deadline)

    def _carry_out_orders(self) -> None:
        for _ in range(len(self._orders)):
            try:
                order = self._orders.popleft()
            except IndexError:
                return  # an emergency stop forgot them
            order()

    def _exchange(self) -> None:
        """Send one command on each bus, and take the answers."""
        # A missed answer changes nothing: the arbiter goes on from the last one.
        now = time.monotonic()
        lines = self._lines
        commands = self._control.next_commands([line.state for line in lines], now)
        self.report = self._control.report(now)
        for line, command in zip(lines, commands, strict=True):
            line.send(command)
        # A silent bus is asked last, so that it does not make the others' answers wait.
        fresh = {
            number
            for number in sorted(range(len(lines)), key=lambda n: lines[n].misses_in_a_row)
            if lines[number].answered(now + self._period)
        }
        for number in fresh:
            self._timing.answered(lines[number].round_trip)
        states = [line.state for line in lines if line.state is not None]
        if fresh and len(states) == len(lines):
            self._outlet.put(
                Measurement(
                    self._control.merged(states),
                    self.report,
                    all(n in fresh for n, g in enumerate(self._control.groups) if g.joints.size),
                    time.monotonic(),
                )
            )


def _counts(lines: Sequence[BusLine]) -> dict[str, object]:
    replies, misses = sum(line.replies for line in lines), sum(line.misses for line in lines)
    total = replies + misses
    dropped: dict[str, int] = {}
    for line in lines:
        for reason, count in line.dropped.items():
            dropped[reason] = dropped.get(reason, 0) + count
    return {
        "replies": replies,
        "misses": misses,
        "misses_in_a_row": max(line.misses_in_a_row for line in lines),
        "success_rate": round(replies / total, 4) if total else 0.0,
        **dropped,
    }
