"""Frames survive the way there and back, and nothing damaged or foreign is taken for one."""

import dataclasses
import pickle
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from musashi_muscle_bridge.buses.protocol import (
    COMMAND_ROW,
    JOINT_ROW,
    STATE_ROW,
    CommandFrame,
    Fault,
    Mode,
    StateFrame,
    WatchdogAction,
    copied,
    is_newer,
)
from musashi_muscle_bridge.errors import BridgeError, FrameError

REFERENCE = Path(__file__).parents[5] / "docs" / "board_protocol.md"

# Header, command header, one row, CRC.
GOLDEN_COMMAND = "465302010d0c0b0a040302010100000001016400030007000000003f0000c843000000415e00c970"
# Header, one muscle's row, one joint's row, CRC.
GOLDEN_STATE = (
    "465302020d0c0b0a0403020101000100"
    "030107000000003f000080be00004843000000400000084203000201"
    "0000803f000000bf"
    "0acbbc5a"
)
SESSION = 0x0A0B0C0D

Decode = Callable[[bytes], CommandFrame | StateFrame]

sequences = st.integers(0, 2**32 - 1)
timeouts = st.integers(0, 2**16 - 1).map(lambda milliseconds: milliseconds / 1000.0)
actions = st.sampled_from(WatchdogAction)


def rows_of(dtype: np.dtype) -> st.SearchStrategy:
    """Up to twelve rows of arbitrary bytes: NaN, infinities and unknown modes among them."""
    size = dtype.itemsize
    content = st.integers(0, 12).flatmap(lambda count: arrays("u1", count * size))
    return content.map(lambda octets: octets.view(dtype))


def golden_command() -> CommandFrame:
    rows = np.array([(Mode.LENGTH, 0, 7, 0.5, 400.0, 8.0)], COMMAND_ROW)
    return CommandFrame(0x01020304, rows, WatchdogAction.HOLD_LENGTH, 0.1, True, SESSION)


def golden_state() -> StateFrame:
    row = (Mode.LENGTH, Fault.OVER_TENSION, 7, 0.5, -0.25, 200.0, 2.0, 34.0, 3, 258)
    joints = np.array([(1.0, -0.5)], JOINT_ROW)
    return StateFrame(0x01020304, np.array([row], STATE_ROW), joints, SESSION)


def resealed(frame: bytes, offset: int, value: int) -> bytes:
    """Change one byte and make the CRC fit again."""
    content = bytearray(frame[:-4])
    content[offset] = value
    return bytes(content) + struct.pack("<I", zlib.crc32(content))


def obeyable(rows: np.ndarray) -> np.ndarray:
    """Return command rows with known modes, finite numbers and limits that are not negative."""
    rows = rows.copy()
    rows["mode"] %= len(Mode)
    for field in ("setpoint", "tension_limit", "current_limit"):
        rows[field] = np.nan_to_num(rows[field])
    for field in ("tension_limit", "current_limit"):
        rows[field] = np.abs(rows[field])
    return rows


FRAMES = pytest.mark.parametrize(
    ("frame", "decode"),
    [
        pytest.param(golden_command().encode(), CommandFrame.decode, id="command"),
        pytest.param(golden_state().encode(), StateFrame.decode, id="state"),
    ],
)


@given(
    st.builds(
        CommandFrame,
        sequences,
        rows_of(COMMAND_ROW).map(obeyable),
        actions,
        timeouts,
        st.booleans(),
        sequences,
    )
)
def test_a_command_frame_comes_back_as_it_was_sent(sent: CommandFrame) -> None:
    back = CommandFrame.decode(sent.encode())
    assert dataclasses.replace(back, rows=sent.rows) == sent
    assert back.rows.tobytes() == sent.rows.tobytes()


@given(sequences, rows_of(STATE_ROW), rows_of(JOINT_ROW), sequences)
def test_a_state_frame_comes_back_as_it_was_sent(
    sequence: int, rows: np.ndarray, joints: np.ndarray, session: int
) -> None:
    back = StateFrame.decode(StateFrame(sequence, rows, joints, session).encode())
    assert (back.session, back.sequence) == (session, sequence)
    assert back.rows.tobytes() == rows.tobytes()
    assert back.joints.tobytes() == joints.tobytes()


