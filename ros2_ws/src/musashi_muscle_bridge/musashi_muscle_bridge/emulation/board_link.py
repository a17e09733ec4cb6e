"""The boards' side of the wire: which command frames count, and the answer; without clock or I/O.

A session is one bridge from its start to its end. It lasts while its frames come; within it each
frame must be newer than the one before.
"""

import dataclasses
from collections.abc import Hashable

import numpy as np

from musashi_muscle_bridge.buses.protocol import CommandFrame, is_newer
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.errors import FrameError


class BoardLink:
    """Lets frames of one session at a time reach a group of boards, in order.

    refused  frames that did not count, by reason: damaged, foreign (of another session or sender
             while one lasts), old (not newer than the one before)
    frames   frames that counted
    command  the last of them; None before the first
    """

    def __init__(self, boards: Boards, boot: int = 0, group: int = 0) -> None:
        """`boot` is the boot counter's value, the same on every board of this group."""
        self._boards = boards
        self._group = group
        self._boot = boot
        self._session: tuple[int, Hashable] | None = None
        self._sequence = 0
        self._silence = 0.0
        self._watchdog_timeout = 0.0
        self.frames = 0
        self.command: CommandFrame | None = None
        self.refused = {"damaged": 0, "foreign": 0, "old": 0}

    def advance(self, elapsed: float) -> None:
        """Let `elapsed` [s] pass, for the boards too."""
        self.wait(elapsed)
        self._boards.advance(elapsed)

    def wait(self, elapsed: float) -> None:
        """Let `elapsed` [s] pass on this bus alone: somebody else advances the boards."""
        self._silence += elapsed

    def answer(self, frame: bytes, sender: Hashable = None) -> bytes | None:
        """Carry out a command frame and return the state frame; None if it does not count.

        sender  where the frame came from, as far as the bus tells
        """
        try:
            command = CommandFrame.decode(frame)
        except FrameError:
            self.refused["damaged"] += 1
            return None
        reason = self._objection((command.session, sender), command.sequence)
        if reason:
            self.refused[reason] += 1
            return None
        self._session = command.session, sender
        self._sequence = command.sequence
        self._silence = 0.0
        self._watchdog_timeout = command.watchdog_timeout
        self.frames += 1
        self.command = command
        return self._state(command)

    def _objection(self, session: tuple[int, Hashable], sequence: int) -> str:
        if session == self._session:
            return "" if is_newer(sequence, self._sequence) else "old"
        lasting = self._session is not None and self._silence <= self._watchdog_timeout
        return "foreign" if lasting else ""

    def _state(self, command: CommandFrame) -> bytes:
        state = self._boards.handle(command, self._group)
        rows = state.rows.copy()
        rows["boots"] = (rows["boots"].astype(np.int64) + self._boot) % 2**16
        rows["refused"] = sum(self.refused.values()) % 2**16
        return dataclasses.replace(state, rows=rows, session=command.session).encode()
