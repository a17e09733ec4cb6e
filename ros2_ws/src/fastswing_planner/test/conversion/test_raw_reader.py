"""Raw messages are bit for bit what the middleware's own conversion makes and reads."""

import struct
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_msgs.msg import CurrentOverride, InhibitionStatus, MuscleState
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.conversion.message_template import MessageTemplate
from fastswing_planner.conversion.number_places import STAMP
from fastswing_planner.conversion.raw_reader import RawReader
from fastswing_planner.errors import InvalidRequest

MUSCLE_NUMBERS = ("length", "velocity", "tension", "current", "temperature")

texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=6)
stamps = st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1))


def numbers(count: int) -> st.SearchStrategy[list[float]]:
    return st.lists(st.floats(), min_size=count, max_size=count)


def small(count: int) -> st.SearchStrategy[list[int]]:
    return st.lists(st.integers(0, 255), min_size=count, max_size=count)


def header(draw: st.DrawFn) -> Header:
    sec, nanosec = draw(stamps)
    return Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=draw(texts))


@st.composite
def joint_states(draw: st.DrawFn, choice: tuple[str, ...] = ()) -> JointState:
    some = st.sampled_from(choice) if choice else texts
    names = draw(st.lists(some, max_size=2 if choice else 8))
    effort = draw(st.sampled_from([0, len(names)]))
    return JointState(
        header=Header() if choice else header(draw),
        name=names,
        position=draw(numbers(len(names))),
        velocity=draw(numbers(len(names))),
        effort=draw(numbers(effort)),
    )


@st.composite
def muscle_states(draw: st.DrawFn) -> MuscleState:
    names = draw(st.lists(texts, max_size=8))
    return MuscleState(
        header=header(draw),
        name=names,
        mode=draw(small(len(names))),
        fault=draw(small(len(names))),
        holds=draw(st.integers(0, 2**32 - 1)),
        **{field: draw(numbers(len(names))) for field in MUSCLE_NUMBERS},
    )


@st.composite
def overrides(draw: st.DrawFn) -> CurrentOverride:
    lease = Duration(sec=draw(st.integers(0, 9)), nanosec=draw(st.integers(0, 999_999_999)))
    return CurrentOverride(header=header(draw), name=draw(st.lists(texts, max_size=8)), lease=lease)


@st.composite
def statuses(draw: st.DrawFn) -> InhibitionStatus:
    names = draw(st.lists(texts, max_size=8))
    bounds = draw(st.integers(0, 5))
    counts = st.lists(st.integers(0, 2**64 - 1), min_size=bounds + 1, max_size=bounds + 1)
    return InhibitionStatus(
        header=header(draw),
        armed=draw(st.booleans()),
        reason=draw(st.integers(0, 255)),
        reason_text=draw(texts),
        threshold=draw(st.floats()),
        name=names,
        speed_index=draw(numbers(len(names))),
        inhibited=draw(st.lists(texts, max_size=8)),
        direction_from_goal=draw(st.booleans()),
        decisions=draw(st.integers(0, 2**64 - 1)),
        rejected=draw(st.integers(0, 2**64 - 1)),
        latency_bound=draw(numbers(bounds)),
        latency_count=draw(counts),
        latency_max=draw(st.floats()),
    )


# What each node changes from message to message.
CHANGING = {
    JointState: (*STAMP, "position", "velocity"),
    MuscleState: (*STAMP, *MUSCLE_NUMBERS, "mode", "fault", "holds"),
    CurrentOverride: STAMP,
    InhibitionStatus: (
        *STAMP,
        "speed_index",
        "direction_from_goal",
        "decisions",
        "latency_count",
        "latency_max",
    ),
}
messages = st.one_of(joint_states(), muscle_states(), overrides(), statuses())


def value_at(message: Any, path: str) -> Any:
    for name in path.split("."):
        message = getattr(message, name)
    return message


def set_at(message: Any, path: str, value: Any) -> None:
    *owners, name = path.split(".")
    for owner in owners:
        message = getattr(message, owner)
    setattr(message, name, value)


def blanked(message: Any) -> Any:
    """Return the message with zeros for what changes from message to message."""
    blank = deserialize_message(serialize_message(message), type(message))
    for path in CHANGING[type(message)]:
        value = value_at(blank, path)
        many = hasattr(value, "__len__")
        set_at(blank, path, [type(n)(0) for n in value] if many else type(value)(0))
    return blank


