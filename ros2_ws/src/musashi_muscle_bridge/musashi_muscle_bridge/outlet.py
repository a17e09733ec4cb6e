"""Hands what the control thread measured to a thread that may wait for others."""

import threading
import traceback
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

_Item = TypeVar("_Item")

_KEPT = 16


class Outlet(Generic[_Item]):
    """Calls `deliver` in a thread of its own with each item, in order.

    However long `deliver` takes, `put` returns at once: beyond 16 waiting items the oldest are
    lost and counted.

    lost    items that were never delivered
    errors  calls of `deliver` that raised; `complain` is told the first one's traceback
    """

    def __init__(self, deliver: Callable[[_Item], None], complain: Callable[[str], None]) -> None:
        self._deliver = deliver
        self._complain = complain
        self._items: deque[_Item] = deque()
        self._wake = threading.Semaphore(0)
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="outlet", daemon=True)
        self.lost = 0
        self.errors = 0

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self, timeout: float = 1.0) -> None:
        """End the thread after what waits; give up after `timeout` [s]."""
        self._ended = True
        self._wake.release()
        self._thread.join(timeout)

    def put(self, item: _Item) -> None:
        """Take an item; never waits."""
        self._items.append(item)
        self._wake.release()

    def _run(self) -> None:
        while True:
            self._wake.acquire()
            while len(self._items) > _KEPT:
                self._items.popleft()
                self.lost += 1
            if not self._items:
                if self._ended:
                    return
                continue
            self._deliver_one(self._items.popleft())

    def _deliver_one(self, item: _Item) -> None:
        try:
            self._deliver(item)
        except Exception:
            self.errors += 1
            if self.errors == 1:
                self._complain(traceback.format_exc())
