"""Keys do what they say, and nothing else does."""

from hypothesis import given
from hypothesis import strategies as st

from musashi_muscle_bridge.monitor.keys import CLEAR, QUIT, KeyPad, KeyReader

CONTROL_SEQUENCES = st.builds(
    lambda parameters, between, last: b"\x1b[" + parameters + between + last,
    st.binary(max_size=6).map(lambda text: bytes(0x30 + byte % 16 for byte in text)),
    st.binary(max_size=2).map(lambda text: bytes(0x20 + byte % 16 for byte in text)),
    st.integers(0x40, 0x7E).map(lambda byte: bytes([byte])),
)
FUNCTION_KEYS = st.integers(0x40, 0x7E).map(lambda byte: bytes([0x1B, ord("O"), byte]))


@given(st.lists(CONTROL_SEQUENCES | FUNCTION_KEYS))
def test_no_arrow_or_function_key_is_a_letter(sequences: list[bytes]) -> None:
    assert KeyReader().feed(b"".join(sequences), 0.0) == []


@given(st.lists(CONTROL_SEQUENCES | FUNCTION_KEYS))
def test_a_letter_after_any_of_them_is_read(sequences: list[bytes]) -> None:
    assert KeyReader().feed(b"".join(sequences) + b"e", 0.0) == ["e"]


@given(st.lists(CONTROL_SEQUENCES, min_size=1), st.data())
def test_a_sequence_that_arrives_in_two_parts_is_none_either(
    sequences: list[bytes], data: st.DataObject
) -> None:
    sent = b"".join(sequences)
    cut = data.draw(st.integers(0, len(sent)))
    reader = KeyReader()
    assert reader.feed(sent[:cut], 0.0) + reader.feed(sent[cut:], 0.1) == []


@given(st.binary())
def test_the_stop_key_is_read_a_second_after_whatever_came_before(noise: bytes) -> None:
    reader = KeyReader()
    reader.feed(noise, 0.0)
    assert reader.feed(b"e", 1.0) == ["e"]


def test_the_escape_key_does_not_swallow_the_letter_after_it() -> None:
    assert KeyReader().feed(b"\x1be", 0.0) == ["e"]


def test_caps_lock_changes_nothing() -> None:
    assert KeyReader().feed(b"E", 0.0) == ["e"]


def test_one_key_stops_and_one_holds() -> None:
    pad = KeyPad()
    assert [pad.press("e", 0.0), pad.press("h", 0.0)] == ["emergency_stop", "hold_posture"]


def test_q_quits() -> None:
    assert KeyPad().press("q", 0.0) == QUIT


def test_clearing_faults_takes_two_keys() -> None:
    pad = KeyPad()
    assert [pad.press("c", 0.0), pad.press("y", 1.0)] == ["", CLEAR]


@given(st.lists(st.sampled_from("abcehxy"), max_size=12))
def test_faults_are_cleared_by_y_right_after_c_alone(letters: list[str]) -> None:
    pad = KeyPad()
    wishes = [pad.press(letter, float(number)) for number, letter in enumerate(letters)]
    pairs = zip(["", *letters], letters, strict=False)
    assert [wish == CLEAR for wish in wishes] == [pair == ("c", "y") for pair in pairs]


def test_a_forgotten_question_is_not_answered_later() -> None:
    pad = KeyPad()
    pad.press("c", 0.0)
    assert not pad.confirming(6.0)
    assert pad.press("y", 6.0) == ""


def test_stopping_needs_no_answer_to_an_open_question() -> None:
    pad = KeyPad()
    pad.press("c", 0.0)
    assert pad.press("e", 0.1) == "emergency_stop"
