"""Messages written at rate: numbers are put into a serialised one, at fixed places."""

import struct
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from rclpy.serialization import serialize_message

from fastswing_planner.cdr.layout import layout_of
from fastswing_planner.conversion.number_places import (
    Number,
    marked,
    number_places,
    numbers_at,
    schema_of,
    text_places,
)


class MessageTemplate:
    """A serialised message in which some numbers are replaced, again and again."""

    def __init__(self, message: Any, fields: Sequence[str]) -> None:
        """Serialise `message` once.

        fields  paths of the numbers that change, such as 'header.stamp.sec' or 'position'

        All texts and the lengths of all sequences stay those of `message`. Raises KeyError for a
        path that is no number of the message.
        """
        data = serialize_message(message)
        layout = layout_of(schema_of(type(message)), data)
        # Whatever the middleware's memory held stands between the fields and behind them.
        content = marked(layout.size, text_places(layout) | number_places(layout))
        self._buffer = bytearray(np.where(content, np.frombuffer(data, np.uint8), 0).tobytes())
        self._places = [self._place(number) for number in numbers_at(layout, fields)]

    def _place(self, number: Number) -> "_Scalar | _Array":
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
