"""A topic's messages in parts of one type, so that memory does not grow with the bag."""

from collections.abc import Iterator, Mapping
from itertools import groupby

import numpy as np

from fastswing_planner.bags.mcap_file import McapFile
from fastswing_planner.cdr.batch import Messages, merged
from fastswing_planner.cdr.columns import Columns
from fastswing_planner.cdr.schema import Schema

_MOST_HELD = 1 << 24
"""[bytes] of blocks that are kept as a whole while a batch is collected."""
_LARGEST_STEP_BACK_NS = 10_000_000
"""[ns] messages may be recorded in another order than they came."""


def batches(
    file: McapFile, schemas: Mapping[int, Schema], size: int
) -> Iterator[tuple[Schema, list[Messages]]]:
    """Yield a file's messages in batches of one type, of `size` or the rest of a block.

    schemas  the types of the channels that are wanted, by the channel's id
    """
    waiting: list[Messages] = []
    waiting_for: Schema | None = None
    held = 0
    for schema, messages in _in_order(file.read(schemas), schemas):
        if waiting and waiting_for is not None and schema is not waiting_for:
            yield waiting_for, waiting
            waiting, held = [], 0
        waiting.append(messages)
        held += len(messages.content)
        if held > _MOST_HELD:
            waiting, held = [part.alone() for part in waiting], 0
        waiting_for = schema
        if sum(map(len, waiting)) >= size:
            yield schema, waiting
            waiting, held = [], 0
    if waiting and waiting_for is not None:
        yield waiting_for, waiting


def _in_order(
    parts: Iterator[tuple[int, Messages]], schemas: Mapping[int, Schema]
) -> Iterator[tuple[Schema, Messages]]:
    """Yield each block's messages by type, those of several channels in the order of recording."""
    for _, block in groupby(parts, key=lambda part: id(part[1].content)):
        of_type: dict[Schema, list[Messages]] = {}
        for channel, messages in block:
            of_type.setdefault(schemas[channel], []).append(messages)
        for schema, several in of_type.items():
            yield schema, several[0] if len(several) == 1 else merged(several)


def step_back(columns: Columns, newest: int) -> str:
    """Return a line that tells how far the recorder's clock went back; empty if it did not.

    newest  [ns] log time of the message before; negative if there was none
    """
    steps = np.diff(columns.log_time_ns, prepend=newest if newest >= 0 else 0)
    if not steps.size or steps.min() >= -_LARGEST_STEP_BACK_NS:
        return ""
    at = int(steps.argmin())
    return (
        f"{columns.topic}: the recorder's clock went back by {-steps[at] * 1e-9:.3f} s, "
        f"to {columns.log_time_ns[at] * 1e-9:.3f} s"
    )