@given(sequences, rows_of(STATE_ROW), rows_of(JOINT_ROW), sequences)
def test_a_state_frame_crosses_to_another_process_as_it_is(
    sequence: int, rows: np.ndarray, joints: np.ndarray, session: int
) -> None:
    sent = StateFrame(sequence, rows, joints, session)
    assert pickle.loads(pickle.dumps(sent)).encode() == sent.encode()


@given(rows_of(STATE_ROW))
def test_copied_rows_are_the_same_and_changing_them_leaves_the_others(rows: np.ndarray) -> None:
    before, copy = rows.tobytes(), copied(rows)
    assert copy.tobytes() == before
    copy["boots"] += np.uint16(1)
    assert rows.tobytes() == before


def test_the_bytes_of_a_command_frame_are_those_of_version_2() -> None:
    assert golden_command().encode().hex() == GOLDEN_COMMAND


def test_the_bytes_of_a_state_frame_are_those_of_version_2() -> None:
    assert golden_state().encode().hex() == GOLDEN_STATE


@pytest.mark.parametrize("muscles", [0, 1, 10, 300])
def test_a_command_frame_has_24_bytes_and_16_for_each_muscle(muscles: int) -> None:
    rows = np.zeros(muscles, COMMAND_ROW)
    frame = CommandFrame(1, rows, WatchdogAction.ZERO_CURRENT, 0.1).encode()
    assert len(frame) == 24 + 16 * muscles


@pytest.mark.parametrize(("muscles", "joints"), [(0, 0), (10, 5), (300, 2)])
def test_a_state_frame_has_20_bytes_28_for_each_muscle_and_8_for_each_joint(
    muscles: int, joints: int
) -> None:
    frame = StateFrame(1, np.zeros(muscles, STATE_ROW), np.zeros(joints, JOINT_ROW)).encode()
    assert len(frame) == 20 + 28 * muscles + 8 * joints


