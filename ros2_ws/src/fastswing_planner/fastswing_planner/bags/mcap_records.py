"""Where serialised messages stand in a block of MCAP records."""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

MESSAGE = 5
"""Code of a message's record."""

PREFIX = struct.Struct("<BQ")
"""What every record begins with: its code, and the size of what follows [bytes]."""

HEAD = np.dtype(
    [
        ("code", "u1"),
        ("size", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
"""What a message's record begins with, prefix included."""


@dataclass(frozen=True)
class Messages:
    """Serialised messages of one channel inside of one block.

    content          what they stand in
    begin, size      [bytes] place of each in it, shape (k,)
    log_time_ns      shape (k,)
    publish_time_ns  shape (k,)
    sequence         the publisher's count, shape (k,)
    """

    content: bytes
    begin: npt.NDArray[np.int64]
    size: npt.NDArray[np.int64]
    log_time_ns: npt.NDArray[np.int64]
    publish_time_ns: npt.NDArray[np.int64]
    sequence: npt.NDArray[np.uint32]

    @staticmethod
    def none() -> "Messages":
        """Return no messages."""
        nothing = np.empty(0, dtype=np.int64)
        return Messages(b"", nothing, nothing, nothing, nothing, nothing.astype(np.uint32))

    def __len__(self) -> int:
        """Return their number."""
        return int(self.begin.size)

    def alone(self) -> "Messages":
        """Return the same without the rest of their block, if that is most of it: it is memory."""
        if 2 * int(self.size.sum()) > len(self.content):
            return self
        begin = np.cumsum(self.size) - self.size
        return replace(self, content=b"".join(self.data()), begin=begin)

    def data(self) -> Iterator[bytes]:
        """Yield each."""
        for begin, size in zip(self.begin.tolist(), self.size.tolist(), strict=True):
            yield self.content[begin : begin + size]

    def rows(self, size: int) -> npt.NDArray[np.uint8]:
        """Return those of `size` bytes, shape (k, size)."""
        begin = self.begin[self.size == size]
        return _rows_at(self.content, begin, size)


def merged(parts: Sequence[Messages]) -> Messages:
    """Return messages of several channels inside of one block, as they stand there."""
    order = np.argsort(np.concatenate([part.begin for part in parts]), kind="stable")
    return Messages(
        parts[0].content,
        np.concatenate([part.begin for part in parts])[order],
        np.concatenate([part.size for part in parts])[order],
        np.concatenate([part.log_time_ns for part in parts])[order],
        np.concatenate([part.publish_time_ns for part in parts])[order],
        np.concatenate([part.sequence for part in parts])[order],
    )


def messages_at(
    content: bytes, places: npt.NDArray[np.int64], heads: npt.NDArray[np.void]
) -> Messages:
    """Return the messages whose records begin at some places with these heads."""
    return Messages(
        content,
        places + HEAD.itemsize,
        heads["size"].astype(np.int64) - (HEAD.itemsize - PREFIX.size),
        heads["log_time"].astype(np.int64),
        heads["publish_time"].astype(np.int64),
        heads["sequence"].astype(np.uint32),
    )


def message_heads(content: bytes) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.void]]:
    """Return place and head of each complete message record."""
    unpack = PREFIX.unpack_from
    found = []
    at, end = 0, len(content)
    while at <= end - PREFIX.size:
        code, size = unpack(content, at)
        after = at + 9 + size
        if code == MESSAGE and size >= HEAD.itemsize - PREFIX.size and after <= end:
            found.append(at)
        at = after
    places = np.array(found, dtype=np.int64)
    return places, heads_at(content, places)


def heads_at(content: bytes, places: npt.NDArray[np.int64]) -> npt.NDArray[np.void]:
    """Return what stands at some places, each far enough from the end, as heads of messages."""
    rows = np.ascontiguousarray(_rows_at(content, places, HEAD.itemsize))
    return rows.view(HEAD).reshape(-1)


def _rows_at(content: bytes, begin: npt.NDArray[np.int64], size: int) -> npt.NDArray[np.uint8]:
    """Return `size` bytes from each place on, shape (k, size)."""
    if not begin.size or not size:
        return np.empty((begin.size, size), dtype=np.uint8)
    data = np.frombuffer(content, dtype=np.uint8)
    return np.lib.stride_tricks.sliding_window_view(data, size)[begin]
