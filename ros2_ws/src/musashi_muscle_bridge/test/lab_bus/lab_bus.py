"""A laboratory's own bus: Unix datagrams, `lab:///PATH`. Found through its entry points."""

import contextlib
import select
import socket
from collections.abc import Hashable
from pathlib import Path
from urllib.parse import urlsplit

from musashi_muscle_bridge.bus import MAX_FRAME, Received
from musashi_muscle_bridge.errors import BusError, BusTimeout


def _path(url: str) -> str:
    path = urlsplit(url).path
    if not path:
        raise BusError(f"bus_url '{url}': expected lab:///PATH")
    return path


class LabBus:
    """The bridge's end."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._boards = _path(url)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind("")  # an address of Linux's choice
        self._socket.setblocking(False)
        self.dropped: dict[str, int] = {}

    def send(self, frame: bytes) -> None:
        """Send a command frame; raises BusError."""
        try:
            self._socket.sendto(frame, self._boards)
        except BlockingIOError:
            return
        except OSError as error:
            raise BusError(f"{self._url}: {error.strerror}") from error

    def receive(self, timeout: float) -> bytes:
        """Return the next frame; raises BusTimeout after `timeout` [s]."""
        if not select.select([self._socket], [], [], max(timeout, 0.0))[0]:
            raise BusTimeout(f"{self._url}: no answer from the boards")
        return self._socket.recv(MAX_FRAME)

    def close(self) -> None:
        """Release the port."""
        self._socket.close()


class LabBoardPort:
    """The boards' end."""

    def __init__(self, url: str) -> None:
        self._path = Path(_path(url))
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            self._socket.bind(str(self._path))
        except OSError as error:
            self._socket.close()
            raise BusError(f"bus_url '{url}': {error.strerror}; remove the file") from error
        self._socket.setblocking(False)
        self.dropped: dict[str, int] = {}

    def receive(self, timeout: float) -> Received | None:
        """Return the next frame, or None after `timeout` [s]."""
        if not select.select([self._socket], [], [], timeout)[0]:
            return None
        frame, sender = self._socket.recvfrom(MAX_FRAME)
        return Received(frame, sender)

    def send(self, frame: bytes, to: Hashable) -> None:
        """Answer a sender; lost if it is gone."""
        with contextlib.suppress(OSError):
            self._socket.sendto(frame, to)  # type: ignore[call-overload]  # what `receive` gave

    def close(self) -> None:
        """Release the port."""
        self._socket.close()
        self._path.unlink(missing_ok=True)
