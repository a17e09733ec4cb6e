"""Finds out what an MCAP file holds, also one that nobody finished or that is damaged.

The file is walked from record to record, so it needs no index; where it has one, that helps over
damaged records. The record layouts are those of the MCAP specification, version 0.
"""

import struct
from bisect import bisect_right
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import Channel, Metadata, Schema, Statistics

from fastswing_planner.bags.mcap_file import Block, McapFile, opened
from fastswing_planner.bags.mcap_index import MAGIC, known_places
from fastswing_planner.bags.mcap_records import MESSAGE, PREFIX, message_heads
from fastswing_planner.errors import UnreadableBag

_INDEX_HEAD = struct.Struct("<HI")
_PLAIN_BLOCK = 1 << 20

_FOOTER, _SCHEMA, _CHANNEL = 0x02, 0x03, 0x04
_CHUNK, _INDEX, _STATISTICS, _METADATA = 0x06, 0x07, 0x0B, 0x0C


def scan(path: Path) -> McapFile:
    """Find out what a file holds; raises UnreadableBag if that is nothing."""
    file = McapFile(path)
    with opened(path) as stream:
        scanner = _Scanner(file, stream)
        scanner.run()
    return file


class _Scanner:
    """Walks a file once, without unpacking chunks if it says itself what is in them."""

    def __init__(self, file: McapFile, stream: BinaryIO) -> None:
        self._file = file
        self._stream = stream
        self._size = stream.seek(0, 2)
        self._complete = False

    def run(self) -> None:
        self._check_magic()
        end = self._walk()
        lost = "" if self._complete else self._describe_end(end)
        if self._must_unpack():
            self._count()
        else:
            self._add_up()
        if lost:
            self._file.warn(lost)

    def _check_magic(self) -> None:
        self._stream.seek(0)
        begin = self._stream.read(len(MAGIC))
        if not begin:
            raise UnreadableBag(f"{self._file.path} is empty")
        if begin != MAGIC:
            raise UnreadableBag(f"{self._file.path} is no MCAP file")

    def _walk(self) -> int:
        """Note what stands outside of chunks; returns where the last complete record ends."""
        at = len(MAGIC)
        known = known_places(self._stream, self._size)
        borders = [*known, self._size]
        while not self._complete and at + PREFIX.size <= self._size:
            self._stream.seek(at)
            code, size = PREFIX.unpack(self._stream.read(PREFIX.size))
            begin, after = at + PREFIX.size, at + PREFIX.size + size
            chunk_size = known.get(at, 0)
            border = borders[bisect_right(borders, at)]
            if chunk_size and (code != _CHUNK or after != at + chunk_size):
                self._file.warn(f"the head of the chunk at byte {at} is damaged, its index is used")
                code, size, after = _CHUNK, chunk_size - PREFIX.size, at + chunk_size
            elif border < self._size and (code == 0 or after > border):
                self._file.warn(f"damaged at byte {at}, read on at byte {border}")
                at = border
                continue
            if code == 0 or after > self._size:
                if code == _CHUNK:
                    self._file.blocks.append(Block(begin, self._size - begin, True, cut=True))
                return at
            self._note(code, begin, size)
            at = after
        return at

    def _note(self, code: int, begin: int, size: int) -> None:
        file = self._file
        if code == _CHUNK:
            file.blocks.append(Block(begin, size, True))
        elif code == _INDEX:
            self._note_index(begin)
        elif code == MESSAGE:
            self._extend_plain(begin - PREFIX.size, size + PREFIX.size)
        elif code in (_SCHEMA, _CHANNEL, _METADATA, _STATISTICS):
            _note_record(file, code, self._stream.read(size))
        elif code == _FOOTER:
            self._stream.seek(begin + size)
            self._complete = self._stream.read(len(MAGIC)) == MAGIC

    def _note_index(self, begin: int) -> None:
        """Count the messages that an index names for the chunk before it."""
        channel, size = _INDEX_HEAD.unpack(self._stream.read(_INDEX_HEAD.size))
        if self._file.blocks and self._file.blocks[-1].chunk:
            block = self._file.blocks[-1]
            block.counts = block.counts or {}
            block.counts[channel] = block.counts.get(channel, 0) + size // 16
            block.index.setdefault(channel, []).append((begin + _INDEX_HEAD.size, size))

    def _extend_plain(self, begin: int, size: int) -> None:
        blocks = self._file.blocks
        if blocks and not blocks[-1].chunk:
            last = blocks[-1]
            if last.begin + last.size == begin and last.size < _PLAIN_BLOCK:
                last.size += size
                return
        blocks.append(Block(begin, size, False))

    def _describe_end(self, end: int) -> str:
        rest = self._size - end
        tail = f"; its last {rest} bytes are an incomplete record" if rest else ""
        return f"was not finished, what was written is read{tail}"

    def _must_unpack(self) -> bool:
        """Whether only the chunks themselves say what the file holds."""
        file, statistics = self._file, self._file.statistics
        if not self._complete or statistics is None or not file.channels:
            return True
        chunks = [block for block in file.blocks if block.chunk]
        if all(block.counts is not None for block in chunks) and len(chunks) == len(file.blocks):
            counted = sum(sum((block.counts or {}).values()) for block in chunks)
            file.indexed = counted == statistics.message_count
            if not file.indexed:
                return True
        return not file.channels.keys() >= statistics.channel_message_counts.keys()

    def _add_up(self) -> None:
        statistics = self._file.statistics
        assert statistics is not None
        self._file.counts.update(statistics.channel_message_counts)
        self._file.start_ns = statistics.message_start_time
        self._file.end_ns = statistics.message_end_time
        indexed = [block.counts is not None for block in self._file.blocks]
        if not all(indexed):  # an empty index is none: which chunk lacks a channel is not known
            for block in self._file.blocks:
                block.counts = None

    def _count(self) -> None:
        """Unpack every block once for its schemas, channels and counts."""
        file = self._file
        for block in file.blocks:
            content = file.content(self._stream, block)
            _note_definitions(file, content)
            _, heads = message_heads(content)
            if heads.size:
                times = heads["log_time"]
                first, last = int(times.min()), int(times.max())
                file.start_ns = min(file.start_ns, first) if file.counts else first
                file.end_ns = max(file.end_ns, last)
            channels, counts = np.unique(heads["channel"], return_counts=True)
            block.counts = dict(zip(channels.tolist(), counts.tolist(), strict=True))
            for channel, number in block.counts.items():
                file.counts[channel] = file.counts.get(channel, 0) + number
            if block.cut:
                count = sum(block.counts.values())
                file.warn(f"{count} messages were recovered from its incomplete last chunk")
        found = sum(file.counts.values())
        if file.statistics is not None and found < file.statistics.message_count:
            total = file.statistics.message_count
            file.warn(f"{total - found} of its {total} messages are lost")


def _note_definitions(file: McapFile, content: bytes) -> None:
    """Note the schemas and channels in `content`."""
    at, end = 0, len(content)
    while at + PREFIX.size <= end:
        code, size = PREFIX.unpack_from(content, at)
        begin, at = at + PREFIX.size, at + PREFIX.size + size
        if code in (_SCHEMA, _CHANNEL) and at <= end:
            _note_record(file, code, content[begin:at])


def _note_record(file: McapFile, code: int, data: bytes) -> None:
    stream = ReadDataStream(BytesIO(data))
    try:
        if code == _SCHEMA:
            schema = Schema.read(stream)
            file.schemas[schema.id] = schema
        elif code == _CHANNEL:
            channel = Channel.read(stream)
            file.channels[channel.id] = channel
        elif code == _METADATA:
            file.metadata.append(Metadata.read(stream))
        elif code == _STATISTICS:
            file.statistics = Statistics.read(stream)
    except (McapError, ValueError, struct.error):
        file.warn(f"a damaged record (code {code}) is left out")
