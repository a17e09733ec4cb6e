"""The control loop in a process of its own: no callback, log line or other thread delays it.

One interpreter computes in one thread at a time, so a loop beside rclpy's callbacks waits for them.
The two processes share a channel and nothing else. Whichever of them ends, frames stop, and the
boards' watchdog acts.
"""

import gc
import os
import signal
import socket
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from musashi_muscle_bridge.bus import open_all, open_bus
from musashi_muscle_bridge.channel import Channel, channel_pair
from musashi_muscle_bridge.control import ControlPeriod
from musashi_muscle_bridge.control_loop import ControlLoop, LoopStatus, Measurement
from musashi_muscle_bridge.errors import BusError
from musashi_muscle_bridge.orders import Order

_STOP_SEC = 2.0
_PROGRAM = "from musashi_muscle_bridge.control_process import main; main()"


@dataclass(frozen=True)
class LoopTask:
    """What the control process is to do; see ControlLoop.

    urls  one bus for each group of boards
    """

    control: ControlPeriod
    urls: Sequence[str]
    rate: float
    patience: float


@dataclass(frozen=True)
class _Refused:
    text: str


@dataclass(frozen=True)
class _Died:
    text: str


class ControlProcess:
    """The node's side: starts the process, gives it orders, and takes what it measures.

    status  the newest LoopStatus
    alive   whether the process runs
    """

    def __init__(
        self,
        task: LoopTask,
        publish: Callable[[Measurement], None],
        complain: Callable[[str], None],
    ) -> None:
        """Start the process, and wait until it has opened its buses; raises BusError.

        publish   is called with each measurement, in a thread of its own
        complain  is called with the traceback of what ended the process, or of the first
                  measurement that could not be published
        """
        self._publish = publish
        self._complain = complain
        self._stopping = False
        self._publishing_failed = False
        self._channel, theirs = channel_pair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, str(theirs.fileno())],
                pass_fds=[theirs.fileno()],
                stdin=subprocess.DEVNULL,
                env=_environment(),
            )
        self._channel.put(task)
        answer = self._channel.wait()
        if not isinstance(answer, LoopStatus):
            self._end()
            text = answer.text if isinstance(answer, _Refused) else "it ended at once"
            raise BusError(text)
        self.status = answer
        self._thread = threading.Thread(target=self._listen, name="states", daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int:
        """The process's id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the process runs and can be talked to."""
        return not self._channel.closed and self._process.poll() is None

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
            if isinstance(item, Measurement):
                self._deliver(item)
            elif isinstance(item, LoopStatus):
                self.status = item
            else:
                self._complain(f"the control process died:\n{item.text}")
        if not self._stopping:
            self._complain("the control process ended")

    def _deliver(self, measured: Measurement) -> None:
        try:
            self._publish(measured)
        except Exception:
            if not self._publishing_failed:
                self._publishing_failed = True
                self._complain(traceback.format_exc())


def _environment() -> dict[str, str]:
    # The process finds this package, and the buses of others, where this one did.
    path = os.pathsep.join(filter(None, sys.path))
    return {**os.environ, "PYTHONPATH": path, "PYTHONSAFEPATH": "1"}


def main() -> None:
    """Be the control process; its argument is the number of the channel's socket."""
    # Ctrl-C reaches this process too; the node ends it in its turn.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
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
        loop = ControlLoop(buses, task.control, task.rate, task.patience, channel)
        channel.put(loop.status())
        gc.freeze()  # what is there now stays
        loop.run()
    except Exception:
        channel.put(_Died(traceback.format_exc()))
        raise SystemExit(1) from None
