"""Where the index at the end of an MCAP file says that its chunks stand."""

import struct
import zlib
from io import BytesIO
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import ChunkIndex

from fastswing_planner.bags.mcap_records import PREFIX

MAGIC = b"\x89MCAP0\r\n"
_FOOTER = struct.Struct("<BQQQI")
_FOOTER_CODE, _CHUNK_INDEX = 0x02, 0x08


def known_places(stream: BinaryIO, size: int) -> dict[int, int]:
    """Return places where records begin: of chunks with their size, others with 0 [bytes].

    size  [bytes] of the file

    Empty if the file has no index, or none whose checksum proves it.
    """
    end = size - len(MAGIC) - _FOOTER.size
    stream.seek(max(end, 0))
    tail = stream.read(_FOOTER.size)
    if end < len(MAGIC) or len(tail) < _FOOTER.size:
        return {}
    code, _, start, _, checksum = _FOOTER.unpack(tail)
    if code != _FOOTER_CODE or not checksum or not len(MAGIC) <= start < end:
        return {}
    stream.seek(start)
    summary = stream.read(end - start)
    if zlib.crc32(summary + tail[:-4]) != checksum:
        return {}
    places = {start: 0}
    for index in _chunk_indices(summary):
        after = index.chunk_start_offset + index.chunk_length
        places.setdefault(after, 0)
        places.setdefault(after + index.message_index_length, 0)
        places[index.chunk_start_offset] = index.chunk_length
    return {place: places[place] for place in sorted(places) if place <= start}


def _chunk_indices(summary: bytes) -> list[ChunkIndex]:
    found = []
    at = 0
    while at + PREFIX.size <= len(summary):
        code, size = PREFIX.unpack_from(summary, at)
        begin, at = at + PREFIX.size, at + PREFIX.size + size
        if code == _CHUNK_INDEX:
            try:
                found.append(ChunkIndex.read(ReadDataStream(BytesIO(summary[begin:at]))))
            except (McapError, ValueError, struct.error):
                return []
    return found