def independent_bytes(message: Any) -> bytes:
    """Return a message as another library serialises it: its padding is zero."""
    store = get_typestore(Stores.ROS2_JAZZY)
    package = type(message).__module__.split(".")[0]
    name = f"{package}/msg/{type(message).__name__}"
    if name not in store.types:
        text = definition_text(name).split("=" * 80)[0]
        store.register(get_types_from_msg(text, name))

    def converted(part: Any, type_name: str) -> Any:
        if not hasattr(part, "get_fields_and_field_types"):
            is_array = isinstance(part, (list, np.ndarray)) or hasattr(part, "typecode")
            return np.array(part) if is_array and not _texts(part) else part
        kind = store.types[type_name]
        fields = part.get_fields_and_field_types()
        return kind(
            **{
                field: converted(getattr(part, field), full_name(owner))
                for field, owner in fields.items()
            }
        )

    return bytes(store.serialize_cdr(converted(message, name), name))


def _texts(part: Any) -> bool:
    return isinstance(part, list) and (not part or isinstance(part[0], str))


def full_name(short: str) -> str:
    package, _, name = short.partition("/")
    return f"{package}/msg/{name}"


@given(messages)
def test_a_template_gives_what_another_library_serialises(message: Any) -> None:
    fields = CHANGING[type(message)]
    data = MessageTemplate(message, fields).filled(*(value_at(message, f) for f in fields))
    expected = independent_bytes(message)
    assert data[: len(expected)] == expected
    assert not any(data[len(expected) :])


@given(messages)
def test_a_template_does_not_remember_the_numbers_it_was_made_with(message: Any) -> None:
    fields = CHANGING[type(message)]
    values = [value_at(message, field) for field in fields]
    blank = MessageTemplate(blanked(message), fields).filled(*values)
    assert blank == MessageTemplate(message, fields).filled(*values)


@given(messages)
def test_a_template_forgets_what_it_was_filled_with(message: Any) -> None:
    fields = CHANGING[type(message)]
    template = MessageTemplate(message, fields)
    values = [value_at(message, field) for field in fields]
    first = template.filled(*values)
    template.filled(*(value_at(blanked(message), field) for field in fields))
    assert template.filled(*values) == first


@given(messages)
def test_the_middleware_reads_back_what_a_template_gives(message: Any) -> None:
    fields = CHANGING[type(message)]
    template = MessageTemplate(blanked(message), fields)
    data = template.filled(*(value_at(message, field) for field in fields))
    back = deserialize_message(data, type(message))
    assert independent_bytes(back) == independent_bytes(message)


@pytest.mark.parametrize("values", [[1.0, 2.0, 3.0], [1.0]])
def test_another_number_of_elements_is_refused(values: Any) -> None:
    template = MessageTemplate(JointState(position=[0.0, 0.0]), ["position"])
    with pytest.raises(ValueError, match="2"):
        template.filled(values)


def test_another_number_of_values_is_refused() -> None:
    template = MessageTemplate(JointState(position=[0.0, 0.0]), ["position"])
    with pytest.raises(ValueError, match="zip"):
        template.filled([0.0, 0.0], [0.0, 0.0])


@pytest.mark.parametrize("path", ["name", "header", "header.frame_id", "torque"])
def test_a_path_that_is_no_number_is_refused(path: str) -> None:
    with pytest.raises(KeyError, match=path):
        MessageTemplate(JointState(), [path])
    with pytest.raises(KeyError, match=path):
        RawReader(JointState, [path])


def test_a_sequence_of_messages_has_no_fixed_places() -> None:
    with pytest.raises(TypeError, match=r"diagnostic_msgs/msg/DiagnosticArray has .*, status"):
        MessageTemplate(DiagnosticArray(), ["header.stamp.sec"])


# Reading.


def is_same(read: Any, message: Any) -> bool:
    """Whether what changes, and all texts, are the same."""
    numbers_same = all(
        np.array_equal(value_at(read, field), value_at(message, field), equal_nan=True)
        for field in CHANGING[type(message)]
    )
    return numbers_same and (read.name, read.header.frame_id) == (
        message.name,
        message.header.frame_id,
    )


