"""Messages of any type decode to what independent libraries wrote, or are refused."""

from array import array
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.records import Schema as SchemaRecord
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fastswing_planner.cdr.batch import Messages
from fastswing_planner.cdr.column_decoder import ColumnDecoder
from fastswing_planner.cdr.layout import decode
from fastswing_planner.cdr.primitives import PRIMITIVE_SIZE, is_message
from fastswing_planner.cdr.schema import parse_ros2msg
from fastswing_planner.errors import UndecodableMessage

NAME = "lab_msgs/msg/Odd"
INNER = "lab_msgs/msg/Inner"
INNER_FIELDS = (("x", "float64", ""), ("label", "string", ""), ("flag", "bool", ""))
ATTRIBUTES = (*(name for name, _, _ in INNER_FIELDS), *(f"f{i}" for i in range(7)))
ARRAYS = ("", "[]", "[3]", "[<=4]")

Fields = tuple[tuple[str, str, str], ...]

definitions = st.lists(
    st.tuples(st.sampled_from([*PRIMITIVE_SIZE, "string", "Inner"]), st.sampled_from(ARRAYS)),
    min_size=1,
    max_size=7,
).map(lambda rows: tuple((f"f{i}", kind, repeat) for i, (kind, repeat) in enumerate(rows)))


def lines(fields: Fields) -> str:
    return "".join(f"{kind}{repeat} {name}\n" for name, kind, repeat in fields)


def definition(fields: Fields) -> str:
    return f"{lines(fields)}{'=' * 80}\nMSG: lab_msgs/Inner\n{lines(INNER_FIELDS)}"


def store_of(fields: Fields) -> Any:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(lines(fields), NAME))
    store.register(get_types_from_msg(lines(INNER_FIELDS), INNER))
    return store


def value(draw: st.DrawFn, store: Any, kind: str) -> Any:
    if kind == "Inner":
        parts = {name: value(draw, store, inner) for name, inner, _ in INNER_FIELDS}
        return store.types[INNER](**parts)
    if kind == "string":
        return draw(st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=5))
    if kind == "bool":
        return draw(st.booleans())
    if kind.startswith("float"):
        return draw(st.floats(width=32))
    bits = int(kind.lstrip("uint"))
    low = 0 if kind.startswith("u") else -(2 ** (bits - 1))
    return draw(st.integers(low, low + 2**bits - 1))


def message(draw: st.DrawFn, store: Any, fields: Fields) -> Any:
    values: dict[str, Any] = {}
    for name, kind, repeat in fields:
        if not repeat:
            values[name] = value(draw, store, kind)
            continue
        count = 3 if repeat == "[3]" else draw(st.integers(0, 4))
        elements = [value(draw, store, kind) for _ in range(count)]
        values[name] = np.array(elements, dtype=kind) if kind in PRIMITIVE_SIZE else elements
    return store.types[NAME](**values)


@st.composite
def written(draw: st.DrawFn) -> tuple[str, Fields, list[bytes]]:
    """Draw a definition, and messages of it that rosbags has serialised."""
    fields = draw(definitions)
    store = store_of(fields)
    little = draw(st.booleans())
    made = [message(draw, store, fields) for _ in range(draw(st.integers(1, 6)))]
    repeated = [made[i] for i in draw(st.lists(st.integers(0, len(made) - 1), max_size=4))]
    data = [
        bytes(store.serialize_cdr(one, NAME, little_endian=little)) for one in [*made, *repeated]
    ]
    return definition(fields), fields, data


def plain(thing: Any) -> Any:
    """Return what any of the libraries decoded as lists, texts and integers, floats as texts."""
    if isinstance(thing, str):
        return thing
    if isinstance(thing, (list, tuple, bytes, array, np.ndarray)):
        return [plain(element) for element in thing]
    if isinstance(thing, (float, np.floating)):
        return repr(float(thing))
    if isinstance(thing, (int, np.integer, np.bool_)):
        return int(thing)
    names = [name for name in ATTRIBUTES if hasattr(thing, name)]
    assert names, f"a {type(thing)} is no message"
    return {name: plain(getattr(thing, name)) for name in names}


def packed(messages: list[bytes]) -> Messages:
    sizes = np.array([len(data) for data in messages], dtype=np.int64)
    zeros = np.zeros(len(messages), dtype=np.int64)
    begin = np.cumsum(sizes) - sizes
    return Messages(b"".join(messages), begin, sizes, zeros, zeros, zeros.astype(np.uint32))


@given(written())
def test_a_message_is_what_mcap_ros2_support_reads(case: tuple[str, Fields, list[bytes]]) -> None:
    text, _, messages = case
    record = SchemaRecord(1, text.encode(), "ros2msg", NAME)
    oracle = DecoderFactory().decoder_for("cdr", record)
    assert oracle is not None
    schema = parse_ros2msg(NAME, text)
    for data in messages:
        assert plain(decode(schema, data)) == plain(oracle(data))


@given(written())
def test_a_message_is_what_rosbags_wrote(case: tuple[str, Fields, list[bytes]]) -> None:
    text, fields, messages = case
    store = store_of(fields)
    schema = parse_ros2msg(NAME, text)
    for data in messages:
        expected = store.deserialize_cdr(data, NAME)
        found = decode(schema, data)
        for name, _, _ in fields:
            assert plain(getattr(found, name)) == plain(getattr(expected, name))


