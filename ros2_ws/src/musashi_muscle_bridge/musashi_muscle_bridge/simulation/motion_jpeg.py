"""An MP4 file whose frames are JPEG pictures; VLC, mpv, ffmpeg and QuickTime play it.

The boxes are those of ISO/IEC 14496-12 (file) and 14496-14 (MP4).
"""

import struct
from collections.abc import Sequence

_MATRIX = struct.pack(">9I", 0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)
_JPEG_IN_MP4 = 0x6C  # objectTypeIndication of ISO/IEC 10918-1
_VISUAL_STREAM = 0x04 << 2 | 1


def motion_jpeg_mp4(frames: Sequence[bytes], width: int, height: int, frame_rate: int) -> bytes:
    """Return the MP4 file of these JPEG pictures.

    frames         complete JPEG files, all of one size
    width, height  [pixel]
    frame_rate     [1/s]

    Raises ValueError without frames.
    """
    if not frames:
        raise ValueError("a video needs at least one frame")
    kind = _box(b"ftyp", b"isom" + struct.pack(">I", 0x200) + b"isomiso2mp41")
    content = _box(b"mdat", b"".join(frames))
    track = _track(frames, len(kind) + 8, width, height, frame_rate)
    header = struct.pack(">4I", 0, 0, frame_rate, len(frames)) + struct.pack(
        ">IHHII", 0x10000, 0x100, 0, 0, 0
    )
    movie = _full(b"mvhd", header + _MATRIX + bytes(24) + struct.pack(">I", 2))
    return kind + content + _box(b"moov", movie + track)


def _box(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", 8 + len(content)) + kind + content


def _full(kind: bytes, content: bytes, flags: int = 0) -> bytes:
    return _box(kind, struct.pack(">I", flags) + content)


def _track(frames: Sequence[bytes], offset: int, width: int, height: int, rate: int) -> bytes:
    head = struct.pack(">5I", 0, 0, 1, 0, len(frames)) + bytes(16) + _MATRIX
    head += struct.pack(">2I", width << 16, height << 16)
    media = _full(b"mdhd", struct.pack(">4IHH", 0, 0, rate, len(frames), 0x55C4, 0))
    media += _full(b"hdlr", bytes(4) + b"vide" + bytes(12) + b"video\0")
    here = _box(b"dinf", _full(b"dref", struct.pack(">I", 1) + _full(b"url ", b"", 1)))
    table = _sample_table(frames, offset, width, height)
    media += _box(b"minf", _full(b"vmhd", bytes(8), 1) + here + table)
    return _box(b"trak", _full(b"tkhd", head, 3) + _box(b"mdia", media))


def _sample_table(frames: Sequence[bytes], offset: int, width: int, height: int) -> bytes:
    count = len(frames)
    entry = bytes(6) + struct.pack(">H", 1) + bytes(16) + struct.pack(">2H", width, height)
    entry += struct.pack(">3IH", 0x480000, 0x480000, 0, 1) + bytes(32) + struct.pack(">Hh", 24, -1)
    entry += _stream_description(max(map(len, frames)))
    sizes = struct.pack(f">{count}I", *map(len, frames))
    return _box(
        b"stbl",
        _full(b"stsd", struct.pack(">I", 1) + _box(b"mp4v", entry))
        + _full(b"stts", struct.pack(">3I", 1, count, 1))
        + _full(b"stsc", struct.pack(">4I", 1, 1, count, 1))
        + _full(b"stsz", struct.pack(">2I", 0, count) + sizes)
        + _full(b"stco", struct.pack(">2I", 1, offset)),
    )


def _stream_description(largest: int) -> bytes:
    """Say that the frames are JPEG; `largest` [byte] is the longest one."""
    decoder = struct.pack(">BB", _JPEG_IN_MP4, _VISUAL_STREAM) + largest.to_bytes(3, "big")
    decoder += bytes(8)  # bit rates: unknown
    stream = struct.pack(">HB", 1, 0) + _tagged(4, decoder) + _tagged(6, b"\x02")
    return _full(b"esds", _tagged(3, stream))


def _tagged(tag: int, content: bytes) -> bytes:
    return bytes([tag, len(content)]) + content
