"""Reads launch files as `ros2 launch`, which is not everywhere, does: what is started, and how.

It knows the tags, attributes and substitutions that the files here use, and refuses all others.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree import ElementTree

from ament_index_python.packages import get_package_share_directory

# What launch (Jazzy) reads of each tag, of what is used here.
ATTRIBUTES = {
    "launch": set(),
    "arg": {"name", "default", "description", "value"},
    "group": {"if", "unless"},
    "include": {"file", "if", "unless"},
    "push-ros-namespace": {"namespace"},
    "set_remap": {"from", "to"},
    "node": {
        *("pkg", "exec", "name", "output", "args", "ros_args", "respawn", "respawn_delay"),
        *("if", "unless"),
    },
    "param": {"name", "value", "from"},
    "remap": {"from", "to"},
    "executable": {"cmd", "output", "if", "unless"},
}


class LaunchError(Exception):
    """A launch file that `ros2 launch` would refuse, or that says what is not known here."""


@dataclass(frozen=True)
class Program:
    """One process that a launch file starts: `ros2 run PACKAGE NAME ARGUMENTS --ros-args ...`."""

    package: str
    name: str
    arguments: tuple[str, ...] = ()
    ros_arguments: tuple[str, ...] = ()
    respawn: bool = False


@dataclass
class _Scope:
    """What holds from some line of a file on: arguments, namespace, remaps."""

    values: dict[str, str]
    namespace: str = ""
    remaps: list[str] = field(default_factory=list)

    def inner(self) -> "_Scope":
        return replace(self, values=dict(self.values), remaps=list(self.remaps))

    def text(self, template: str) -> str:
        """Return a text with its substitutions made."""

        def made(match: re.Match[str]) -> str:
            name, *rest = match[1].split()
            if name == "var":
                return self._value(rest[0])
            if name == "find-pkg-share":
                return get_package_share_directory(rest[0])
            raise LaunchError(f"unknown substitution {match[0]}")

        return re.sub(r"\$\(([^()]*)\)", made, template)

    def _value(self, name: str) -> str:
        if name not in self.values:
            raise LaunchError(f"the argument {name} is not given and has no default")
        return self.values[name]

    def words(self, template: str) -> tuple[str, ...]:
        """Return the words of a command line; what a substitution becomes stays one word."""
        return tuple(self.text(word) for word in re.findall(r"(?:\$\([^()]*\)|\S)+", template))

    def holds(self, element: ElementTree.Element) -> bool:
        """Whether `if` and `unless` allow an element."""
        wanted, unwanted = element.get("if", "true"), element.get("unless", "false")
        return _boolean(self.text(wanted)) and not _boolean(self.text(unwanted))


def _boolean(text: str) -> bool:
    if text.lower() not in ("true", "1", "false", "0"):
        raise LaunchError(f"'{text}' is neither true nor false")
    return text.lower() in ("true", "1")


def programs(path: Path, values: Mapping[str, str]) -> list[Program]:
    """Return what a launch file starts with these arguments, in order; raises LaunchError."""
    return list(_file(path, _Scope(dict(values))))


def _file(path: Path, scope: _Scope) -> Iterator[Program]:
    root = ElementTree.parse(path).getroot()
    for element in root.iter():
        unknown = set(element.attrib) - ATTRIBUTES.get(element.tag, set())
        if element.tag not in ATTRIBUTES or unknown:
            raise LaunchError(f"unknown in {path.name}: <{element.tag}> {sorted(unknown)}")
    yield from _children(root, scope)


def _children(parent: ElementTree.Element, scope: _Scope) -> Iterator[Program]:
    for element in parent:
        if scope.holds(element):
            yield from _ACTIONS[element.tag](element, scope)


def _argument(element: ElementTree.Element, scope: _Scope) -> Iterator[Program]:
    if "default" in element.attrib:
        scope.values.setdefault(element.attrib["name"], scope.text(element.attrib["default"]))
    yield from ()


def _namespace(element: ElementTree.Element, scope: _Scope) -> Iterator[Program]:
    name = scope.text(element.attrib["namespace"])
    scope.namespace = name if name.startswith("/") else f"{scope.namespace}/{name}"
    yield from ()


def _remap(element: ElementTree.Element, scope: _Scope) -> Iterator[Program]:
    scope.remaps += _remap_of(element, scope)
    yield from ()


def _remap_of(element: ElementTree.Element, scope: _Scope) -> list[str]:
    return ["-r", f"{scope.text(element.attrib['from'])}:={scope.text(element.attrib['to'])}"]


def _include(element: ElementTree.Element, scope: _Scope) -> Iterator[Program]:
    inner = scope.inner()
    for argument in element.findall("arg"):
        inner.values[argument.attrib["name"]] = scope.text(argument.attrib["value"])
    yield from _file(Path(scope.text(element.attrib["file"])), inner)


def _node(element: ElementTree.Element, scope: _Scope) -> Iterator[Program]:
    ros = list(scope.words(element.get("ros_args", "")))
    if "name" in element.attrib:
        ros += ["-r", f"__node:={scope.text(element.attrib['name'])}"]
    if scope.namespace:
        ros += ["-r", f"__ns:={scope.namespace}"]
    for parameter in element.findall("param"):
        if "from" in parameter.attrib:
            ros += ["--params-file", scope.text(parameter.attrib["from"])]
        else:
            ros += ["-p", f"{parameter.attrib['name']}:={scope.text(parameter.attrib['value'])}"]
    ros += scope.remaps
    for remap in element.findall("remap"):
        ros += _remap_of(remap, scope)
    yield Program(
        scope.text(element.attrib["pkg"]),
        scope.text(element.attrib["exec"]),
        scope.words(element.get("args", "")),
        tuple(ros),
        _boolean(element.get("respawn", "false")),
    )


def _executable(element: ElementTree.Element, scope: _Scope) -> Iterator[Program]:
    found = re.match(r"\$\(exec-in-pkg (\w+) (\w+)\)(.*)", element.attrib["cmd"])
    if found is None:
        raise LaunchError(f"not an executable of a package: {element.attrib['cmd']}")
    yield Program(found[2], found[1], scope.words(found[3]))


_ACTIONS: dict[str, Callable[[ElementTree.Element, _Scope], Iterator[Program]]] = {
    "arg": _argument,
    "group": lambda element, scope: _children(element, scope.inner()),
    "include": _include,
    "push-ros-namespace": _namespace,
    "set_remap": _remap,
    "node": _node,
    "executable": _executable,
}
