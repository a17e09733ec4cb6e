"""The control loop: one frame out and one back per bus and period, on absolute deadlines.

It waits for nobody but the boards. What others want of it, and what they may know, goes through a
channel whose ends never wait for each other.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from fastswing_planner.arrays import BoolVector
from musashi_muscle_bridge.buses.bus import Bus
from musashi_muscle_bridge.buses.protocol import StateFrame
from musashi_muscle_bridge.control.bus_line import BusLine
from musashi_muscle_bridge.control.channel import Channel
from musashi_muscle_bridge.control.loop_timing import LoopTiming, Schedule
from musashi_muscle_bridge.control.orders import EmergencyStop, after_the_last_stop
from musashi_muscle_bridge.control.period import ControlPeriod, ControlReport

_STATUS_PERIOD_SEC = 0.1
_LOST_FRAMES = 5
"""That many in a row can get lost on a bus that is alive."""


class Measurement(NamedTuple):
    """What one period measured.

    state         of the whole robot; a group that did not answer shows its last measurement
    lost          muscles whose group is lost, shape (m,)
    joints_fresh  whether every group that measures joints answered in this period
    received      monotonic time [s]; of a late answer, when its command was sent
    """

    state: StateFrame
    lost: BoolVector
    joints_fresh: bool
    received: float

    def __reduce__(self) -> tuple[Callable[..., "Measurement"], tuple[Any, ...]]:
        """Pickle arrays as their bytes, which takes a tenth of the time."""
        return _measurement, (self.state, self.lost.tobytes(), self.joints_fresh, self.received)


def _measurement(
    state: StateFrame, lost: bytes, joints_fresh: bool, received: float
) -> Measurement:
    return Measurement(state, np.frombuffer(lost, dtype=bool), joints_fresh, received)


@dataclass(frozen=True)
class LoopStatus:
    """What the loop tells ten times a second.

    time        [s] monotonic
    report      what is latched
    statistics  counts and times for diagnostics; all buses together, then each of several
    silent      which buses have not answered for more than 5 periods, by position
    """

    time: float
    report: ControlReport
    statistics: dict[str, object]
    silent: tuple[int, ...]


class ControlLoop:
    """Runs a ControlPeriod against one bus for each of its groups."""

    def __init__(
        self,
        buses: Sequence[Bus],
        control: ControlPeriod,
        rate: float,
        supervision_timeout: float,
        channel: Channel,
    ) -> None:
        """Compose the loop.

        rate                 [Hz]
        supervision_timeout  [s] without an order, a heartbeat at least, after which no frames are
                             sent; none is sent before the first
        channel              takes orders, and brings measurements and LoopStatus
        """
        self._control = control
        self._lines = [
            BusLine(bus, group) for bus, group in zip(buses, control.groups, strict=True)
        ]
        self._period = 1.0 / rate
        self._supervision_timeout = supervision_timeout
        self._channel = channel
        self._timing = LoopTiming(self._period)
        self._schedule = Schedule(0.0, self._period)
        self._running = 0.0  # [s] from the first frame to the present period
        self._worst_lateness = 0.0
        self._untaken = 0
        self._unsupervised = 0

    def run(self) -> None:
        """Send frames until the channel is closed; then close the buses."""
        try:
            self._run()
        finally:
            for line in self._lines:
                line.close()

    def _run(self) -> None:
        told = time.monotonic()
        self._schedule = Schedule(told, self._period)
        heard, began = -math.inf, math.inf
        while True:
            now = time.monotonic()
            self._timing.begin(now)
            orders = after_the_last_stop(self._channel.take())
            for order in orders:
                order.carry_out(self._control)
            if self._channel.closed:
                if any(isinstance(order, EmergencyStop) for order in orders):
                    self._exchange(now)  # boards that hold without frames must not hold then
                return
            if orders:
                if heard == -math.inf:
                    began, self._schedule = now, Schedule(now, self._period)
                heard = now
            self._running = max(now - began, 0.0)
            if now - heard <= self._supervision_timeout:
                self._exchange(now)
            else:
                # Nobody could stop the arm now: its boards' watchdog shall.
                self._unsupervised += heard > -math.inf
            if now - told >= _STATUS_PERIOD_SEC:
                self._channel.put(self.status())
                told = now
            wait = self._schedule.next(time.monotonic())
            if wait > 0.0:
                time.sleep(wait)
                lateness = time.monotonic() - self._schedule.deadline
                self._worst_lateness = max(self._worst_lateness, lateness)

    def _exchange(self, now: float) -> None:
        """Send one command on each bus, and take the answers."""
        # A missed answer changes nothing: the arbiter goes on from the last one.
        lines = self._lines
        commands = self._control.next_commands([line.state for line in lines], now)
        for line, command in zip(lines, commands, strict=True):
            line.send(command)
        # Who waited a whole period for a silent bus would be later with each frame. A period that
        # began late waits for half of one: else a loop that is always late would hear nothing.
        timeout = max(self._schedule.deadline - now, -0.5 * self._period) + self._period
        # A silent bus is asked last, so that it does not make the others' answers wait.
        fresh = {
            number
            for number in sorted(range(len(lines)), key=lambda n: lines[n].misses_in_a_row)
            if lines[number].answered(now + timeout)
        }
        for number in fresh:
            self._timing.answered(lines[number].round_trip)
        states = [line.state for line in lines if line.state is not None]
        if fresh and len(states) == len(lines):
            groups = enumerate(self._control.groups)
            measured = Measurement(
                self._control.merged(states),
                self._control.lost,
                all(number in fresh for number, group in groups if group.joints.size),
                min(lines[number].measured for number in fresh),
            )
            self._untaken += not self._channel.put(measured)

    def status(self) -> LoopStatus:
        """Return what it would tell now."""
        now = time.monotonic()
        return LoopStatus(
            now,
            self._control.report(now),
            self._statistics(),
            tuple(
                number
                for number, line in enumerate(self._lines)
                if line.misses_in_a_row > _LOST_FRAMES
            ),
        )

    def _statistics(self) -> dict[str, object]:
        lines, timing = self._lines, self._timing.latest
        values: dict[str, object] = {
            "rate_hz": round(timing.rate, 1),
            "period_jitter_ms": round(timing.jitter * 1e3, 3),
            "longest_period_ms": round(timing.longest * 1e3, 3),
            "late_periods": self._timing.late,
            "running_s": round(self._running, 4),
            "overruns": self._schedule.skipped,
            "worst_lateness_ms": round(self._worst_lateness * 1e3, 3),
            "round_trip_ms": round(timing.round_trip * 1e3, 3),
            "worst_round_trip_ms": round(max(line.worst_round_trip for line in lines) * 1e3, 3),
            "untaken_states": self._untaken,
            "unsupervised_periods": self._unsupervised,
            **_counts(lines),
            "last_bus_error": next((line.last_error for line in lines if line.last_error), ""),
        }
        for number, line in enumerate(lines if len(lines) > 1 else ()):
            own = {**_counts([line]), "last_bus_error": line.last_error}
            values |= {f"bus{number}_{key}": value for key, value in own.items()}
        return values


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
        "late_answers": sum(line.late for line in lines),
        "misses_in_a_row": max(line.misses_in_a_row for line in lines),
        "success_rate": round(replies / total, 4) if total else 0.0,
        **dropped,
    }
