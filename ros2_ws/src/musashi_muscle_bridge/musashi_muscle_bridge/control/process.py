"""The control loop in a process of its own: no callback, log line or other thread delays it.

One interpreter computes in one thread at a time, so a loop beside rclpy's callbacks waits for them.
The two processes share a channel and nothing else. Whichever of them ends, frames stop, and the
boards' watchdog acts.

What the kernel was asked for on behalf of the node, priority, cores and timer slack, the process
inherits: all of it belongs to the thread that starts it.
"""

import gc
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from musashi_muscle_bridge.buses.bus import open_all, open_bus
from musashi_muscle_bridge.control.channel import Channel, channel_pair
from musashi_muscle_bridge.control.loop import ControlLoop, LoopStatus, Measurement
from musashi_muscle_bridge.control.orders import Order
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.errors import BusError

_START_SEC = 30.0
_STOP_SEC = 2.0
_STANDING_SEC = 0.5
"""Without news of the control process, which tells ten times a second."""
_KEPT = 4
"""Measurements that may wait for their publication: fresh ones matter more than all of them."""
_OLD_SEC = 0.1
"""Age of measurements that are not published any more."""
_PROGRAM = "from musashi_muscle_bridge.control.process import main; main()"


@dataclass(frozen=True)
class LoopTask:
    """What the control process is to do; see ControlLoop.

    urls  one bus for each group of boards
    """

    control: ControlPeriod
    urls: Sequence[str]
    rate: float
    supervision_timeout: float


@dataclass(frozen=True)
class _Refused:
    text: str


@dataclass(frozen=True)
class _Died:
    text: str


class ControlProcess:
    """The node's side: starts the process, gives it orders, and takes what it measures.

    status       the newest LoopStatus
    unpublished  measurements that were dropped because they were old, or newer ones waited
    failures     measurements whose publication raised
    alive        whether the process runs
    """

    def __init__(
        self,
        task: LoopTask,
        publish: Callable[[Measurement], None],
        complain: Callable[[str], None],
        wanted: Callable[[], bool] = lambda: True,
    ) -> None:
        """Start the process, and wait until it has opened its buses.

        wanted    tells whether to go on waiting for that
        publish   is called with each measurement, in a thread of its own
        complain  is called with the traceback of what ended the process, or of the first
                  measurement that could not be published

        Raises BusError if a bus cannot be opened or the process does not start.
        """
        self._publish = publish
        self._complain = complain
        self.unpublished = 0
        self.failures = 0
        self._told = 0.0  # when the newest measurement was made [s]
        self._stopping = False
        self._channel, theirs = channel_pair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                env=_environment(),
                # Ctrl-C in a terminal is for the node, which ends the process in its turn.
                start_new_session=True,
            )
        try:
            self.status = self._begin(task, wanted)
        except BaseException:
            self._end()
            raise
        self._thread = threading.Thread(target=self._listen, name="states", daemon=True)
        self._thread.start()

    def _begin(self, task: LoopTask, wanted: Callable[[], bool]) -> LoopStatus:
        self._channel.put(task)
        deadline = time.monotonic() + _START_SEC
        while time.monotonic() < deadline and wanted() and not self._channel.closed:
            answer = self._channel.wait(0.1)
            if isinstance(answer, LoopStatus):
                return answer
            if isinstance(answer, _Refused):
                raise BusError(answer.text)
        raise BusError("the control process does not start")

    @property
    def pid(self) -> int:
        """The process's id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the process runs and can be talked to."""
        return not self._channel.closed and self._process.poll() is None

    @property
    def silence(self) -> float:
        """How long the process has told nothing [s]."""
        return time.monotonic() - max(self._told, self.status.time)

    @property
    def answers(self) -> bool:
        """Whether the process lives and goes on."""
        return self.alive and self.silence < _STANDING_SEC

    def order(self, order: Order) -> bool:
        """Have an order carried out before the next frame; never waits. False: it got lost."""
        return self._channel.put(order)

    def stop(self) -> None:
        """End the process; frames stop."""
        self._stopping = True
        self._channel.shut()
        self._thread.join(_STOP_SEC)
        self._end()

    def _end(self) -> None:
        self._channel.shut()
        try:
            self._process.wait(_STOP_SEC)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._channel.close()

    def _listen(self) -> None:
        while (item := self._channel.wait()) is not None:
            measured = []
            for one in (item, *self._channel.take()):
                if isinstance(one, Measurement):
                    measured.append(one)
                elif isinstance(one, LoopStatus):
                    self.status = one
                else:
                    self._complain(f"the control process died:\n{one.text}")
            self._take_measurements(measured)
        if not self._stopping:
            self._complain("the control process ended")

    def _take_measurements(self, measured: list[Measurement]) -> None:
        if measured:
            self._told = max(self._told, measured[-1].received)
        fresh_from = time.monotonic() - _OLD_SEC
        for number, one in enumerate(measured, start=1):
            if number > len(measured) - _KEPT and one.received > fresh_from:
                self._deliver(one)
            else:
                self.unpublished += 1

    def _deliver(self, measured: Measurement) -> None:
        try:
            self._publish(measured)
        except Exception:
            self.failures += 1
            if self.failures == 1:
                self._complain(traceback.format_exc())


def _environment() -> dict[str, str]:
    # The process finds this package, and the buses of others, where this one did.
    path = os.pathsep.join(filter(None, sys.path))
    return {**os.environ, "PYTHONPATH": path, "PYTHONSAFEPATH": "1"}


def main() -> None:
    """Be the control process; its argument is the number of the channel's socket."""
    # Who ends all processes of a service at once means the node, which ends this one in its turn.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    channel = Channel(socket.socket(fileno=int(sys.argv[1])))
    task: Any = channel.wait()
    if task is None:
        return
    try:
        buses = open_all(open_bus, task.urls)
    except BusError as error:
        channel.put(_Refused(str(error)))
        return
    try:
        loop = ControlLoop(buses, task.control, task.rate, task.supervision_timeout, channel)
        channel.put(loop.status())
        gc.freeze()  # what is there now stays
        loop.run()
    except Exception:
        traceback.print_exc()
        channel.put(_Died(traceback.format_exc()))
        raise SystemExit(1) from None
