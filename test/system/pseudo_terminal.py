"""A program in a pseudo-terminal: what stands on its screen, and keys for it."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import termios
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

_PIECES = re.compile(r"\x1b\[(?P<parameters>[0-9;?]*)(?P<command>[A-Za-z])|(?P<text>[^\x1b]+)")


class Screen:
    """Obeys as much of ANSI as the monitor uses, and refuses the rest.

    alternate  whether the program has the screen to itself
    cursor     whether it is shown
    """

    def __init__(self, width: int, height: int) -> None:
        self.alternate = False
        self.cursor = True
        self.coloured = False
        self.written_after = ""
        self._cells = [[" "] * width for _ in range(height)]
        self._at = (0, 0)

    @property
    def lines(self) -> list[str]:
        return ["".join(row).rstrip() for row in self._cells]

    def write(self, text: str) -> str:
        """Obey; returns what is the beginning of a sequence that has not ended."""
        cut = text.rfind("\x1b")
        unfinished = cut >= 0 and not re.match(r"\x1b\[[0-9;?]*[A-Za-z]", text[cut:])
        whole, rest = (text[:cut], text[cut:]) if unfinished else (text, "")
        at = 0
        for piece in _PIECES.finditer(whole):
            assert piece.start() == at, repr(whole[at : piece.start()])
            at = piece.end()
            if piece["text"]:
                self._put(piece["text"])
            else:
                self._obey(piece["command"], piece["parameters"])
        assert at == len(whole), repr(whole[at:])
        return rest

    def _put(self, text: str) -> None:
        if not self.alternate:
            self.written_after += text
            return
        row, column = self._at
        for letter in text:
            self._cells[row][column] = letter
            column += 1
        self._at = row, column

    def _obey(self, command: str, parameters: str) -> None:
        if command == "H":
            row, column = map(int, parameters.split(";"))
            self._at = row - 1, column - 1
        elif command == "K":
            row, column = self._at
            self._cells[row][column:] = [" "] * (len(self._cells[row]) - column)
        elif command == "J":
            self._cells = [[" "] * len(row) for row in self._cells]
        elif command in "hl" and parameters == "?1049":
            self.alternate = command == "h"
        elif command in "hl" and parameters == "?25":
            self.cursor = command == "h"
        elif command == "m":
            self.coloured |= bool(re.search(r"\b[349][0-7]\b", parameters))
        else:
            raise AssertionError(f"unknown: ESC [ {parameters} {command}")


class PseudoTerminal:
    """One program in a terminal of its own."""

    def __init__(
        self,
        command: Sequence[str],
        environment: Mapping[str, str],
        width: int = 80,
        height: int = 24,
    ) -> None:
        self.screen = Screen(width, height)
        self._ours, self._theirs = pty.openpty()
        size = struct.pack("HHHH", height, width, 0, 0)
        fcntl.ioctl(self._theirs, termios.TIOCSWINSZ, size)
        self.before = self.attributes()
        self._rest = ""
        self._ended = threading.Event()
        self._frozen = threading.Event()
        self.process = subprocess.Popen(
            command,
            env={**environment, "TERM": "xterm-256color"},
            stdin=self._theirs,
            stdout=self._theirs,
            stderr=self._theirs,
            start_new_session=True,
            # So that Ctrl-C reaches it.
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        # Read all the time: whatever the test does, the program's terminal has time for it.
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def attributes(self) -> list[Any]:
        """Return the terminal's settings: echo, lines, special characters."""
        return termios.tcgetattr(self._theirs)

    def _read(self) -> None:
        while not self._ended.is_set():
            if self._frozen.is_set():
                time.sleep(0.05)
            elif select.select([self._ours], [], [], 0.05)[0]:
                text = os.read(self._ours, 65536).decode()
                self._rest = self.screen.write(self._rest + text)

    def freeze(self) -> None:
        """Take nothing more that the program writes, as a connection that hangs."""
        self._frozen.set()

    def type(self, keys: str) -> None:
        """Press keys."""
        os.write(self._ours, keys.encode())

    def shows(self, text: str) -> Callable[[], bool]:
        """Return a condition: the text stands on the screen."""
        return lambda: any(text in line for line in self.screen.lines)

    def row(self, name: str) -> str:
        """Return the line that begins with a word; empty if there is none."""
        return next((line for line in self.screen.lines if line.split()[:1] == [name]), "")

    def send(self, signal_number: signal.Signals) -> None:
        """Send a signal."""
        self.process.send_signal(signal_number)

    def wait(self, timeout: float) -> int:
        """Return the exit code [s]; afterwards all that was written is on the screen."""
        code = self.process.wait(timeout)
        while not self._frozen.is_set() and select.select([self._ours], [], [], 0.1)[0]:
            time.sleep(0.01)
        return code

    def close(self) -> None:
        """End the program if it runs."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._ended.set()
        self._reader.join()
        os.close(self._ours)
        os.close(self._theirs)