@given(messages)
def test_the_second_message_is_what_the_middleware_makes_of_it(message: Any) -> None:
    reader = RawReader(type(message), CHANGING[type(message)])
    reader.read(serialize_message(blanked(message)))
    read = reader.read(serialize_message(message))
    assert isinstance(read, SimpleNamespace)
    assert is_same(read, message)


@given(messages)
def test_the_first_message_takes_the_ordinary_way(message: Any) -> None:
    read = RawReader(type(message), ()).read(serialize_message(message))
    assert isinstance(read, type(message))
    assert independent_bytes(read) == independent_bytes(message)


def big_endian(names: list[str], position: list[float]) -> bytes:
    """Write a JointState without velocity and effort by hand, with the most significant first."""
    data = bytearray(b"\0\0\0\0" + struct.pack(">iI", -7, 9))

    def pad(size: int) -> None:
        data.extend(bytes((4 - len(data)) % size))

    for text in ("map", None, *names):
        pad(4)
        encoded = b"" if text is None else text.encode() + b"\0"
        data.extend(struct.pack(">I", len(names) if text is None else len(encoded)) + encoded)
    pad(4)
    data.extend(struct.pack(">I", len(position)))
    pad(8)
    data.extend(struct.pack(f">{len(position)}d", *position))
    return bytes(data + struct.pack(">II", 0, 0))


@given(st.lists(texts, min_size=1, max_size=4), numbers(3))
def test_a_message_of_the_other_byte_order_is_the_same(
    names: list[str], position: list[float]
) -> None:
    data = big_endian(names, position)
    reader = RawReader(JointState, CHANGING[JointState])
    for read in (reader.read(data), reader.read(data)):
        assert (read.header.stamp.sec, read.header.stamp.nanosec) == (-7, 9)
        assert (read.header.frame_id, read.name) == ("map", names)
        assert np.array_equal(read.position, position, equal_nan=True)
    assert reader.ordinary == 1


def shape(message: JointState) -> tuple[object, ...]:
    lengths = map(len, (message.position, message.velocity, message.effort))
    return (message.header.frame_id, message.name, *lengths)


@given(joint_states(("", "a")), joint_states(("", "a")))
def test_only_messages_of_the_same_texts_and_lengths_take_the_fast_way(
    learned: JointState, other: JointState
) -> None:
    reader = RawReader(JointState, CHANGING[JointState])
    reader.read(serialize_message(learned))
    fast = isinstance(reader.read(serialize_message(other)), SimpleNamespace)
    assert fast is (shape(other) == shape(learned))


def test_numbers_cannot_be_written() -> None:
    reader = RawReader(JointState, ["position"])
    data = serialize_message(JointState(position=[1.0]))
    reader.read(data)
    assert reader.read(data).position == (1.0,)


def test_numbers_do_not_overflow_where_those_of_a_message_do_not() -> None:
    reader = RawReader(JointState, STAMP)
    data = serialize_message(JointState(header=Header(stamp=Time(sec=2_000_000_000))))
    reader.read(data)
    assert reader.read(data).header.stamp.sec * 1_000_000_000 == 2 * 10**18


@given(messages, st.data())
def test_a_damaged_message_is_refused_or_what_the_middleware_makes_of_it(
    message: Any, data: st.DataObject
) -> None:
    good = serialize_message(message)
    bad = bytearray(good[: data.draw(st.integers(0, len(good)))])
    for _ in range(data.draw(st.integers(0, 4))):
        if bad:
            bad[data.draw(st.integers(0, len(bad) - 1))] = data.draw(st.integers(0, 255))
    reader = RawReader(type(message), CHANGING[type(message)])
    reader.read(good)
    with suppress(InvalidRequest):
        read = reader.read(bytes(bad))
        assert is_same(read, deserialize_message(bytes(bad), type(message)))


@given(st.binary(max_size=200))
def test_garbage_is_refused_or_read_and_never_more(data: bytes) -> None:
    with suppress(InvalidRequest):
        RawReader(JointState, ["position"]).read(data)


@pytest.mark.parametrize("cut", [0, 3, 20, 40])
def test_a_cut_message_is_refused(cut: int) -> None:
    data = serialize_message(JointState(name=["a"], position=[1.0], velocity=[1.0]))
    with pytest.raises(InvalidRequest, match="undecodable message"):
        RawReader(JointState, ["position"]).read(data[:cut])
