"""Frames between bridge and boards; `docs/board_protocol.md` is the reference.

One command frame and one state frame per control period serve a group of boards. All numbers are
little-endian; each frame ends with the CRC-32 of everything before it.
"""

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from musashi_muscle_bridge.errors import FrameError

MAGIC = b"FS"
VERSION = 2

_HEADER = struct.Struct("<2sBBIIHH")  # magic, version, kind, session, sequence, muscles, joints
_COMMAND_HEADER = struct.Struct("<BBH")  # watchdog action, flags, watchdog timeout [ms]
_CRC = struct.Struct("<I")

_KIND_COMMAND = 1
_KIND_STATE = 2

COMMAND_ROW = np.dtype(
    [
        ("mode", "u1"),
        ("reserved", "u1"),
        ("id", "<u2"),
        ("setpoint", "<f4"),
        ("tension_limit", "<f4"),
        ("current_limit", "<f4"),
    ]
)
STATE_ROW = np.dtype(
    [
        ("mode", "u1"),
        ("fault", "u1"),
        ("id", "<u2"),
        ("length", "<f4"),
        ("velocity", "<f4"),
        ("tension", "<f4"),
        ("current", "<f4"),
        ("temperature", "<f4"),
        ("boots", "<u2"),
        ("refused", "<u2"),
    ]
)
JOINT_ROW = np.dtype([("position", "<f4"), ("velocity", "<f4")])

Rows = NDArray[np.void]


class Mode(IntEnum):
    """What a board does with its motor; the values are those of `fastswing_msgs/MuscleState`."""

    ZERO_CURRENT = 0
    CURRENT = 1
    TENSION = 2
    LENGTH = 3


class Fault(IntEnum):
    """Why a board stopped; the values are those of `fastswing_msgs/MuscleState`."""

    NONE = 0
    OVER_TENSION = 1
    OVER_TEMPERATURE = 2
    OVER_CURRENT = 3
    ENCODER = 4
    WATCHDOG = 5
    BUS = 6
    CALIBRATION = 7


class WatchdogAction(IntEnum):
    """What the boards do when command frames stop."""

    ZERO_CURRENT = 0
    HOLD_LENGTH = 1


@dataclass(frozen=True)
class CommandFrame:
    """What the boards are to do.

    rows              COMMAND_ROW for each muscle: setpoint [m], [N] or [A] by mode
    watchdog_timeout  [s] without a command frame until `watchdog_action`
    clear_faults      clear latched faults whose cause is gone
    session           chosen anew by each bridge that starts
    """

    sequence: int
    rows: Rows
    watchdog_action: WatchdogAction
    watchdog_timeout: float
    clear_faults: bool = False
    session: int = 0

    def encode(self) -> bytes:
        """Return the frame's bytes."""
        return _seal(
            _HEADER.pack(
                MAGIC, VERSION, _KIND_COMMAND, self.session, self.sequence, len(self.rows), 0
            )
            + _COMMAND_HEADER.pack(
                self.watchdog_action, int(self.clear_faults), round(self.watchdog_timeout * 1000)
            )
            + self.rows.tobytes()
        )

    @staticmethod
    def decode(frame: bytes) -> "CommandFrame":
        """Read a frame; raises FrameError."""
        session, sequence, muscles, _, body = _open(frame, _KIND_COMMAND)
        expected = _COMMAND_HEADER.size + muscles * COMMAND_ROW.itemsize
        if len(body) != expected:
            raise FrameError(f"command frame has {len(body)} bytes of content, not {expected}")
        action, flags, timeout_ms = _COMMAND_HEADER.unpack_from(body)
        try:
            watchdog_action = WatchdogAction(action)
        except ValueError as error:
            raise FrameError(f"unknown watchdog action {action}") from error
        rows = np.frombuffer(body, COMMAND_ROW, muscles, _COMMAND_HEADER.size)
        _refuse_nonsense(rows)
        timeout, clear = timeout_ms / 1000.0, bool(flags & 1)
        return CommandFrame(sequence, rows, watchdog_action, timeout, clear, session)


@dataclass(frozen=True)
class StateFrame:
    """What the boards measured; `session` and `sequence` are those of the command they answer.

    rows    STATE_ROW for each muscle
    joints  JOINT_ROW for each joint [rad], [rad/s]
    """

    sequence: int
    rows: Rows
    joints: Rows
    session: int = 0

    def encode(self) -> bytes:
        """Return the frame's bytes."""
        counts = len(self.rows), len(self.joints)
        header = _HEADER.pack(MAGIC, VERSION, _KIND_STATE, self.session, self.sequence, *counts)
        return _seal(header + self.rows.tobytes() + self.joints.tobytes())

    @staticmethod
    def decode(frame: bytes) -> "StateFrame":
        """Read a frame; raises FrameError."""
        session, sequence, muscles, joints, body = _open(frame, _KIND_STATE)
        split = muscles * STATE_ROW.itemsize
        expected = split + joints * JOINT_ROW.itemsize
        if len(body) != expected:
            raise FrameError(f"state frame has {len(body)} bytes of content, not {expected}")
        return StateFrame(
            sequence,
            np.frombuffer(body, STATE_ROW, muscles),
            np.frombuffer(body, JOINT_ROW, joints, split),
            session,
        )

    def __reduce__(self) -> tuple[Callable[[bytes], "StateFrame"], tuple[bytes]]:
        """Pickle as its bytes: arrays take ten times as long."""
        return StateFrame.decode, (self.encode(),)


def _refuse_nonsense(rows: Rows) -> None:
    """Raise FrameError for an unknown mode, or numbers that no board can obey."""
    unknown = rows["mode"] > max(Mode)
    if unknown.any():
        row = rows[unknown][0]
        raise FrameError(f"unknown mode {row['mode']} for muscle {row['id']}")
    for field in ("setpoint", "tension_limit", "current_limit"):
        values = rows[field]
        wrong = ~np.isfinite(values)
        if field != "setpoint":
            wrong |= values < 0.0
        if wrong.any():
            row = rows[wrong][0]
            raise FrameError(f"{field} {row[field]:g} for muscle {row['id']} makes no sense")


def copied(rows: Rows) -> Rows:
    """Return a writable copy: by their bytes, as numpy copies records one field after another."""
    return np.frombuffer(bytearray(rows.tobytes()), rows.dtype)


def is_newer(sequence: int, than: int) -> bool:
    """Whether a sequence number comes after another one; both wrap to 0 after 2**32 - 1."""
    return 0 < (sequence - than) % 2**32 < 2**31


def _seal(content: bytes) -> bytes:
    return content + _CRC.pack(zlib.crc32(content))


def _open(frame: bytes, expected_kind: int) -> tuple[int, int, int, int, bytes]:
    if len(frame) < _HEADER.size + _CRC.size:
        raise FrameError(f"frame of {len(frame)} bytes is too short")
    content, crc = frame[: -_CRC.size], _CRC.unpack(frame[-_CRC.size :])[0]
    if zlib.crc32(content) != crc:
        raise FrameError("frame is damaged: its CRC does not fit")
    # The version first: where kind and counts stand may change with it.
    magic, version, kind, session, sequence, muscles, joints = _HEADER.unpack_from(content)
    if magic == MAGIC and version != VERSION:
        raise FrameError(f"frame of protocol version {version}, this side speaks {VERSION}")
    if magic != MAGIC or kind != expected_kind:
        raise FrameError(f"not the expected frame: magic {magic!r}, kind {kind}")
    return session, sequence, muscles, joints, content[_HEADER.size :]
