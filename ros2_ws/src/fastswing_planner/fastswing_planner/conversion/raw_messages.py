"""Messages at rate: serialised ones are read and written at fixed places.

In a serialised message the place of everything follows from the lengths before it (`cdr_layout`).
So messages whose texts and lengths agree have their numbers at the same places, and a node that
sends or gets a message a thousand times a second needs the middleware's conversion for the first
one only. Every message read is compared with the one whose places were learned; what differs in
anything but numbers takes the ordinary way.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt
from rclpy.serialization import deserialize_message, serialize_message

from fastswing_planner.cdr.layout import Layout, Leaf, layout_of
from fastswing_planner.cdr.primitives import DTYPES, is_message
from fastswing_planner.cdr.schema import Repeat, Schema, parse_ros2msg
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.errors import InvalidRequest, UndecodableMessage

Message = TypeVar("Message")

_KINDS = 4
"""Kept at a time: as many publishers of one topic as may reasonably take turns."""
_LARGEST_LEARNED = 16_384
"""[bytes] No state is larger; learning takes its time."""
_CODES = {
    "?": "?",
    "i1": "b",
    "u1": "B",
    "i2": "h",
    "u2": "H",
    "i4": "i",
    "u4": "I",
    "i8": "q",
    "u8": "Q",
    "f4": "f",
    "f8": "d",
}
"""struct's name of each of numpy's types."""
STAMP = ("header.stamp.sec", "header.stamp.nanosec")
"""The numbers of a message's header."""


class MessageTemplate:
    """A serialised message in which some numbers are replaced, again and again."""

    def __init__(self, message: Any, fields: Sequence[str]) -> None:
        """Serialise `message` once.

        fields  paths of the numbers that change, such as 'header.stamp.sec' or 'position'

        All texts and the lengths of all sequences stay those of `message`. Raises KeyError for a
        path that is no number of the message.
        """
        data = serialize_message(message)
        layout = layout_of(_schema(type(message)), data)
        # Whatever the middleware's memory held stands between the fields and behind them.
        content = _at(layout.size, _text_places(layout) | _number_places(layout))
        self._buffer = bytearray(np.where(content, np.frombuffer(data, np.uint8), 0).tobytes())
        self._places = [self._place(number) for number in _numbers(layout, fields)]

    def _place(self, number: "_Number") -> "_Scalar | _Array":
        if number.length is None:
            return _Scalar(struct.Struct(number.code).pack_into, number.offset)
        return _Array(
            struct.Struct(f"{number.code[0]}{number.length}{number.code[1]}").pack_into,
            number.offset,
            np.frombuffer(self._buffer, number.dtype, number.length, number.offset),
        )

    def filled(self, *values: Any) -> bytes:
        """Return the message with `values`, one for each of the fields, in their order.

        A sequence's value has as many elements as the sequence had; an array or a list. Raises
        ValueError for another number of values or elements, struct.error for a number that is not
        of the field's type.
        """
        for place, value in zip(self._places, values, strict=True):
            if isinstance(place, _Scalar):
                place.pack_into(self._buffer, place.offset, value)
                continue
            if len(value) != place.view.size:  # numpy would repeat a single element
                raise ValueError(f"{len(value)} elements for a sequence of {place.view.size}")
            # Each is many times as fast as the other for its own.
            if isinstance(value, np.ndarray):
                place.view[...] = value
            else:
                place.pack_into(self._buffer, place.offset, *value)
        return bytes(self._buffer)


class _Scalar(NamedTuple):
    pack_into: Callable[..., None]
    offset: int


class _Array(NamedTuple):
    pack_into: Callable[..., None]
    offset: int
    view: npt.NDArray[Any]


