"""Frames as UDP datagrams; on loopback unless the URL says otherwise."""

import contextlib
import math
import select
import socket
import struct
import time
from collections.abc import Hashable
from urllib.parse import urlsplit

from fastswing_planner.cdr.stamps import NS_PER_SEC, to_ns
from musashi_muscle_bridge.buses.bus import MAX_FRAME, Received
from musashi_muscle_bridge.errors import BusError, BusTimeout

_Address = tuple[str, int]
_SO_TIMESTAMPNS = 35
"""Linux's option and control message; Python's socket module does not name it."""
_LONGEST_AGE_NS = NS_PER_SEC
_TIMESPEC = struct.Struct("qq")
_NOTES_SIZE = socket.CMSG_SPACE(_TIMESPEC.size)


def udp_address(url: str) -> _Address:
    """Return host and port of `udp://HOST:PORT`; raises BusError naming the URL."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise BusError(f"bus_url '{url}': {error}; expected udp://HOST:PORT") from error
    more = parts.path.strip("/") or parts.query or parts.fragment or parts.username
    if parts.scheme != "udp" or not host or not port or more:
        raise BusError(f"bus_url '{url}': expected udp://HOST:PORT, such as udp://127.0.0.1:48800")
    return host, port


def _resolved(url: str) -> _Address:
    host, port = udp_address(url)
    try:
        return socket.gethostbyname(host), port
    except OSError as error:
        raise BusError(
            f"bus_url '{url}': {error.strerror}: '{host}'; write the boards' IPv4 address"
        ) from error


def _route(url: str, address: _Address) -> str:
    """Return this machine's address on the way to another one."""
    if address[0] == "0.0.0.0":
        raise BusError(f"bus_url '{url}': 0.0.0.0 is no address of boards; write theirs")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(address)
        except OSError as error:
            raise BusError(f"bus_url '{url}': {error.strerror}; is the network up?") from error
        here: str = probe.getsockname()[0]
        return here


class UdpBus:
    """The bridge's end; implements Bus. Datagrams of strangers are dropped and counted."""

    def __init__(self, url: str) -> None:
        """Get a port on the way to the boards at `url`; raises BusError."""
        self._url = url
        self._boards = _resolved(url)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((_route(url, self._boards), 0))
        self._socket.setblocking(False)
        self.address: _Address = self._socket.getsockname()
        self.dropped = {"stranger": 0}

    def send(self, frame: bytes) -> None:
        """Send a command frame; raises BusError."""
        try:
            self._socket.sendto(frame, self._boards)
        except BlockingIOError:
            return  # a full send buffer loses the frame, and the missing answer tells
        except OSError as error:
            raise BusError(f"{self._url}: {error}") from error

    def receive(self, timeout: float) -> bytes:
        """Return the next frame; raises BusTimeout after `timeout` [s]."""
        deadline = time.monotonic() + timeout
        try:
            while select.select([self._socket], [], [], max(deadline - time.monotonic(), 0.0))[0]:
                frame, sender = self._socket.recvfrom(MAX_FRAME)
                if sender == self._boards:
                    return bytes(frame)
                self.dropped["stranger"] += 1
                if time.monotonic() > deadline:
                    break
        except OSError as error:
            raise BusError(f"{self._url}: {error}") from error
        raise BusTimeout(f"{self._url}: no answer from the boards")

    def close(self) -> None:
        """Release the port."""
        self._socket.close()


class UdpBoardPort:
    """The boards' end; implements BoardPort."""

    def __init__(self, url: str) -> None:
        """Listen at `url`; raises BusError if the port is busy."""
        address = _resolved(url)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise BusError(
                f"bus_url '{url}': {error.strerror}; is another mock driver running?"
            ) from error
        self._socket.setblocking(False)
        with contextlib.suppress(OSError):
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self.dropped: dict[str, int] = {}

    def receive(self, timeout: float) -> Received | None:
        """Return the next frame, or None after `timeout` [s]."""
        readable, _, _ = select.select([self._socket], [], [], timeout)
        if readable:
            with contextlib.suppress(OSError):
                frame, notes, _, sender = self._socket.recvmsg(MAX_FRAME, _NOTES_SIZE)
                return Received(frame, sender, _arrival(notes))
        return None

    def send(self, frame: bytes, to: Hashable) -> None:
        """Answer a sender; lost if it is gone."""
        with contextlib.suppress(OSError):
            self._socket.sendto(frame, to)  # type: ignore[call-overload]  # what `receive` gave

    def close(self) -> None:
        """Release the port."""
        self._socket.close()


def _arrival(notes: list[tuple[int, int, bytes]]) -> float:
    """Return when the kernel took a frame in, on the monotonic clock [s]; NaN if it is not known.

    A process that is late to read its socket does not make the frame late.
    """
    for _, kind, data in notes:
        if kind == _SO_TIMESTAMPNS and len(data) == _TIMESPEC.size:
            age = time.time_ns() - to_ns(*_TIMESPEC.unpack(data))
            # Another age means that the clock was set meanwhile.
            return time.monotonic() - age * 1e-9 if 0 <= age < _LONGEST_AGE_NS else math.nan
    return math.nan
