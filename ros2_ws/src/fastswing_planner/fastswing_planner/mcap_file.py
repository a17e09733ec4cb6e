"""The records of one MCAP file, also of one that nobody finished or that is damaged.

The file is walked from record to record, so it needs no index; chunks are read one at a time. The
record layouts are those of the MCAP specification, version 0.
"""

import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.records import Channel, Metadata, Schema, Statistics

from fastswing_planner.bag_errors import UnreadableBag

MAGIC = b"\x89MCAP0\r\n"
_PREFIX = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_HEAD = _MESSAGE.size - _PREFIX.size
_CHUNK_HEAD = struct.Struct("<QQQII")
_INDEX_HEAD = struct.Struct("<HI")
_PLAIN_BLOCK = 1 << 20
_MAX_CHUNK = 1 << 32

_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE_CODE, _CHUNK, _INDEX = range(1, 8)
_STATISTICS, _METADATA, _DATA_END = 0x0B, 0x0C, 0x0F

Sink = Callable[[int, int, int, bytes], None]
"""Takes sequence, log time [ns], publish time [ns] and the message."""


@dataclass
class Block:
    """A stretch of the file that holds messages: a chunk, or records outside of chunks.

    begin, size  [bytes] of the chunk's record without its prefix, or of the records
    counts       messages by channel, None if the file does not say
    """

    begin: int
    size: int
    chunk: bool
    counts: dict[int, int] | None = None
    cut: bool = False


@dataclass
class McapFile:
    """What a file holds; `scan` makes it.

    counts    messages by channel id
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

    def read(self, sinks: Mapping[int, Sink]) -> Iterator[int]:
        """Hand the messages of some channels to their sinks, block by block, as recorded.

        Yields after each block, with the number of the blocks so far.
        """
        with _opened(self.path) as stream:
            for number, block in enumerate(self.blocks, 1):
                if block.counts is not None and not block.counts.keys() & sinks.keys():
                    continue
                walk_messages(self._content(stream, block), sinks)
                yield number

    def _content(self, stream: BinaryIO, block: Block) -> bytes:
        """Return a block's records; of a damaged one what can be had, and a warning."""
        try:
            stream.seek(block.begin)
            data = stream.read(block.size)
        except OSError as error:
            self._warn(f"cannot read at byte {block.begin}: {error.strerror or error}")
            return b""
        if not block.chunk:
            return data
        content, complaint = _unpacked(data)
        if complaint and not block.cut:
            self._warn(f"the chunk at byte {block.begin} is damaged ({complaint}) and is left out")
            return b""
        return content

    def _warn(self, text: str) -> None:
        line = f"{self.path.name}: {text}"
        if line not in self.warnings:
            self.warnings.append(line)


def walk_messages(content: bytes, sinks: Mapping[int, Sink]) -> None:
    """Hand the messages in `content`, a sequence of records, to their channel's sink."""
    at, end = 0, len(content)
    unpack = _MESSAGE.unpack_from
    head = _MESSAGE.size
    last = end - head
    while at <= last:
        code, size, channel, sequence, log_time, publish_time = unpack(content, at)
        after = at + 9 + size
        if code == _MESSAGE_CODE and channel in sinks and head - 9 <= size and after <= end:
            sinks[channel](sequence, log_time, publish_time, content[at + head : after])
        at = after


def scan(path: Path) -> McapFile:
    """Find out what a file holds; raises UnreadableBag if that is nothing."""
    file = McapFile(path)
    with _opened(path) as stream:
        scanner = _Scanner(file, stream)
        scanner.run()
    return file


def _opened(path: Path) -> BinaryIO:
    try:
        return open(path, "rb")
    except OSError as error:
        raise UnreadableBag(f"cannot read {path}: {error.strerror or error}") from error