class RawReader(Generic[Message]):
    """Reads serialised messages of one type.

    ordinary  how many were read the ordinary way
    """

    def __init__(self, message_type: type[Message], fields: Sequence[str]) -> None:
        """Read all texts, and of the numbers `fields`: 'header.stamp.sec', 'position', ...

        Raises KeyError for a path that is no number of the type.
        """
        self.ordinary = 0
        self._type = message_type
        self._fields = tuple(fields)
        self._kinds: dict[int, _Kind] = {}  # by size
        # An empty message tells about a wrong path now, not in a callback.
        _numbers(layout_of(_schema(message_type), serialize_message(message_type())), fields)

    def read(self, data: bytes) -> Message | SimpleNamespace:
        """Return the message; raises InvalidRequest for bytes that are none.

        If `data` differs from a message that took the ordinary way in numbers only, it is a plain
        object with the same attributes: arrays are tuples, texts those of that message, and numbers
        that are not among the fields are missing.
        """
        kind = self._kinds.get(len(data))
        if kind is not None and kind.has(data):
            return kind.read(data)
        self.ordinary += 1
        return self._learned(data)

    def _learned(self, data: bytes) -> Message:
        """Return the message, converted by the middleware, and learn where its numbers stand."""
        try:
            # First, so that no damaged length makes the middleware reserve memory for it.
            layout = layout_of(_schema(self._type), data)
            message: Message = deserialize_message(data, self._type)
        except (UndecodableMessage, RuntimeError, UnicodeError) as error:
            raise InvalidRequest(f"undecodable message: {error}") from error
        if len(data) > _LARGEST_LEARNED:
            return message
        texts = _runs(_at(layout.size, _text_places(layout)))
        truths = (leaf for leaf in layout.leaves if leaf.type_name == "bool")
        numbers = sorted(_numbers(layout, self._fields), key=attrgetter("offset"))
        kind = _Kind(
            texts,
            texts.unpack_from(data),
            _runs(_at(layout.size, set().union(*(_places(leaf, 1) for leaf in truths)))),
            _together(numbers),
            _part(message, "", _places_among(numbers)),
        )
        if len(data) == layout.size and self._agrees(kind, data, message):
            if len(self._kinds) == _KINDS:
                del self._kinds[next(iter(self._kinds))]
            self._kinds[len(data)] = kind
        return message

    def _agrees(self, kind: "_Kind", data: bytes, message: Message) -> bool:
        """Return whether both ways read the same numbers; else every message goes the ordinary."""
        plain = kind.read(data)
        return all(
            np.array_equal(np.asarray(read(plain)), np.asarray(read(message)), equal_nan=True)
            for read in map(attrgetter, self._fields)
        )


class _Kind(NamedTuple):
    """Messages that differ in numbers only.

    texts    reads all that is no number
    fixed    what it reads in each of them
    truths   reads the truth values
    numbers  reads all numbers that are asked for
    plain    takes them
    """

    texts: struct.Struct
    fixed: tuple[bytes, ...]
    truths: struct.Struct
    numbers: struct.Struct
    plain: "_Part"

    def has(self, data: bytes) -> bool:
        """Return whether a message of the same size is one of them."""
        if self.texts.unpack_from(data) != self.fixed:
            return False
        # A truth value is 0 or 1; the middleware refuses others.
        return not any(truth.strip(b"\0\1") for truth in self.truths.unpack_from(data))

    def read(self, data: bytes) -> SimpleNamespace:
        return self.plain.of(self.numbers.unpack_from(data))


class _Part(NamedTuple):
    """How one message within a message becomes a plain object; numbers by their places."""

    texts: Mapping[str, Any]
    numbers: Sequence[tuple[str, int | slice]]
    parts: Sequence[tuple[str, "_Part"]]

    def of(self, values: Sequence[Any]) -> SimpleNamespace:
        plain = SimpleNamespace(**self.texts)
        attributes = plain.__dict__
        for name, place in self.numbers:
            attributes[name] = values[place]
        for name, part in self.parts:
            attributes[name] = part.of(values)
        return plain


