"""The messages of one MCAP file, block by block; `mcap_scan` finds out what the file holds."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.records import Channel, Metadata, Schema, Statistics

from fastswing_planner.bags.mcap_chunk import unpacked
from fastswing_planner.bags.mcap_records import (
    HEAD,
    MESSAGE,
    PREFIX,
    heads_at,
    message_heads,
    messages_at,
)
from fastswing_planner.cdr.batch import Messages
from fastswing_planner.errors import UnreadableBag

_INDEX_ENTRY = np.dtype([("log_time", "<u8"), ("place", "<u8")])


@dataclass(slots=True)
class Block:
    """A stretch of the file that holds messages: a chunk, or records outside of chunks.

    begin, size  [bytes] of the chunk's record without its prefix, or of the records
    counts       messages by channel, None if the file does not say
    index        [bytes] places and sizes of each channel's index in the file, as far as there are
    cut          whether the file ends inside of it
    """

    begin: int
    size: int
    chunk: bool
    counts: dict[int, int] | None = None
    index: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    cut: bool = False


@dataclass
class McapFile:
    """What a file holds; `scan` makes it.

    counts    messages by channel id
    statistics  the file's own, None if it has none
    indexed   whether the indices of its chunks name as many messages as its statistics
    warnings  what was recovered or lost, a line each; reading may add to them
    """

    path: Path
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    start_ns: int = 0
    end_ns: int = 0
    indexed: bool = False
    statistics: Statistics | None = None

    @property
    def empty(self) -> bool:
        """Whether there are no messages, so that the times say nothing."""
        return not any(self.counts.values())

    def read(self, channels: Collection[int]) -> Iterator[tuple[int, Messages]]:
        """Yield the messages of some channels as recorded, block by block: channel id, messages."""
        with opened(self.path) as stream:
            for block in self.blocks:
                if block.counts is not None and not block.counts.keys() & set(channels):
                    continue
                content = self.content(stream, block)
                indexed = self._indexed(stream, block, content, channels)
                if indexed is not None:
                    yield from indexed
                    continue
                places, heads = message_heads(content)
                for channel in channels:
                    mine = heads["channel"] == channel
                    if mine.any():
                        yield channel, messages_at(content, places[mine], heads[mine])

    def _indexed(
        self, stream: BinaryIO, block: Block, content: bytes, channels: Collection[int]
    ) -> list[tuple[int, Messages]] | None:
        """Return the messages that the block's index names; None if it is not right."""
        if not block.index or not self.indexed:
            return None
        found = []
        for channel in channels:
            entries = [_read_at(stream, *place) for place in block.index.get(channel, ())]
            rows = np.frombuffer(b"".join(entries), dtype=_INDEX_ENTRY)
            if not rows.size:
                continue
            rows = rows[np.argsort(rows["place"], kind="stable")]
            if rows["place"][-1] + HEAD.itemsize > len(content):
                return None
            places = rows["place"].astype(np.int64)
            heads = heads_at(content, places)
            right = (
                (heads["code"] == MESSAGE)
                & (heads["channel"] == channel)
                & (heads["log_time"] == rows["log_time"])
                & (heads["size"] >= HEAD.itemsize - PREFIX.size)
                & (heads["size"] <= len(content))
            )
            ends = places + PREFIX.size + heads["size"].astype(np.int64)
            overlap = (places[1:] < ends[:-1]).any() or ends[-1] > len(content)
            if overlap or not right.all():
                return None
            found.append((channel, messages_at(content, places, heads)))
        return found

    def content(self, stream: BinaryIO, block: Block) -> bytes:
        """Return a block's records; of a damaged one what can be had, and a warning."""
        try:
            stream.seek(block.begin)
            data = stream.read(block.size)
        except OSError as error:
            self.warn(f"cannot read at byte {block.begin}: {error.strerror or error}")
            return b""
        if not block.chunk:
            return data
        content, complaint = unpacked(data)
        if complaint and not block.cut:
            counted = "it is" if block.counts is None else f"its {_sum(block.counts)} messages are"
            self.warn(
                f"the chunk at byte {block.begin} is damaged ({complaint}), {counted} left out"
            )
            return b""
        return content

    def warn(self, text: str) -> None:
        """Note what was recovered or lost, once."""
        line = f"{self.path.name}: {text}"
        if line not in self.warnings:
            self.warnings.append(line)


def _sum(counts: Mapping[int, int]) -> int:
    return sum(counts.values())


def opened(path: Path) -> BinaryIO:
    """Open a file for reading; raises UnreadableBag."""
    try:
        return open(path, "rb")
    except OSError as error:
        raise UnreadableBag(f"cannot read {path}: {error.strerror or error}") from error


def _read_at(stream: BinaryIO, begin: int, size: int) -> bytes:
    stream.seek(begin)
    return stream.read(size)