class _Scanner:
    """Walks a file once, without unpacking chunks if it says itself what is in them."""

    def __init__(self, file: McapFile, stream: BinaryIO) -> None:
        self._file = file
        self._stream = stream
        self._size = stream.seek(0, 2)
        self._statistics: Statistics | None = None
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
            self._file._warn(lost)

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
        while not self._complete and at + _PREFIX.size <= self._size:
            self._stream.seek(at)
            code, size = _PREFIX.unpack(self._stream.read(_PREFIX.size))
            begin, after = at + _PREFIX.size, at + _PREFIX.size + size
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
            self._note_index()
        elif code == _MESSAGE_CODE:
            self._extend_plain(begin - _PREFIX.size, size + _PREFIX.size)
        elif code in (_SCHEMA, _CHANNEL, _METADATA, _STATISTICS):
            _note_record(file, code, self._stream.read(size))
            if code == _STATISTICS:
                self._stream.seek(begin)
                self._statistics = Statistics.read(ReadDataStream(self._stream))
        elif code == _FOOTER:
            self._complete = True

    def _note_index(self) -> None:
        """Count the messages that an index names for the chunk before it."""
        channel, size = _INDEX_HEAD.unpack(self._stream.read(_INDEX_HEAD.size))
        if self._file.blocks and self._file.blocks[-1].chunk:
            block = self._file.blocks[-1]
            block.counts = block.counts or {}
            block.counts[channel] = block.counts.get(channel, 0) + size // 16

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
        file, statistics = self._file, self._statistics
        if not self._complete or statistics is None or not file.channels:
            return True
        indexed = all(block.counts is not None for block in file.blocks if block.chunk)
        counted = sum(sum((block.counts or {}).values()) for block in file.blocks)
        known = file.channels.keys() >= statistics.channel_message_counts.keys()
        return not known or (indexed and counted != statistics.message_count)

    def _add_up(self) -> None:
        assert self._statistics is not None
        self._file.counts.update(self._statistics.channel_message_counts)
        self._file.start_ns = self._statistics.message_start_time
        self._file.end_ns = self._statistics.message_end_time
        indexed = [block.counts is not None for block in self._file.blocks]
        if not all(indexed):  # an empty index is none: which chunk lacks a channel is not known
            for block in self._file.blocks:
                block.counts = None

    def _count(self) -> None:
        """Unpack every block once for its schemas, channels and counts."""
        file = self._file
        for block in file.blocks:
            content = file._content(self._stream, block)
            block.counts = {}
            for channel, log_time in _walk_all(file, content):
                first = not file.counts
                file.start_ns = log_time if first else min(file.start_ns, log_time)
                file.end_ns = max(file.end_ns, log_time)
                file.counts[channel] = file.counts.get(channel, 0) + 1
                block.counts[channel] = block.counts.get(channel, 0) + 1
            if block.cut:
                count = sum(block.counts.values())
                file._warn(f"{count} messages were recovered from its incomplete last chunk")


def _walk_all(file: McapFile, content: bytes) -> Iterator[tuple[int, int]]:
    """Note schemas and channels in `content`; yields channel and log time of each message."""
    at, end = 0, len(content)
    while at + _PREFIX.size <= end:
        code, size = _PREFIX.unpack_from(content, at)
        begin, at = at + _PREFIX.size, at + _PREFIX.size + size
        if at > end:
            return
        if code == _MESSAGE_CODE and size >= _MESSAGE_HEAD:
            _, _, channel, _, log_time, _ = _MESSAGE.unpack_from(content, begin - _PREFIX.size)
            yield channel, log_time
        elif code in (_SCHEMA, _CHANNEL):
            _note_record(file, code, content[begin:at])


def _note_record(file: McapFile, code: int, data: bytes) -> None:
    stream = ReadDataStream(BytesIO(data))
    if code == _SCHEMA:
        schema = Schema.read(stream)
        file.schemas[schema.id] = schema
    elif code == _CHANNEL:
        channel = Channel.read(stream)
        file.channels[channel.id] = channel
    elif code == _METADATA:
        file.metadata.append(Metadata.read(stream))


def _unpacked(data: bytes) -> tuple[bytes, str]:
    """Return a chunk's records and what is wrong with it, if anything is."""
    if len(data) < _CHUNK_HEAD.size:
        return b"", "no content"
    _, _, size, crc, name_size = _CHUNK_HEAD.unpack_from(data)
    begin = _CHUNK_HEAD.size + name_size + 8
    compression = data[_CHUNK_HEAD.size : begin - 8].decode("ascii", "replace")
    if size > _MAX_CHUNK:
        return b"", f"{size} bytes unpacked"
    try:
        content = _decompressed(compression, data[begin:], size)
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        return b"", str(error)
    if len(content) != size:
        return content, f"{len(content)} instead of {size} bytes"
    if crc and zlib.crc32(content) != crc:
        return content, "wrong checksum"
    return content, ""


def _decompressed(compression: str, data: bytes, size: int) -> bytes:
    """Return what was compressed; of cut data as much as there is."""
    if compression == "":
        return data
    if compression == "zstd":
        return bytes(zstandard.ZstdDecompressor().decompressobj().decompress(data))
    if compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size))
    raise RuntimeError(f"compression '{compression}' is not known")
