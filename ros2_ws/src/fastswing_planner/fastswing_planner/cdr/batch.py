"""Serialised messages of one topic, held together."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt


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
        return rows_at(self.content, begin, size)


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


def rows_at(content: bytes, begin: npt.NDArray[np.int64], size: int) -> npt.NDArray[np.uint8]:
    """Return `size` bytes from each place on, shape (k, size)."""
    if not begin.size or not size:
        return np.empty((begin.size, size), dtype=np.uint8)
    data = np.frombuffer(content, dtype=np.uint8)
    return np.lib.stride_tricks.sliding_window_view(data, size)[begin]