@given(written())
def test_columns_hold_what_the_messages_hold(case: tuple[str, Fields, list[bytes]]) -> None:
    text, fields, messages = case
    schema = parse_ros2msg(NAME, text)
    columns = ColumnDecoder(schema).decode([packed(messages)])
    for name, kind, repeat in fields:
        if kind == "Inner":
            assert (f"{name}.label" in columns) == (not repeat)
            continue
        expected = [plain(getattr(decode(schema, data), name)) for data in messages]
        assert [plain(row) for row in columns[name]] == expected


@given(written(), st.data())
def test_a_message_that_is_cut_is_refused(
    case: tuple[str, Fields, list[bytes]], data: st.DataObject
) -> None:
    text, _, messages = case
    schema = parse_ros2msg(NAME, text)
    whole = messages[0]
    cut = whole[: data.draw(st.integers(0, len(whole) - 1))]
    with pytest.raises(UndecodableMessage):
        decode(schema, cut)
    with pytest.raises(UndecodableMessage):
        ColumnDecoder(schema).decode([packed([whole, cut])])


@given(written(), st.data())
def test_a_damaged_message_is_refused_or_decoded_alike_in_both_ways(
    case: tuple[str, Fields, list[bytes]], data: st.DataObject
) -> None:
    text, fields, messages = case
    schema = parse_ros2msg(NAME, text)
    damaged = bytearray(messages[0])
    place = data.draw(st.integers(0, len(damaged) - 1))
    damaged[place] = data.draw(st.integers(0, 255))
    try:
        expected = decode(schema, bytes(damaged))
    except UndecodableMessage:
        with pytest.raises(UndecodableMessage):
            ColumnDecoder(schema).decode([packed([messages[0], bytes(damaged)])])
        return
    columns = ColumnDecoder(schema).decode([packed([messages[0], bytes(damaged)])])
    for name, kind, _ in fields:
        if kind != "Inner":
            assert plain(columns[name][1]) == plain(getattr(expected, name))


def check_refused(text: str, data: bytes, complaint: str) -> None:
    with pytest.raises(UndecodableMessage) as caught:
        decode(parse_ros2msg(NAME, text), data)
    assert str(caught.value) == complaint


LITTLE = b"\0\1\0\0"


def test_another_encoding_than_plain_cdr_is_refused() -> None:
    complaint = f"a {NAME} begins with '00 07 00 00': no plain CDR"
    check_refused("int8 x\n", b"\0\7\0\0\1", complaint)


def test_a_message_that_ends_early_is_named() -> None:
    check_refused("int32 x\n", LITTLE + b"\1", f"a {NAME} of 5 bytes ends before its fields do")


def test_a_message_that_is_too_long_for_its_type_is_named() -> None:
    complaint = f"a {NAME} of 12 bytes is longer than its definition says, 5 bytes"
    check_refused("int8 x\n", LITTLE + bytes(8), complaint)


def test_three_bytes_of_padding_are_allowed() -> None:
    schema = parse_ros2msg(NAME, "int8 x\n")
    assert decode(schema, LITTLE + b"\5\0\0\0") == SimpleNamespace(x=5)


def test_a_sequence_longer_than_its_message_is_named() -> None:
    complaint = f"a {NAME} of 8 bytes has a sequence of 4294967295 elements"
    check_refused("int8[] x\n", LITTLE + b"\xff" * 4, complaint)


def test_a_text_without_an_end_is_named() -> None:
    data = LITTLE + b"\2\0\0\0ab"
    check_refused("string x\n", data, f"a text in a {NAME} has no end")


def test_wide_texts_are_refused() -> None:
    complaint = f"x of {NAME} is a wstring, which each middleware writes its own way"
    check_refused("wstring x\n", LITTLE + bytes(4), complaint)


def test_bytes_that_are_no_text_are_shown_in_hexadecimal() -> None:
    data = LITTLE + b"\3\0\0\0a\xff\0"
    assert decode(parse_ros2msg(NAME, "string x\n"), data).x == "a\\xff"


def test_a_message_without_fields_is_one_byte() -> None:
    assert decode(parse_ros2msg(NAME, "uint8 ONLY=1\n"), LITTLE + b"\0") == SimpleNamespace()


CASES: Mapping[str, tuple[str, str]] = {
    "a type that is not defined": (
        "Other x\n",
        f"the definition of {NAME} does not define lab_msgs/msg/Other",
    ),
    "a type within itself": ("Odd[] x\n", f"the definition of {NAME}: {NAME} contains itself"),
    "a line that is none": ("int8\n", f"the definition of {NAME} has the line 'int8'"),
    "a section without a name": (
        f"int8 x\n{'=' * 80}\nhello\nint8 y\n",
        f"the definition of {NAME} has a section 'hello'",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_bad_definition_is_named(case: str) -> None:
    text, complaint = CASES[case]
    with pytest.raises(UndecodableMessage) as caught:
        parse_ros2msg(NAME, text)
    assert str(caught.value) == complaint


def test_constants_defaults_and_comments_are_no_fields() -> None:
    text = (
        '# a\nuint8 A=1\nstring B = "x # y"\nstring c "a=b"  # d\nint32[] e [1, 2]\nbool f true\n'
    )
    schema = parse_ros2msg("lab_msgs/Odd", text)
    assert [field.name for field in schema.fields] == ["c", "e", "f"]
    assert not any(is_message(field.type_name) for field in schema.fields)
