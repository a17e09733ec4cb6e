"""Messages read at rate: numbers are taken out of serialised ones, at fixed places.

Every message read is compared with the one whose places were learned; what differs in anything but
numbers takes the ordinary way.
"""

import struct
from collections.abc import Mapping, Sequence
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt
from rclpy.serialization import deserialize_message, serialize_message

from fastswing_planner.cdr.layout import layout_of
from fastswing_planner.conversion.number_places import (
    Number,
    marked,
    numbers_at,
    places_of,
    schema_of,
    text_places,
)
from fastswing_planner.errors import InvalidRequest, UndecodableMessage

Message = TypeVar("Message")

_KINDS = 4
"""Kept at a time: as many publishers of one topic as may reasonably take turns."""
_LARGEST_LEARNED = 16_384
"""[bytes] No state is larger; learning takes its time."""


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
        numbers_at(layout_of(schema_of(message_type), serialize_message(message_type())), fields)

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
            layout = layout_of(schema_of(self._type), data)
            message: Message = deserialize_message(data, self._type)
        except (UndecodableMessage, RuntimeError, UnicodeError) as error:
            raise InvalidRequest(f"undecodable message: {error}") from error
        if len(data) > _LARGEST_LEARNED:
            return message
        texts = _runs(marked(layout.size, text_places(layout)))
        truths = (leaf for leaf in layout.leaves if leaf.type_name == "bool")
        numbers = sorted(numbers_at(layout, self._fields), key=attrgetter("offset"))
        kind = _Kind(
            texts,
            texts.unpack_from(data),
            _runs(marked(layout.size, set().union(*(places_of(leaf, 1) for leaf in truths)))),
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


def _together(numbers: Sequence[Number]) -> struct.Struct:
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


def _places_among(numbers: Sequence[Number]) -> dict[str, int | slice]:
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
