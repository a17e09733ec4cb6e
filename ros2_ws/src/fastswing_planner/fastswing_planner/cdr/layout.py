"""Where the fields of a serialised message (CDR) stand, and the message as a plain object.

In CDR the place of everything follows from the lengths of the texts and sequences before it. So two
messages whose length words are equal, at equal places, have equal layouts: `Layout.structure`
lists these bytes, and comparing them proves that a layout fits a message.
"""

import struct
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from fastswing_planner.cdr.primitives import PRIMITIVE_SIZE, PRIMITIVES, TEXTS, is_message
from fastswing_planner.cdr.schema import Field, Repeat, Schema
from fastswing_planner.errors import UndecodableMessage

HEADER_SIZE = 4
_MAX_PADDING = 3
_MAX_PADDING_FOR_EMPTY = 8
"""[bytes] Fast DDS reserves the alignment of elements that do not follow, at the message's end.

4 bytes for each empty sequence, and 4 more where that makes a later field's alignment another one.
"""


@dataclass(frozen=True)
class Leaf:
    """Where the values of one field stand.

    path       'header.stamp.sec'
    type_name  a primitive or 'string'
    repeated   whether it is an array or a sequence
    offsets    [bytes] of the values if primitive: one place, all values one behind the other;
               if a text: one place for each
    sizes      number of values if primitive; [bytes] of each text
    """

    path: str
    type_name: str
    repeated: bool
    offsets: tuple[int, ...]
    sizes: tuple[int, ...]


@dataclass(frozen=True)
class Layout:
    """A message's layout.

    size           [bytes] of the whole message
    little_endian  byte order
    leaves         of every field outside of arrays and sequences of messages
    structure      places [bytes] of what determines the layout
    template       what stands there
    """

    size: int
    little_endian: bool
    leaves: tuple[Leaf, ...]
    structure: tuple[int, ...]
    template: bytes


class _Cursor:
    """Walks along one message."""

    def __init__(self, schema: Schema, data: bytes) -> None:
        if len(data) < HEADER_SIZE or data[0] != 0 or data[1] not in (0, 1):
            begin = data[:HEADER_SIZE].hex(" ")
            raise UndecodableMessage(f"a {schema.name} begins with '{begin}': no plain CDR")
        self.schema = schema
        self.data = data
        self.little_endian = data[1] == 1
        self.order = "<" if self.little_endian else ">"
        self.at = HEADER_SIZE
        self.structure = [0, 1]
        self._empty = 0
        self._word = struct.Struct(f"{self.order}I")

    def align(self, size: int) -> None:
        self.at += (HEADER_SIZE - self.at) % size

    def skip(self, count: int) -> int:
        """Move on by `count` bytes; returns where they begin."""
        begin = self.at
        if begin + count > len(self.data):
            raise UndecodableMessage(
                f"a {self.schema.name} of {len(self.data)} bytes ends before its fields do"
            )
        self.at += count
        return begin

    def length(self) -> int:
        """Read a length word."""
        self.align(4)
        begin = self.skip(4)
        self.structure += range(begin, begin + 4)
        return int(self._word.unpack_from(self.data, begin)[0])

    def text(self) -> tuple[int, int]:
        """Read over a text; returns place and size [bytes] without the closing zero."""
        size = self.length()
        begin = self.skip(size)
        if size and self.data[begin + size - 1] == 0:
            # The closing zero decides about the size, so it is part of the structure.
            self.structure.append(begin + size - 1)
            return begin, size - 1
        if size:
            raise UndecodableMessage(f"a text in a {self.schema.name} has no end")
        return begin, 0

    def values(self, type_name: str, count: int) -> int:
        """Read over primitives; returns their place."""
        if count:
            self.align(PRIMITIVE_SIZE[type_name])
        return self.skip(count * PRIMITIVE_SIZE[type_name])

    def count(self, field: Field) -> int:
        """Return how often the field's type follows."""
        if field.repeat is not Repeat.SEQUENCE:
            return field.count
        count = self.length()
        self._empty += count == 0
        if count > len(self.data) - self.at:  # each element needs a byte at least
            raise UndecodableMessage(
                f"a {self.schema.name} of {len(self.data)} bytes has a sequence of {count} elements"
            )
        return count

    def finish(self) -> None:
        allowed = _MAX_PADDING + self._empty * _MAX_PADDING_FOR_EMPTY
        if len(self.data) - self.at > allowed:
            raise UndecodableMessage(
                f"a {self.schema.name} of {len(self.data)} bytes is longer than its definition "
                f"says, {self.at} bytes"
            )