@FRAMES
def test_every_single_flipped_bit_is_noticed(frame: bytes, decode: Decode) -> None:
    for bit in range(8 * len(frame)):
        damaged = bytearray(frame)
        damaged[bit // 8] ^= 1 << bit % 8
        with pytest.raises(FrameError, match=r"^frame is damaged: its CRC does not fit$"):
            decode(bytes(damaged))


@FRAMES
def test_every_frame_cut_short_is_noticed(frame: bytes, decode: Decode) -> None:
    for size in range(len(frame)):
        with pytest.raises(FrameError):
            decode(frame[:size])


@FRAMES
@given(tail=st.binary(min_size=1, max_size=40))
def test_a_frame_with_a_tail_is_not_one(frame: bytes, decode: Decode, tail: bytes) -> None:
    with pytest.raises(FrameError):
        decode(frame + tail)


@given(st.binary(max_size=80))
def test_noise_is_never_a_frame_and_never_another_error(noise: bytes) -> None:
    with pytest.raises(FrameError):
        CommandFrame.decode(noise)
    with pytest.raises(FrameError):
        StateFrame.decode(noise)


@FRAMES
def test_a_frame_too_short_for_a_header_says_its_size(frame: bytes, decode: Decode) -> None:
    with pytest.raises(FrameError, match=r"^frame of 19 bytes is too short$"):
        decode(frame[:19])


@FRAMES
def test_another_version_is_refused_naming_both(frame: bytes, decode: Decode) -> None:
    text = r"^frame of protocol version 1, this side speaks 2$"
    with pytest.raises(FrameError, match=text):
        decode(resealed(frame, 2, 1))


@FRAMES
def test_another_magic_is_refused(frame: bytes, decode: Decode) -> None:
    with pytest.raises(FrameError, match=r"^not the expected frame: magic b'XS', kind [12]$"):
        decode(resealed(frame, 0, ord("X")))


def test_a_state_frame_is_no_command() -> None:
    with pytest.raises(FrameError, match=r"^not the expected frame: magic b'FS', kind 2$"):
        CommandFrame.decode(golden_state().encode())


def test_a_command_frame_is_no_state() -> None:
    with pytest.raises(FrameError, match=r"^not the expected frame: magic b'FS', kind 1$"):
        StateFrame.decode(golden_command().encode())


def test_a_command_that_counts_more_muscles_than_it_has_is_refused() -> None:
    with pytest.raises(FrameError, match=r"^command frame has 20 bytes of content, not 36$"):
        CommandFrame.decode(resealed(golden_command().encode(), 12, 2))


def test_a_state_that_counts_more_joints_than_it_has_is_refused() -> None:
    with pytest.raises(FrameError, match=r"^state frame has 36 bytes of content, not 44$"):
        StateFrame.decode(resealed(golden_state().encode(), 14, 2))


def test_a_command_without_its_own_header_is_refused() -> None:
    content = bytes.fromhex("46530201010000000100000000000000")
    frame = content + struct.pack("<I", zlib.crc32(content))
    with pytest.raises(FrameError, match=r"^command frame has 0 bytes of content, not 4$"):
        CommandFrame.decode(frame)


def test_an_unknown_watchdog_action_is_refused() -> None:
    with pytest.raises(FrameError, match=r"^unknown watchdog action 9$"):
        CommandFrame.decode(resealed(golden_command().encode(), 16, 9))


@given(sequences, st.integers(1, 2**31 - 1))
def test_a_sequence_number_is_newer_than_those_before_it_across_the_wrap(
    than: int, ahead: int
) -> None:
    later = (than + ahead) % 2**32
    assert is_newer(later, than)
    assert not is_newer(than, later)


@given(sequences)
def test_no_sequence_number_is_newer_than_itself(sequence: int) -> None:
    assert not is_newer(sequence, sequence)


def test_a_decoded_frame_cannot_be_changed() -> None:
    back = CommandFrame.decode(golden_command().encode())
    with pytest.raises(ValueError, match="read-only"):
        back.rows["setpoint"] = 1.0


def test_a_frame_error_is_an_error_of_the_bridge_and_a_value_error() -> None:
    assert issubclass(FrameError, BridgeError)
    assert issubclass(FrameError, ValueError)


@pytest.mark.parametrize("code", [*Mode, *Fault, *WatchdogAction], ids=lambda code: code.name)
def test_the_reference_page_names_every_code_with_its_number(
    code: Mode | Fault | WatchdogAction,
) -> None:
    assert f"| {code.value} | `{code.name}` |" in REFERENCE.read_text()


@pytest.mark.parametrize("frame", [GOLDEN_COMMAND, GOLDEN_STATE], ids=["command", "state"])
def test_the_reference_page_shows_this_frame(frame: str) -> None:
    assert frame in "".join(REFERENCE.read_text().split())


@pytest.mark.parametrize(
    "row", [COMMAND_ROW, STATE_ROW, JOINT_ROW], ids=["command", "state", "joint"]
)
def test_the_reference_page_gives_every_field_of_a_row_with_its_offset(row: np.dtype) -> None:
    assert row.fields is not None
    page = REFERENCE.read_text()
    for name, (_, offset, *_) in row.fields.items():
        assert f"| {offset} | `{name}` |" in page


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [
        ("mode", 4, "unknown mode 4 for muscle 7"),
        ("setpoint", np.nan, "setpoint nan for muscle 7 makes no sense"),
        ("setpoint", -np.inf, "setpoint -inf for muscle 7 makes no sense"),
        ("tension_limit", np.nan, "tension_limit nan for muscle 7 makes no sense"),
        ("tension_limit", -1.0, "tension_limit -1 for muscle 7 makes no sense"),
        ("current_limit", np.inf, "current_limit inf for muscle 7 makes no sense"),
    ],
)
def test_a_command_that_no_board_can_obey_is_refused(field: str, value: float, text: str) -> None:
    command = golden_command()
    rows = command.rows.copy()
    rows["id"], rows[field] = 7, value
    with pytest.raises(FrameError) as caught:
        CommandFrame.decode(dataclasses.replace(command, rows=rows).encode())
    assert str(caught.value) == text
