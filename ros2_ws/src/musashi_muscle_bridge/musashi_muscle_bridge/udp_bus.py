"""Frames as UDP datagrams; on loopback unless the URL says otherwise."""

import contextlib
import select
import socket
from urllib.parse import urlsplit

from musashi_muscle_bridge.errors import BusError, BusTimeout

_MAX_FRAME = 65507


def udp_address(url: str) -> tuple[str, int]:
    """Return host and port of `udp://HOST:PORT`; raises BusError naming the URL."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise BusError(f"bus_url '{url}': {error}; expected udp://HOST:PORT") from error
    if parts.scheme != "udp" or not host or not port:
        raise BusError(f"bus_url '{url}': expected udp://HOST:PORT, such as udp://127.0.0.1:48800")
    return host, port


def _open_socket(url: str) -> tuple[socket.socket, tuple[str, int]]:
    address = udp_address(url)
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM), address


class UdpBus:
    """The bridge's end; implements Bus. A connected socket: strangers' datagrams are dropped."""

    def __init__(self, url: str) -> None:
        """Connect to the boards at `url`; raises BusError."""
        self._url = url
        self._socket, address = _open_socket(url)
        try:
            self._socket.connect(address)
        except OSError as error:
            self._socket.close()
            raise BusError(f"bus_url '{url}': {error}") from error

    def send(self, frame: bytes) -> None:
        """Send a command frame; raises BusError."""
        try:
            self._socket.send(frame)
        except ConnectionRefusedError:
            # Nobody listened to an earlier frame; the missing reply tells.
            return
        except OSError as error:
            raise BusError(f"{self._url}: {error}") from error

    def receive(self, timeout: float) -> bytes:
        """Return the next frame; raises BusTimeout after `timeout` [s]."""
        self._socket.settimeout(max(timeout, 1e-6))
        try:
            return self._socket.recv(_MAX_FRAME)
        except (TimeoutError, ConnectionRefusedError) as error:
            raise BusTimeout(f"{self._url}: no answer from the boards") from error
        except OSError as error:
            raise BusError(f"{self._url}: {error}") from error

    def close(self) -> None:
        """Release the port."""
        self._socket.close()


class UdpBoardPort:
    """The boards' end: receives command frames, answers to where the last one came from."""

    def __init__(self, url: str) -> None:
        """Listen at `url`; raises BusError if the port is busy."""
        self._socket, address = _open_socket(url)
        try:
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise BusError(
                f"bus_url '{url}': {error.strerror}; is another mock driver running?"
            ) from error
        self._socket.setblocking(False)
        self._peer: tuple[str, int] | None = None

    def receive(self, timeout: float) -> bytes | None:
        """Return the next frame, or None after `timeout` [s]."""
        readable, _, _ = select.select([self._socket], [], [], timeout)
        if readable:
            with contextlib.suppress(OSError):
                frame, self._peer = self._socket.recvfrom(_MAX_FRAME)
                return bytes(frame)
        return None

    def send(self, frame: bytes) -> None:
        """Answer the last sender; lost if it is gone."""
        if self._peer is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto(frame, self._peer)

    def close(self) -> None:
        """Release the port."""
        self._socket.close()
