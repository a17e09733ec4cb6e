"""Where serialised messages stand in a block of MCAP records."""

import struct

import numpy as np
import numpy.typing as npt

from fastswing_planner.cdr.batch import Messages, rows_at

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
    rows = np.ascontiguousarray(rows_at(content, places, HEAD.itemsize))
    return rows.view(HEAD).reshape(-1)
