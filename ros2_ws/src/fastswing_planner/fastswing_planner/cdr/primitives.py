"""The types that messages are made of."""

PRIMITIVE_SIZE = {
    "bool": 1,
    "int8": 1,
    "uint8": 1,
    "int16": 2,
    "uint16": 2,
    "int32": 4,
    "uint32": 4,
    "int64": 8,
    "uint64": 8,
    "float32": 4,
    "float64": 8,
}
"""[bytes] of each type of fixed size; its alignment too."""
TEXTS = ("string", "wstring")


def is_message(type_name: str) -> bool:
    """Whether a field's type is a message of its own."""
    return type_name not in PRIMITIVE_SIZE and type_name not in TEXTS


DTYPES = {
    "bool": "?",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
"""numpy's name of each primitive type, without byte order."""
