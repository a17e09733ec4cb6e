"""Whole objects between two processes of this computer, in order; nobody ever waits to send one."""

import pickle
import select
import socket
from typing import Any

_LARGEST = 1 << 18
"""[bytes] of one object; the measurement of 74 muscles has less than 10,000."""


class Channel:
    """One end of a connection to a process that is trusted like this one: it carries pickles.

    closed  whether the other end is gone
    """

    def __init__(self, end: socket.socket) -> None:
        """Take a connected socket of type SOCK_SEQPACKET."""
        end.setblocking(True)
        self._socket = end
        self._buffer = bytearray(_LARGEST)
        self._view = memoryview(self._buffer)
        self.closed = False

    def put(self, item: object) -> bool:
        """Send an object; return whether it went: the other end may be gone, or stand still."""
        try:
            self._socket.send(pickle.dumps(item, pickle.HIGHEST_PROTOCOL), socket.MSG_DONTWAIT)
        except OSError:
            return False
        return True

    def take(self) -> list[Any]:
        """Return what has come; empty if nothing has, or if the channel is closed."""
        items = []
        while (item := self._receive(socket.MSG_DONTWAIT)) is not None:
            items.append(item)
        return items

    def wait(self, timeout: float | None = None) -> Any:
        """Return the next object as soon as it comes; None if the other end is gone.

        None also after `timeout` [s], where it is given; `closed` tells the two apart.
        """
        if timeout is not None and not select.select([self._socket], [], [], timeout)[0]:
            return None
        return self._receive(0)

    def _receive(self, flags: int) -> Any:
        try:
            try:
                count = self._socket.recv_into(self._buffer, _LARGEST, flags)
            except ConnectionResetError:
                # The other end left something unread; what it had sent before comes after this.
                count = self._socket.recv_into(self._buffer, _LARGEST, flags)
        except BlockingIOError:
            return None
        except OSError:
            count = 0
        if count == 0:
            self.closed = True
            return None
        return pickle.loads(self._view[:count])

    def shut(self) -> None:
        """Tell the other end that nothing more comes, and end a `wait` of this one."""
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            return  # the other end was faster

    def close(self) -> None:
        """Release the socket."""
        self._socket.close()


def channel_pair() -> tuple[Channel, socket.socket]:
    """Return one end, and the socket of the other one, for another process."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    return Channel(ours), theirs
