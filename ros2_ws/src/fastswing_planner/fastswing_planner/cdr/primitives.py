"""The types that messages are made of: the one table of them."""

from typing import NamedTuple

import numpy as np


class Primitive(NamedTuple):
    """A type of fixed size.

    dtype  numpy's name of it, without byte order
    code   struct's
    """

    dtype: str
    code: str

    @property
    def size(self) -> int:
        """[bytes] and its alignment too."""
        return np.dtype(self.dtype).itemsize


PRIMITIVES = {
    "bool": Primitive("?", "?"),
    "int8": Primitive("i1", "b"),
    "uint8": Primitive("u1", "B"),
    "int16": Primitive("i2", "h"),
    "uint16": Primitive("u2", "H"),
    "int32": Primitive("i4", "i"),
    "uint32": Primitive("u4", "I"),
    "int64": Primitive("i8", "q"),
    "uint64": Primitive("u8", "Q"),
    "float32": Primitive("f4", "f"),
    "float64": Primitive("f8", "d"),
}
PRIMITIVE_SIZE = {name: primitive.size for name, primitive in PRIMITIVES.items()}
TEXTS = ("string", "wstring")


def is_message(type_name: str) -> bool:
    """Whether a field's type is a message of its own."""
    return type_name not in PRIMITIVES and type_name not in TEXTS
