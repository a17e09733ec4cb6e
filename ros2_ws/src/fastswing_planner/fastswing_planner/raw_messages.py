"""Messages at rate: serialised ones are read and written at fixed places.

In a serialised message the place of everything follows from the lengths before it (`cdr_layout`).
So messages whose texts and lengths agree have their numbers at the same places, and a node that
sends or gets the same kind of message a thousand times a second needs the middleware's conversion
for the first one only. Every message read is compared with the one whose places were learned; what
differs in anything but numbers takes the ordinary way.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Generic, TypeVar

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
        for place, value in zip(self._places, values, strict=True):
            if place.ndim and len(value) != place.size:  # numpy would repeat a single element
                raise ValueError(f"{len(value)} elements for a sequence of {place.size}")
            place[...] = value
        return bytes(self._buffer)


class RawReader(Generic[Message]):
    """Reads some numbers of serialised messages of one type."""

    def __init__(self, message_type: type[Message], fields: Sequence[str]) -> None:
        """Read `fields`, paths such as 'header.stamp.sec' or 'position'.

        Raises KeyError for a path that is no number of the type.
        """
        self._type = message_type
        self._fields = tuple(fields)
        self._size = -1  # no message's
        self._mask = self._fixed = 0
        self._record_type = np.dtype([])
        # An empty message tells about a wrong path now, not in a callback.
        _record_type(layout_of(_schema(message_type), serialize_message(message_type())), fields)

    def numbers(self, data: bytes) -> np.void | None:
        """Return the numbers by field if `data` differs from the last `message` in numbers only.

        Arrays are read-only views of `data`. None: `message` has to read this one.
        """
        if len(data) != self._size:
            return None
        # As one long number the bytes are compared in a single step.
        if int.from_bytes(data, "little") & self._mask != self._fixed:
            return None
        record: np.void = np.frombuffer(data, self._record_type)[0]
        return record

    def message(self, data: bytes) -> Message:
        """Return the message, converted by the middleware, and learn where its numbers stand.

        Raises InvalidRequest for bytes that are no such message.
        """
        try:
            # First, so that no damaged length makes the middleware reserve memory for it.
            layout = layout_of(_schema(self._type), data)
            message: Message = deserialize_message(data, self._type)
        except (UndecodableMessage, RuntimeError) as error:
            raise InvalidRequest(f"undecodable message: {error}") from error
        self._record_type = _record_type(layout, self._fields)
        fixed = np.where(_at(layout.size, _text_places(layout)), 0xFF, 0).astype(np.uint8)
        self._mask = int.from_bytes(fixed.tobytes(), "little")
        self._fixed = int.from_bytes(data, "little") & self._mask
        self._size = layout.size
        return message


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
