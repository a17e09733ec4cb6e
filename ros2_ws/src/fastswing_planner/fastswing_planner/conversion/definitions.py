"""What a message type is made of: the text that explains a bag years later, and its hash."""

import json
import re
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from fastswing_planner.errors import PlannerError

SEPARATOR = "=" * 80

_PRIMITIVE = re.compile(r"bool|byte|char|float(32|64)|u?int(8|16|32|64)|w?string")
_TYPE_NAME = re.compile(r"([a-zA-Z]\w*)/(?:msg/)?([a-zA-Z]\w*)")


class UnknownMessageType(PlannerError):
    """A message type that is not installed, or no message type at all."""

    code_name = "NOT_READY"


def split_type_name(type_name: str) -> tuple[str, str]:
    """Return package and name of 'package/msg/Name' or 'package/Name'."""
    match = _TYPE_NAME.fullmatch(type_name)
    if match is None:
        raise UnknownMessageType(f"'{type_name}' is no message type, expected package/msg/Name")
    return match[1], match[2]


def definition_text(type_name: str) -> str:
    """Return the type's .msg text, followed by those of all types that it is built from.

    The form is that of MCAP's schema encoding `ros2msg`: each further type stands once, below a
    line of 80 '=' and a line 'MSG: package/Name'. Raises UnknownMessageType.
    """
    package, name = split_type_name(type_name)
    return _expand(f"{package}/{name}", {f"{package}/{name}"})


def type_hash(type_name: str) -> str:
    """Return the installed type's hash, 'RIHS01_...'; empty if none is installed."""
    package, name = split_type_name(type_name)
    try:
        description = json.loads(_installed(package, f"{name}.json").read_text())
        hashes = {row["type_name"]: row["hash_string"] for row in description["type_hashes"]}
    except (OSError, KeyError, ValueError):
        return ""
    return str(hashes.get(f"{package}/msg/{name}", ""))


def _installed(package: str, file_name: str) -> Path:
    try:
        share = get_package_share_directory(package)
    except (PackageNotFoundError, ValueError) as error:
        raise UnknownMessageType(
            f"message package '{package}' is not installed; source its workspace"
        ) from error
    return Path(share) / "msg" / file_name


def _expand(short_name: str, seen: set[str]) -> str:
    package, name = short_name.split("/")
    try:
        text = _installed(package, f"{name}.msg").read_text()
    except OSError as error:
        raise UnknownMessageType(f"package '{package}' has no message '{name}'") from error
    parts = [text]
    for other in sorted(_field_types(text, package)):
        if other not in seen:
            seen.add(other)
            parts.append(f"\n{SEPARATOR}\nMSG: {other}\n{_expand(other, seen)}")
    return "".join(parts)


def _field_types(text: str, package: str) -> set[str]:
    """Return 'package/Name' of each message that a .msg text uses."""
    found = set()
    for line in text.splitlines():
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        field_type = re.sub(r"\[.*\]$|<=.*$", "", words[0])
        if _PRIMITIVE.fullmatch(field_type):
            continue
        whole = field_type if "/" in field_type else f"{package}/{field_type}"
        found.add("/".join(split_type_name(whole)))
    return found
