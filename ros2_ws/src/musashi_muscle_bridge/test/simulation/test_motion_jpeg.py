"""The MP4 file has the boxes that players look for, and the pictures where it says they are."""

import struct

import pytest

from musashi_muscle_bridge.simulation.motion_jpeg import motion_jpeg_mp4

FRAMES = [b"\xff\xd8first\xff\xd9", b"\xff\xd8second one\xff\xd9"]
_CONTAINERS = (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"dinf")


def boxes(content: bytes) -> dict[bytes, bytes]:
    """Return the content of each box by its type, those within boxes too."""
    found: dict[bytes, bytes] = {}
    place = 0
    while place < len(content):
        size, kind = struct.unpack_from(">I4s", content, place)
        found[kind] = content[place + 8 : place + size]
        if kind in _CONTAINERS:
            found |= boxes(found[kind])
        place += size
    return found


@pytest.fixture
def video() -> bytes:
    return motion_jpeg_mp4(FRAMES, 640, 480, 50)


def test_the_boxes_fill_the_file(video: bytes) -> None:
    assert list(boxes(video))[:2] == [b"ftyp", b"mdat"]


def test_the_sizes_and_the_offset_lead_to_the_pictures(video: bytes) -> None:
    table = boxes(video)
    _, count, *sizes = struct.unpack(">IIII", table[b"stsz"][4:])
    (offset,) = struct.unpack(">I", table[b"stco"][8:])
    assert count == len(FRAMES)
    place = offset
    for frame, size in zip(FRAMES, sizes, strict=True):
        assert video[place : place + size] == frame
        place += size


def test_the_time_scale_is_the_frame_rate(video: bytes) -> None:
    scale, duration = struct.unpack_from(">II", boxes(video)[b"mvhd"], 12)
    assert (scale, duration) == (50, len(FRAMES))


def test_the_picture_size_is_in_the_track(video: bytes) -> None:
    assert struct.unpack(">II", boxes(video)[b"tkhd"][-8:]) == (640 << 16, 480 << 16)


def test_a_video_without_frames_is_refused() -> None:
    with pytest.raises(ValueError, match="at least one frame"):
        motion_jpeg_mp4([], 640, 480, 50)
