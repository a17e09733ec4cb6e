"""The fields of a message type, from the definition that a bag carries; no ROS needed.

The encoding is `ros2msg`: the .msg text with all that it depends on.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from fastswing_planner.cdr.primitives import is_message
from fastswing_planner.errors import UndecodableMessage

_SEPARATOR = re.compile(r"^={80}\r?\n", re.MULTILINE)
_FIELD = re.compile(
    r"(?P<type>[\w/]+)(?:<=\d+)?(?P<array>\[(?:<=\d+|\d*)\])?\s+(?P<name>[a-zA-Z]\w*)(?P<rest>.*)"
)
_DEEPEST = 100
_ALIASES = {"byte": "uint8", "char": "uint8"}


class Repeat(Enum):
    """How often a field's type occurs."""

    ONCE = "once"
    ARRAY = "array of fixed length"
    SEQUENCE = "sequence"


@dataclass(frozen=True)
class Field:
    """One field; `type_name` is a primitive, 'string', 'wstring' or 'package/msg/Name'."""

    name: str
    type_name: str
    repeat: Repeat = Repeat.ONCE
    count: int = 1


@dataclass(frozen=True, eq=False)
class Schema:
    """A message type with all types that it is built from.

    name   'package/msg/Name'
    types  the fields of each type, by its full name
    """

    name: str
    types: Mapping[str, tuple[Field, ...]]

    @property
    def fields(self) -> tuple[Field, ...]:
        """Of the type itself."""
        return self.types[self.name]


def full_name(name: str) -> str:
    """Return 'package/msg/Name' of 'package/Name' or of itself."""
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name


def parse_ros2msg(name: str, text: str) -> Schema:
    """Return the type `name` of a definition in encoding `ros2msg`; raises UndecodableMessage."""
    name = full_name(name)
    first, *others = _SEPARATOR.split(text)
    types = {name: _fields(name, first)}
    for section in others:
        title, _, body = section.partition("\n")
        if not title.startswith("MSG:"):
            raise UndecodableMessage(f"the definition of {name} has a section '{title.strip()}'")
        other = full_name(title.removeprefix("MSG:").strip())
        types[other] = _fields(other, body)
    return checked(Schema(name, types))


def checked(schema: Schema) -> Schema:
    """Return the schema if it defines every type that it needs, and none contains itself."""
    done: set[str] = set()

    def visit(name: str, inside: tuple[str, ...]) -> None:
        if len(inside) > _DEEPEST:
            raise UndecodableMessage(
                f"the definition of {schema.name} nests types more than {_DEEPEST} deep"
            )
        if name in inside:
            raise UndecodableMessage(f"the definition of {schema.name}: {name} contains itself")
        if name not in schema.types:
            raise UndecodableMessage(f"the definition of {schema.name} does not define {name}")
        if name not in done:
            for field in schema.types[name]:
                if is_message(field.type_name):
                    visit(field.type_name, (*inside, name))
        done.add(name)

    visit(schema.name, ())
    return schema


def _fields(owner: str, text: str) -> tuple[Field, ...]:
    found = []
    for line in text.splitlines():
        bare = line.split("#", 1)[0].strip()
        if not bare:
            continue
        match = _FIELD.fullmatch(bare)
        if match is None:
            raise UndecodableMessage(f"the definition of {owner} has the line '{bare}'")
        if not match["rest"].lstrip().startswith("="):  # that would be a constant
            found.append(_field(owner, match["type"], match["array"] or "", match["name"]))
    return tuple(found)


def _field(owner: str, type_name: str, array: str, name: str) -> Field:
    type_name = _ALIASES.get(type_name, type_name)
    if is_message(type_name):
        package = owner.split("/", 1)[0]
        type_name = full_name(type_name if "/" in type_name else f"{package}/{type_name}")
    if not array:
        return Field(name, type_name)
    size = array[1:-1]
    if size.isdigit():
        return Field(name, type_name, Repeat.ARRAY, int(size))
    return Field(name, type_name, Repeat.SEQUENCE, 0)
