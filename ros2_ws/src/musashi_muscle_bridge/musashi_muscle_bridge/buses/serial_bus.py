"""Frames over serial ports: USB-CDC devices, UARTs and pseudo-terminals."""

import errno
import math
import os
import pty
import time
import tty
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn
from urllib.parse import parse_qsl, urlsplit

import serial

from musashi_muscle_bridge.buses.bus import Received
from musashi_muscle_bridge.buses.serial_line import SerialLine
from musashi_muscle_bridge.errors import BusError, BusTimeout

_BAUDRATE = 1_000_000
_REOPEN_SEC = 0.1
_EXAMPLE = "serial:///dev/ttyACM0 or serial:///dev/ttyUSB0?baudrate=1000000"
_REMEDIES = {
    errno.ENOENT: "no such port; is the cable plugged in?",
    errno.EAGAIN: "the port is busy; end the other program that has it open",
    errno.EBUSY: "the port is busy; end the other program that has it open",
    errno.EACCES: "no permission; add this user to the group that owns the port, often dialout",
}


@dataclass(frozen=True)
class SerialAddress:
    """What a `serial:` URL says.

    baudrate  [bit/s]; USB-CDC devices and pseudo-terminals ignore it
    pty       the boards' end makes a pseudo-terminal there; for the mock driver
    """

    path: Path
    baudrate: int = _BAUDRATE
    pty: bool = False


def serial_address(url: str) -> SerialAddress:
    """Read `serial:///PATH?baudrate=N&pty=true`; raises BusError naming the URL."""

    def refuse(why: str) -> NoReturn:
        raise BusError(f"bus_url '{url}': {why}, such as {_EXAMPLE}")

    parts = urlsplit(url)
    if parts.scheme != "serial" or parts.netloc or parts.path in ("", "/") or parts.fragment:
        refuse("expected serial:///PATH")
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    for key in options:
        if key not in ("baudrate", "pty"):
            refuse(f"unknown option '{key}', choose from: baudrate, pty")
    baudrate = options.get("baudrate", str(_BAUDRATE))
    if not baudrate.isascii() or not baudrate.isdigit() or not 0 < int(baudrate) <= 100_000_000:
        refuse(f"baudrate is '{baudrate}', expected 1 to 100000000")
    terminal = options.get("pty", "false")
    if terminal not in ("true", "false"):
        refuse(f"pty is '{terminal}', expected true or false")
    return SerialAddress(Path(parts.path), int(baudrate), terminal == "true")


def _open_device(url: str, address: SerialAddress) -> SerialLine:
    try:
        device = serial.Serial(str(address.path), address.baudrate, timeout=0, exclusive=True)
        device.reset_input_buffer()
    except (OSError, ValueError) as error:  # SerialException is an OSError
        number = error.errno if isinstance(error, OSError) else None
        why = _REMEDIES.get(number or 0, f"not usable as a serial port: {error}")
        if number == errno.ENOENT and address.pty:
            why = "no such port; is the mock driver running?"
        raise BusError(f"bus_url '{url}': {why}") from error
    return SerialLine(device.fileno(), device.close)


def _make_terminal(url: str, address: SerialAddress) -> SerialLine:
    """Make a pseudo-terminal and a link to it; the link of a mock that was killed gives way."""
    if address.path.exists():
        raise BusError(
            f"bus_url '{url}': {address.path} exists; is another mock driver running? "
            "If not, remove it"
        )
    boards, bridge = pty.openpty()
    tty.setraw(bridge)
    os.set_blocking(boards, False)
    name = os.ttyname(bridge)

    def close() -> None:
        with suppress(OSError):
            if os.readlink(address.path) == name:
                address.path.unlink()
        os.close(boards)
        os.close(bridge)  # open until now: a bridge may come and go

    line = SerialLine(boards, close)
    try:
        if address.path.is_symlink():
            address.path.unlink()
        address.path.symlink_to(name)
    except OSError as error:
        line.close()
        raise BusError(f"bus_url '{url}': {error.strerror}; choose another path") from error
    return line


