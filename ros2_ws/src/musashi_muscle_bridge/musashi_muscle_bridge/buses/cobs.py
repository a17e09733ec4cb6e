"""Frames in a stream of bytes: Consistent Overhead Byte Stuffing (Cheshire and Baker, 1999).

An encoded frame holds no zero byte; zeros mark where frames end. Whatever happens to the stream,
the frame after the next zero is read again.
"""

from musashi_muscle_bridge.errors import FrameError

_BLOCK = 254  # bytes without a zero that one code byte can announce
DELIMITER = b"\0"


def encode(frame: bytes) -> bytes:
    """Return the frame without zero bytes; at most one byte longer for each 254 begun."""
    encoded = bytearray()
    for run in frame.split(DELIMITER):
        full = len(run) // _BLOCK * _BLOCK
        for start in range(0, full, _BLOCK):
            encoded.append(_BLOCK + 1)
            encoded += run[start : start + _BLOCK]
        encoded.append(len(run) - full + 1)
        encoded += run[full:]
    # A full block at the end announces nothing after it.
    ends_full = run and len(run) % _BLOCK == 0
    return bytes(encoded[:-1] if ends_full else encoded)


def decode(encoded: bytes) -> bytes:
    """Return the frame; raises FrameError for what no frame encodes to."""
    frame = bytearray()
    position, size = 0, len(encoded)
    while position < size:
        code = encoded[position]
        block = encoded[position + 1 : position + code]
        if code == 0 or len(block) != code - 1 or DELIMITER in block:
            raise FrameError(f"byte {position} of {size} announces a block that is not there")
        frame += block
        position += code
        if code <= _BLOCK and position < size:
            frame += DELIMITER
    return bytes(frame)


class FrameReader:
    """Cuts a stream into frames. Never keeps more than one frame of the longest allowed size.

    dropped  how many pieces were no frames, by reason: garbled, overlong
    """

    def __init__(self, max_frame: int) -> None:
        """max_frame [bytes], before encoding."""
        self._max = max_frame + max_frame // _BLOCK + 1
        self._piece = bytearray()
        self._overlong = False
        self.dropped = {"garbled": 0, "overlong": 0}

    def feed(self, received: bytes) -> list[bytes]:
        """Take bytes of any number; return the frames that are complete now."""
        *ended, rest = received.split(DELIMITER)
        frames = []
        for part in ended:
            self._extend(part)
            frames += self._frame()
        self._extend(rest)
        return frames

    def _extend(self, part: bytes) -> None:
        self._overlong |= len(self._piece) + len(part) > self._max
        if self._overlong:
            self._piece.clear()
        else:
            self._piece += part

    def _frame(self) -> list[bytes]:
        piece = bytes(self._piece)
        overlong, self._overlong = self._overlong, False
        self._piece.clear()
        if overlong:
            self.dropped["overlong"] += 1
        elif piece:
            try:
                return [decode(piece)]
            except FrameError:
                self.dropped["garbled"] += 1
        return []