def layout_of(schema: Schema, data: bytes) -> Layout:
    """Return the layout of one message; raises UndecodableMessage."""
    cursor = _Cursor(schema, data)
    leaves: list[Leaf] = []
    _walk(cursor, schema.name, "", leaves)
    cursor.finish()
    return Layout(
        len(data),
        cursor.little_endian,
        tuple(leaves),
        tuple(cursor.structure),
        bytes(data[place] for place in cursor.structure),
    )


def _walk(cursor: _Cursor, type_name: str, prefix: str, leaves: list[Leaf] | None) -> None:
    """Read over one message; its fields go to `leaves` if there are any to go to."""
    fields = cursor.schema.types[type_name]
    if not fields:
        cursor.skip(1)  # ROS puts one byte where a message has no field.
    for field in fields:
        repeated = field.repeat is not Repeat.ONCE
        count = cursor.count(field)
        path = prefix + field.name
        if is_message(field.type_name):
            for _ in range(count):
                _walk(cursor, field.type_name, f"{path}.", None if repeated else leaves)
            continue
        if field.type_name in TEXTS:
            texts = [_text(cursor, field, path) for _ in range(count)]
            offsets, sizes = tuple(t[0] for t in texts), tuple(t[1] for t in texts)
        else:
            offsets, sizes = (cursor.values(field.type_name, count),), (count,)
        if leaves is not None:
            leaves.append(Leaf(path, field.type_name, repeated, offsets, sizes))


def _text(cursor: _Cursor, field: Field, path: str) -> tuple[int, int]:
    if field.type_name == "wstring":
        raise UndecodableMessage(
            f"{path} of {cursor.schema.name} is a wstring, which each middleware writes its own way"
        )
    return cursor.text()


def decode(schema: Schema, data: bytes) -> SimpleNamespace:
    """Return one message as a plain object; raises UndecodableMessage.

    Fields are attributes; arrays and sequences are lists, messages again such objects.
    """
    cursor = _Cursor(schema, data)
    message = _decode(cursor, schema.name)
    cursor.finish()
    return message


def _decode(cursor: _Cursor, type_name: str) -> SimpleNamespace:
    message = SimpleNamespace()
    fields = cursor.schema.types[type_name]
    if not fields:
        cursor.skip(1)
    for field in fields:
        setattr(message, field.name, _value(cursor, field))
    return message


def _value(cursor: _Cursor, field: Field) -> Any:
    count = cursor.count(field)
    values: list[Any]
    if is_message(field.type_name):
        values = [_decode(cursor, field.type_name) for _ in range(count)]
    elif field.type_name in TEXTS:
        values = []
        for _ in range(count):
            begin, size = _text(cursor, field, field.name)
            values.append(text_of(cursor.data[begin : begin + size]))
    else:
        begin = cursor.values(field.type_name, count)
        code = f"{cursor.order}{count}{PRIMITIVES[field.type_name].code}"
        values = list(struct.unpack_from(code, cursor.data, begin))
    return values[0] if field.repeat is Repeat.ONCE else values


def text_of(data: bytes) -> str:
    """Return a text; bytes that are no UTF-8 are shown in hexadecimal."""
    return data.decode("utf-8", "backslashreplace")
