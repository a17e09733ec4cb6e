"""Messages at rate: serialised ones are read and written at fixed places.

In a serialised message the place of everything follows from the lengths before it (`cdr_layout`).
So messages whose texts and lengths agree have their numbers at the same places, and a node that
sends or gets a message a thousand times a second needs the middleware's conversion for the first
one only. Every message read is compared with the one whose places were learned; what differs in
anything but numbers takes the ordinary way.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt
from rclpy.serialization import deserialize_message, serialize_message

from fastswing_planner.bag_errors import UndecodableMessage
from fastswing_planner.cdr_layout import Layout, Leaf, layout_of
from fastswing_planner.errors import InvalidRequest
from fastswing_planner.message_columns import DTYPES
from fastswing_planner.message_definition import definition_text
from fastswing_planner.message_schema import Repeat, Schema, is_message, parse_ros2msg

Message = TypeVar("Message")

_KINDS = 4
"""Kept at a time: as many publishers of one topic as may reasonably take turns."""
_LARGEST_LEARNED = 16_384
"""[bytes] No state is larger; learning takes its time."""
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
        record = np.frombuffer(self._buffer, _record_type(layout, fields))
        self._places = tuple(record[field].reshape(record[field].shape[1:]) for field in fields)

    def filled(self, *values: Any) -> bytes:
        """Return the message with `values`, one for each of the fields, in their order.

        A sequence's value has as many elements as the sequence had; an array or a list. Raises
        ValueError for another number of values or elements.
        """
        with np.errstate(invalid="ignore"):  # a number that is none stays none, whatever its bits
            for place, value in zip(self._places, values, strict=True):
                if place.ndim and len(value) != place.size:  # numpy would repeat a single element
                    raise ValueError(f"{len(value)} elements for a sequence of {place.size}")
                place[...] = value
        return bytes(self._buffer)


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
        _record_type(layout_of(_schema(message_type), serialize_message(message_type())), fields)

    def read(self, data: bytes) -> Message | SimpleNamespace:
        """Return the message; raises InvalidRequest for bytes that are none.

        If `data` differs from a message that took the ordinary way in numbers only, it is a plain
        object with the same attributes: arrays are read-only views of `data`, texts those of
        that message, and numbers that are not among the fields are missing.
        """
        kind = self._kinds.get(len(data))
        # As one long number the bytes are compared in a single step.
        if kind is not None and int.from_bytes(data, "little") & kind.mask == kind.fixed:
            return kind.plain.of(np.frombuffer(data, kind.record_type)[0])
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
        mask = np.where(_at(layout.size, _text_places(layout)), 0xFF, 0).astype(np.uint8)
        # A truth value is 0 or 1; the middleware refuses others.
        truths = (leaf for leaf in layout.leaves if leaf.type_name == "bool")
        mask[[place for leaf in truths for place in _places(leaf, 1)]] = 0xFE
        as_number = int.from_bytes(mask.tobytes(), "little")
        kind = _Kind(
            as_number,
            int.from_bytes(data, "little") & as_number,
            _record_type(layout, self._fields),
            _part(message, "", self._fields),
        )
        if len(data) == layout.size and self._agrees(kind, data, message):
            if len(self._kinds) == _KINDS:
                del self._kinds[next(iter(self._kinds))]
            self._kinds[len(data)] = kind
        return message

    def _agrees(self, kind: "_Kind", data: bytes, message: Message) -> bool:
        """Return whether both ways read the same numbers; else every message goes the ordinary."""
        plain = kind.plain.of(np.frombuffer(data, kind.record_type)[0])
        return all(
            np.array_equal(np.asarray(read(plain)), np.asarray(read(message)), equal_nan=True)
            for read in map(attrgetter, self._fields)
        )


class _Kind(NamedTuple):
    """Messages that differ in numbers only.

    mask, fixed  which bits are the same in all of them, and their values, as one long number
    """

    mask: int
    fixed: int
    record_type: np.dtype[np.void]
    plain: "_Part"


class _Part(NamedTuple):
    """How one message within a message becomes a plain object."""

    texts: Mapping[str, Any]
    numbers: Sequence[tuple[str, str]]
    parts: Sequence[tuple[str, "_Part"]]

    def of(self, record: np.void) -> SimpleNamespace:
        plain = SimpleNamespace(**self.texts)
        for name, field in self.numbers:
            value = record[field]
            # A number of numpy's overflows where one of Python's does not.
            plain.__dict__[name] = value if isinstance(value, np.ndarray) else value.item()
        for name, part in self.parts:
            plain.__dict__[name] = part.of(record)
        return plain


def _part(message: Any, prefix: str, fields: Sequence[str]) -> _Part:
    texts, numbers, parts = {}, [], []
    for name, type_name in message.get_fields_and_field_types().items():
        path = f"{prefix}{name}"
        if "/" in type_name:
            parts.append((name, _part(getattr(message, name), f"{path}.", fields)))
        elif path in fields:
            numbers.append((name, path))
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


def _record_type(layout: Layout, fields: Sequence[str]) -> np.dtype[np.void]:
    """Return the type of a record that lies over the whole message."""
    leaves = {leaf.path: leaf for leaf in layout.leaves if leaf.type_name in DTYPES}
    chosen = [leaves[field] for field in fields]
    order = "<" if layout.little_endian else ">"
    formats: list[Any] = []
    for leaf in chosen:
        number = np.dtype(order + DTYPES[leaf.type_name])
        formats.append((number, leaf.sizes) if leaf.repeated else number)
    return np.dtype(
        {
            "names": list(fields),
            "formats": formats,
            "offsets": [leaf.offsets[0] for leaf in chosen],
            "itemsize": layout.size,
        }
    )


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
