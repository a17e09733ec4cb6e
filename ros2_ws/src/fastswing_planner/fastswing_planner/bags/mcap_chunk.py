"""Unpacks the chunks of MCAP files, of cut ones as much as there is."""

import struct
import zlib

import lz4.frame
import zstandard

_CHUNK_HEAD = struct.Struct("<QQQII")
_MAX_CHUNK = 1 << 30


def unpacked(data: bytes) -> tuple[bytes, str]:
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
        decompressor = zstandard.ZstdDecompressor()
        try:
            return bytes(decompressor.decompress(data, max_output_size=size))
        except zstandard.ZstdError:
            return bytes(decompressor.decompressobj().decompress(data))
    if compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size))
    raise RuntimeError(f"compression '{compression}' is not known")