def _part(message: Any, prefix: str, places: Mapping[str, int | slice]) -> _Part:
    texts, numbers, parts = {}, [], []
    for name, type_name in message.get_fields_and_field_types().items():
        path = f"{prefix}{name}"
        if "/" in type_name:
            parts.append((name, _part(getattr(message, name), f"{path}.", places)))
        elif path in places:
            numbers.append((name, places[path]))
        elif "string" in type_name:
            texts[name] = getattr(message, name)
    return _Part(texts, numbers, parts)


def _schema(message_type: type) -> Schema:
    package = message_type.__module__.partition(".")[0]
    return _installed_schema(f"{package}/msg/{message_type.__name__}")


@lru_cache
def _installed_schema(name: str) -> Schema:
    schema = parse_ros2msg(name, definition_text(name))
    for fields in schema.types.values():
        for field in fields:
            if field.repeat is not Repeat.ONCE and is_message(field.type_name):
                raise TypeError(f"{name} has a sequence of messages, {field.name}: no fixed places")
    return schema


class _Number(NamedTuple):
    """Where a number stands, or several one behind the other.

    dtype, code  its type in numpy and in struct
    length       None for one that stands alone
    """

    field: str
    dtype: np.dtype[Any]
    code: str
    length: int | None
    offset: int


def _numbers(layout: Layout, fields: Sequence[str]) -> list[_Number]:
    """Return where the fields stand, in their order; raises KeyError for one that is no number."""
    leaves = {leaf.path: leaf for leaf in layout.leaves if leaf.type_name in DTYPES}
    order = "<" if layout.little_endian else ">"
    found = []
    for field in fields:
        leaf = leaves[field]
        name = DTYPES[leaf.type_name]
        count = leaf.sizes[0] if leaf.repeated else None
        dtype = np.dtype(order + name)
        found.append(_Number(field, dtype, order + _CODES[name], count, leaf.offsets[0]))
    return found


def _together(numbers: Sequence[_Number]) -> struct.Struct:
    """Return what reads numbers from first to last, and skips what is between."""
    order, end = "<", 0
    parts = []
    for number in numbers:
        if number.length == 0:
            continue  # nowhere: an empty sequence may be said to stand behind what follows it
        order, count = number.code[0], 1 if number.length is None else number.length
        parts.append(f"{number.offset - end}x{count}{number.code[1]}")
        end = number.offset + count * number.dtype.itemsize
    return struct.Struct(order + "".join(parts))


def _places_among(numbers: Sequence[_Number]) -> dict[str, int | slice]:
    """Return where each field's numbers are among all of them."""
    places: dict[str, int | slice] = {}
    first = 0
    for number in numbers:
        after = first + (1 if number.length is None else number.length)
        places[number.field] = first if number.length is None else slice(first, after)
        first = after
    return places


def _runs(marked: npt.NDArray[np.bool_]) -> struct.Struct:
    """Return what reads the marked bytes, each run of them as one, and skips the others."""
    edges = np.flatnonzero(np.diff(marked, prepend=False, append=False)).tolist()
    parts, end = [], 0
    for begin, after in zip(edges[::2], edges[1::2], strict=True):
        parts.append(f"{begin - end}x{after - begin}s")
        end = after
    return struct.Struct("".join(parts))


def _text_places(layout: Layout) -> set[int]:
    """Return the places of all lengths and texts, and of the byte order."""
    texts = (leaf for leaf in layout.leaves if leaf.type_name not in DTYPES)
    return set(layout.structure).union(*(_places(leaf, 1) for leaf in texts))


def _number_places(layout: Layout) -> set[int]:
    numbers = (leaf for leaf in layout.leaves if leaf.type_name in DTYPES)
    return set().union(
        *(_places(leaf, np.dtype(DTYPES[leaf.type_name]).itemsize) for leaf in numbers)
    )


def _places(leaf: Leaf, item_size: int) -> set[int]:
    return {
        place
        for begin, size in zip(leaf.offsets, leaf.sizes, strict=True)
        for place in range(begin, begin + size * item_size)
    }


def _at(size: int, places: set[int]) -> npt.NDArray[np.bool_]:
    marked = np.zeros(size, dtype=np.bool_)
    marked[list(places)] = True
    return marked
