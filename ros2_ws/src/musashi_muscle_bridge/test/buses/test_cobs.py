"""Any frame survives COBS, and the stream recovers from anything at the next zero."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from musashi_muscle_bridge.buses.cobs import FrameReader, decode, encode
from musashi_muscle_bridge.errors import FrameError

MAX = 1000

# Long runs without a zero are what the code bytes are about.
frames = st.lists(
    st.binary(max_size=20) | st.integers(0, 600).map(lambda size: b"x" * size), max_size=6
).map(b"".join)


def wire(frame: bytes) -> bytes:
    return encode(frame) + b"\0"


# The examples of the COBS article in Wikipedia, which follow the paper.
@pytest.mark.parametrize(
    ("plain", "encoded"),
    [
        ("", "01"),
        ("00", "0101"),
        ("0000", "010101"),
        ("001100", "01021101"),
        ("11220033", "0311220233"),
        ("11223344", "0511223344"),
        ("11000000", "0211010101"),
        (bytes(range(1, 255)).hex(), "ff" + bytes(range(1, 255)).hex()),
        (bytes(range(255)).hex(), "01ff" + bytes(range(1, 255)).hex()),
        (bytes(range(1, 256)).hex(), "ff" + bytes(range(1, 255)).hex() + "02ff"),
        (bytes([*range(2, 256), 0]).hex(), "ff" + bytes(range(2, 256)).hex() + "0101"),
        (bytes([*range(3, 256), 0, 1]).hex(), "fe" + bytes(range(3, 256)).hex() + "0201"),
    ],
)
def test_a_known_frame_has_its_known_code(plain: str, encoded: str) -> None:
    assert encode(bytes.fromhex(plain)).hex() == encoded
    assert decode(bytes.fromhex(encoded)).hex() == plain


@given(frames)
def test_decoding_undoes_encoding(frame: bytes) -> None:
    assert decode(encode(frame)) == frame


@given(frames)
def test_an_encoded_frame_has_no_zero(frame: bytes) -> None:
    assert 0 not in encode(frame)


@given(frames)
def test_an_encoded_frame_is_at_most_a_byte_longer_for_each_254_begun(frame: bytes) -> None:
    assert len(encode(frame)) <= len(frame) + len(frame) // 254 + 1


@given(st.binary(max_size=50))
def test_noise_is_a_frame_or_a_frame_error(noise: bytes) -> None:
    try:
        decode(noise)
    except FrameError:
        return


@pytest.mark.parametrize(
    ("bad", "text"),
    [
        (b"\x00", "byte 0 of 1 announces a block that is not there"),
        (b"\x03a", "byte 0 of 2 announces a block that is not there"),
        (b"\x02a\x05bc", "byte 2 of 5 announces a block that is not there"),
        (b"\x03a\x00", "byte 0 of 3 announces a block that is not there"),
    ],
)
def test_what_no_frame_encodes_to_is_refused_saying_where(bad: bytes, text: str) -> None:
    with pytest.raises(FrameError) as caught:
        decode(bad)
    assert str(caught.value) == text


@given(st.lists(frames, max_size=5), st.lists(st.integers(1, 300), max_size=30))
def test_however_a_stream_is_cut_its_frames_come_out(sent: list[bytes], cuts: list[int]) -> None:
    stream = b"".join(wire(frame) for frame in sent)
    reader = FrameReader(4000)
    found = []
    for cut in cuts:
        found += reader.feed(stream[:cut])
        stream = stream[cut:]
    assert found + reader.feed(stream) == sent


@given(noise=st.binary(max_size=300), frame=frames.filter(lambda frame: len(frame) <= MAX))
def test_after_noise_and_a_zero_the_next_frame_is_read(noise: bytes, frame: bytes) -> None:
    reader = FrameReader(MAX)
    reader.feed(noise)
    assert reader.feed(b"\0" + wire(frame))[-1] == frame


def test_zeros_in_a_row_are_nothing() -> None:
    reader = FrameReader(MAX)
    assert reader.feed(bytes(100)) == []
    assert reader.dropped == {"garbled": 0, "overlong": 0}


def test_a_garbled_piece_is_counted() -> None:
    reader = FrameReader(MAX)
    reader.feed(b"\x09abc\0")
    assert reader.dropped == {"garbled": 1, "overlong": 0}


def test_a_frame_of_the_longest_size_is_read() -> None:
    frame = b"x" * MAX
    assert FrameReader(MAX).feed(wire(frame)) == [frame]


def test_an_overlong_piece_is_counted_and_the_next_frame_read() -> None:
    reader = FrameReader(MAX)
    assert reader.feed(b"x" * 2 * MAX + b"\0" + wire(b"next")) == [b"next"]
    assert reader.dropped == {"garbled": 0, "overlong": 1}


def test_a_stream_without_a_zero_does_not_pile_up() -> None:
    reader = FrameReader(MAX)
    for _ in range(100):
        reader.feed(b"x" * MAX)
    assert len(reader._piece) <= MAX + MAX // 254 + 1
