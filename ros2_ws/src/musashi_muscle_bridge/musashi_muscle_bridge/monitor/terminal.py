"""The terminal as a screen that is written line by line, and given back as it was found."""

import atexit
import contextlib
import os
import select
import sys
import termios
import time
from collections.abc import Mapping, Sequence
from typing import Any

from musashi_muscle_bridge.errors import BridgeError

_ENTER = b"\x1b[?1049h\x1b[?25l"  # the other screen, without a cursor
_LEAVE = b"\x1b[0m\x1b[?25h\x1b[?1049l"
_USUAL_SIZE = 80, 24
_FRAMES_UNTIL_ANEW = 50
_TIMEOUT_SEC = 1.0
_INPUT, _OUTPUT, _ERRORS = 0, 1, 2
_DISABLED = b"\x00"


class TerminalError(BridgeError):
    """There is no terminal to draw on."""


def require_terminal(environment: Mapping[str, str]) -> None:
    """Raise TerminalError unless keys can be read and lines be placed."""
    for number, name in ((_INPUT, "input"), (_OUTPUT, "output")):
        if not os.isatty(number):
            raise TerminalError(
                f"standard {name} is no terminal; over ssh, ask for one: ssh -t HOST ..."
            )
    if environment.get("TERM", "") in ("", "dumb"):
        raise TerminalError(
            f"TERM is '{environment.get('TERM', '')}', a terminal that cannot place lines; "
            "set it to what yours is, such as xterm"
        )


class Terminal:
    """The whole screen while it is open. Nothing here waits for a slow or stopped terminal."""

    def __init__(self) -> None:
        """Take the screen; `close` gives it back. Raises TerminalError if it is gone."""
        try:
            self._before = termios.tcgetattr(_INPUT)
            self._screen = _own_output()
        except (OSError, termios.error) as error:
            raise TerminalError(f"the terminal cannot be used: {error}") from error
        self._pending = _ENTER
        self._shown: list[str] = []
        self._frames = 0
        self._size = (0, 0)
        self._open = True
        atexit.register(self.close)
        termios.tcsetattr(_INPUT, termios.TCSANOW, _key_by_key(self._before))
        # What logs write would stand in the middle of the picture: it is shown at the end.
        self._kept = {number: _keep(number) for number in (_OUTPUT, _ERRORS) if os.isatty(number)}
        self._flush()

    def close(self) -> None:
        """Give the terminal back, and write what was logged meanwhile."""
        if not self._open:
            return
        self._open = False
        atexit.unregister(self.close)
        logged = b"".join(_give_back(number, *kept) for number, kept in self._kept.items())
        self._pending += _LEAVE + logged
        deadline = time.monotonic() + _TIMEOUT_SEC
        while self._pending and time.monotonic() < deadline:
            select.select([], [self._screen], [], _TIMEOUT_SEC / 10)
            self._flush()
        os.close(self._screen)
        with contextlib.suppress(termios.error):
            termios.tcsetattr(_INPUT, termios.TCSANOW, self._before)

    def typed(self) -> bytes | None:
        """Return what was typed since the last call; None: the terminal is gone."""
        if not select.select([_INPUT], [], [], 0)[0]:
            return b""
        try:
            return os.read(_INPUT, 1024) or None
        except OSError:
            return None

    def size(self) -> tuple[int, int]:
        """Return columns and lines."""
        try:
            size = os.get_terminal_size(self._screen)
        except OSError:
            return _USUAL_SIZE
        return (size.columns, size.lines) if size.columns and size.lines else _USUAL_SIZE

    def show(self, lines: Sequence[str]) -> None:
        """Write the lines that changed; a frame that the terminal has no time for is left out."""
        self._flush()
        if self._pending:
            return
        self._frames += 1
        # A message of the system to all terminals, or a new size, has spoilt the picture.
        if self.size() != self._size or self._frames % _FRAMES_UNTIL_ANEW == 0:
            self._size, self._shown = self.size(), []
        parts = [] if self._shown else ["\x1b[2J"]
        for number, line in enumerate(lines):
            if number >= len(self._shown) or self._shown[number] != line:
                parts.append(f"\x1b[{number + 1};1H{line}\x1b[0m\x1b[K")
        self._shown = list(lines)
        encoding = sys.__stdout__.encoding if sys.__stdout__ else "ascii"
        self._pending = "".join(parts).encode(encoding, errors="replace")
        self._flush()

    def _flush(self) -> None:
        try:
            while self._pending and select.select([], [self._screen], [], 0)[1]:
                self._pending = self._pending[os.write(self._screen, self._pending) :]
        except BlockingIOError:
            return
        except OSError:
            self._pending = b""  # gone; `typed` tells


def _own_output() -> int:
    """Return a descriptor that does not block, without making the shell's own one like it."""
    try:
        return os.open(os.ttyname(_OUTPUT), os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return os.dup(_OUTPUT)  # of another user, or of another container


def _key_by_key(attributes: list[Any]) -> list[Any]:
    """Return terminal attributes without echo and lines; Ctrl-C stays a signal.

    Neither Ctrl-S nor Ctrl-Z: a picture that stands still would look like the present.
    """
    changed = [*attributes[:6], list(attributes[6])]
    changed[0] &= ~termios.IXON
    changed[3] &= ~(termios.ICANON | termios.ECHO)
    changed[6][termios.VMIN], changed[6][termios.VTIME] = 1, 0
    changed[6][termios.VSUSP] = _DISABLED
    return changed


def _keep(number: int) -> tuple[int, int]:
    """Let a descriptor write into memory; returns descriptors of where it wrote and of that."""
    text = os.memfd_create("kept")
    there = os.dup(number)
    os.dup2(text, number)
    return there, text


def _give_back(number: int, there: int, text: int) -> bytes:
    """Let a descriptor write where it wrote before; returns what it wrote meanwhile."""
    os.dup2(there, number)
    os.close(there)
    with os.fdopen(text, "rb") as kept:
        kept.seek(0)
        return kept.read()