class _Plug:
    """A line that may be unplugged, and is opened again when it is back."""

    def __init__(self, url: str, connect: Callable[[str, SerialAddress], SerialLine]) -> None:
        self._url = url
        self._connect = connect
        self._address = serial_address(url)
        self._tried = -math.inf
        self._open: SerialLine | None = None
        self._before: dict[str, int] = {"unplugged": 0}

    @property
    def dropped(self) -> dict[str, int]:
        """Counts of this line and of those before it."""
        line = self._open
        now = {} if line is None else line.dropped
        reasons = self._before.keys() | now.keys()
        return {key: self._before.get(key, 0) + now.get(key, 0) for key in sorted(reasons)}

    def line(self) -> SerialLine:
        """Return the open line; raises BusError while there is none."""
        if self._open is None:
            if time.monotonic() - self._tried < _REOPEN_SEC:
                raise BusError(f"{self._url}: unplugged")
            self._tried = time.monotonic()
            self._open = self._connect(self._url, self._address)
        return self._open

    def lost(self) -> None:
        """Close a line that raised."""
        self._before = self.dropped
        self._before["unplugged"] += 1
        self._release()

    def close(self) -> None:
        """Close the line for good."""
        self._release()
        self._tried = math.inf

    def _release(self) -> None:
        line, self._open = self._open, None
        if line is not None:
            with suppress(OSError):
                line.close()


class SerialBus:
    """The bridge's end; implements Bus."""

    def __init__(self, url: str) -> None:
        """Open the port; raises BusError if it is absent or busy.

        The mock driver's pseudo-terminal may come later: with `pty=true` absence is no error yet.
        """
        self._url = url
        self._plug = _Plug(url, _open_device)
        address = serial_address(url)
        if address.path.exists() or not address.pty:
            self._plug.line()

    @property
    def dropped(self) -> dict[str, int]:
        """See SerialLine; and how often the port was unplugged."""
        return self._plug.dropped

    def send(self, frame: bytes) -> None:
        """Send a command frame; raises BusError while the port is unplugged."""
        try:
            self._plug.line().send(frame)
        except BusError:
            raise
        except (OSError, ValueError) as error:
            self._plug.lost()
            raise BusError(f"{self._url}: {error}") from error

    def receive(self, timeout: float) -> bytes:
        """Return the next frame; raises BusTimeout after `timeout` [s]."""
        try:
            frame = self._plug.line().receive(timeout)
        except BusError:
            raise
        except (OSError, ValueError) as error:
            self._plug.lost()
            raise BusError(f"{self._url}: {error}") from error
        if frame is None:
            raise BusTimeout(f"{self._url}: no answer from the boards")
        return frame

    def close(self) -> None:
        """Release the port."""
        self._plug.close()


class SerialBoardPort:
    """The boards' end; implements BoardPort. There is one bridge at most: the sender is None."""

    def __init__(self, url: str) -> None:
        """Open the device, or make the pseudo-terminal; raises BusError."""
        terminal = serial_address(url).pty
        self._plug = _Plug(url, _make_terminal if terminal else _open_device)
        self._plug.line()

    @property
    def dropped(self) -> dict[str, int]:
        """See SerialLine; and how often the port was unplugged."""
        return self._plug.dropped

    def receive(self, timeout: float) -> Received | None:
        """Return the next frame, or None after `timeout` [s]."""
        try:
            frame = self._plug.line().receive(timeout)
        except BusError:
            time.sleep(timeout)
            return None
        except (OSError, ValueError):
            self._plug.lost()
            return None
        return None if frame is None else Received(frame, None)

    def send(self, frame: bytes, to: Hashable) -> None:
        """Answer the bridge; lost if it is gone."""
        try:
            self._plug.line().send(frame)
        except BusError:
            return
        except (OSError, ValueError):
            self._plug.lost()

    def close(self) -> None:
        """Release the port."""
        self._plug.close()
