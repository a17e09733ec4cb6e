"""Message definitions in the encoding `ros2idl`: the part of OMG IDL that rosidl uses."""

import re
from collections.abc import Mapping

from fastswing_planner.cdr.schema import Field, Repeat, Schema, checked, full_name
from fastswing_planner.errors import UndecodableMessage

_SEPARATOR = re.compile(r"^={80}\r?\nIDL: [^\n]*\n", re.MULTILINE)
_TOKEN = re.compile(
    r"""(?P<skip>\s+|//[^\n]*|/\*.*?\*/|\#[^\n]*)
    |(?P<text>"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')
    |(?P<word>[A-Za-z_][\w]*(?:::[A-Za-z_]\w*)*|::[A-Za-z_]\w*(?:::[A-Za-z_]\w*)*)
    |(?P<number>[-+]?\.?\d[\w.+-]*)
    |(?P<sign>[@(){}<>\[\];,=:+*/|&^~%-])""",
    re.VERBOSE | re.DOTALL,
)
_PRIMITIVES = {
    "boolean": "bool",
    "octet": "uint8",
    "char": "uint8",
    "float": "float32",
    "double": "float64",
    "short": "int16",
    "long": "int32",
    "long long": "int64",
    "unsigned short": "uint16",
    "unsigned long": "uint32",
    "unsigned long long": "uint64",
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
    "string": "string",
    "wstring": "wstring",
}


def parse_ros2idl(name: str, text: str) -> Schema:
    """Return the type `name` of a definition in encoding `ros2idl`; raises UndecodableMessage."""
    name = full_name(name)
    types: dict[str, tuple[Field, ...]] = {}
    for section in _SEPARATOR.split(text):
        types.update(_Section(name, section).read())
    return checked(Schema(name, types))


class _Section:
    """One .idl text: modules with structs, type definitions and constants."""

    def __init__(self, owner: str, text: str) -> None:
        self._owner = owner
        self._tokens = list(_tokens(owner, text))
        self._next = 0
        self._definitions: dict[str, Field] = {}
        self._structs: dict[str, tuple[Field, ...]] = {}

    def read(self) -> Mapping[str, tuple[Field, ...]]:
        """Return the fields of every struct by its full name."""
        while self._next < len(self._tokens):
            self._statement(())
        return self._structs

    def _peek(self) -> str:
        return self._tokens[self._next] if self._next < len(self._tokens) else ""

    def _take(self, expected: str = "") -> str:
        token = self._peek()
        if not token or (expected and token != expected):
            found = f"'{token}'" if token else "its end"
            wanted = f"'{expected}'" if expected else "more"
            raise UndecodableMessage(
                f"the IDL definition of {self._owner} has {found} where {wanted} is expected"
            )
        self._next += 1
        return token

    def _statement(self, modules: tuple[str, ...]) -> None:
        self._skip_annotations()
        word = self._take()
        if word == "module":
            inner = (*modules, self._take())
            self._take("{")
            while self._peek() != "}":
                self._statement(inner)
            self._take("}")
        elif word == "struct":
            self._struct(modules)
        elif word == "typedef":
            defined = self._member(modules)
            self._definitions["::".join((*modules, defined.name))] = defined
            return
        elif word == "const":
            while self._peek() != ";":
                self._take()
        else:
            raise UndecodableMessage(f"the IDL definition of {self._owner} has '{word}'")
        self._take(";")

    def _skip_annotations(self) -> None:
        while self._peek() == "@":
            self._take()
            self._take()
            if self._peek() == "(":
                depth = 0
                while True:
                    token = self._take()
                    depth += (token == "(") - (token == ")")
                    if depth == 0:
                        break

    def _struct(self, modules: tuple[str, ...]) -> None:
        name = "/".join((*modules, self._take()))
        self._take("{")
        fields = []
        self._skip_annotations()
        while self._peek() != "}":
            fields.append(self._member(modules))
            self._skip_annotations()
        self._take("}")
        # What IDL demands of a message without fields; CDR has it on the wire too.
        self._structs[name] = tuple(
            field for field in fields if field.name != "structure_needs_at_least_one_member"
        )

    def _member(self, modules: tuple[str, ...]) -> Field:
        kind = self._type(modules)
        name = self._take()
        if self._peek() == "[":
            self._take()
            count = int(self._take())
            self._take("]")
            if kind.repeat is not Repeat.ONCE:
                raise UndecodableMessage(
                    f"the IDL definition of {self._owner}: '{name}' is an array of arrays"
                )
            kind = Field("", kind.type_name, Repeat.ARRAY, count)
        self._take(";")
        return Field(name, kind.type_name, kind.repeat, kind.count)

    def _type(self, modules: tuple[str, ...]) -> Field:
        """Read a type; returns a field without a name."""
        self._skip_annotations()
        word = self._take()
        while word in ("unsigned", "unsigned long", "long") and self._peek() in ("long", "short"):
            word = f"{word} {self._take()}"
        if word == "sequence":
            self._take("<")
            inner = self._type(modules)
            self._skip_bound()
            self._take(">")
            if inner.repeat is not Repeat.ONCE:
                raise UndecodableMessage(
                    f"the IDL definition of {self._owner} has a sequence of arrays"
                )
            return Field("", inner.type_name, Repeat.SEQUENCE, 0)
        if word in _PRIMITIVES:
            if self._peek() == "<":
                self._take("<")
                self._take()
                self._take(">")
            return Field("", _PRIMITIVES[word])
        return self._named(word.removeprefix("::"), modules)

    def _skip_bound(self) -> None:
        if self._peek() == ",":
            self._take()
            self._take()

    def _named(self, word: str, modules: tuple[str, ...]) -> Field:
        for depth in range(len(modules), -1, -1):
            scoped = "::".join((*modules[:depth], word))
            if scoped in self._definitions:
                return self._definitions[scoped]
        if "::" not in word:
            word = "::".join((*modules, word))
        return Field("", word.replace("::", "/"))


def _tokens(owner: str, text: str) -> list[str]:
    found = []
    at = 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None:
            raise UndecodableMessage(
                f"the IDL definition of {owner} has '{text[at : at + 20].splitlines()[0]}'"
            )
        if match.lastgroup != "skip":
            found.append(match[0])
        at = match.end()
    return found
