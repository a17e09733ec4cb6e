"""Reads docs/code_map.md: the folders of each package, and what each may import."""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "code_map.md"


@dataclass(frozen=True)
class Room:
    """A row of the map: a folder of a package, or a module beside the folders.

    path     below the package, such as `analysis/report`
    imports  rooms of the same package that it imports
    ros      whether it needs ROS
    """

    package: str
    path: str
    imports: tuple[str, ...]
    ros: bool


@cache
def rooms() -> tuple[Room, ...]:
    """Return the rows of all packages, each package's from the ground up."""
    found = []
    for section in PAGE.read_text(encoding="utf-8").split("\n## ")[1:]:
        package = re.findall(r"`(\w+)`", section)[0]
        rows = re.findall(r"^\| `([\w/]+)` \| ([^|]*)\| (ROS)? *\|", section, re.MULTILINE)
        for path, imports, ros in rows:
            found.append(Room(package, path, tuple(re.findall(r"`([\w/]+)`", imports)), bool(ros)))
    return tuple(found)


def never() -> tuple[tuple[str, str], ...]:
    """Return the pairs of rooms, `package/folder`, of which the first never imports the second."""
    text = PAGE.read_text(encoding="utf-8")
    return tuple(re.findall(r"^- `([\w/]+)` never imports `([\w/]+)`", text, re.MULTILINE))


def room_of_module(package: str, parts: tuple[str, ...]) -> Room | None:
    """Return the room of a module, such as ('analysis', 'report', 'page'); None without one."""
    path = "/".join(parts[:-1]) or parts[-1]
    return next((one for one in rooms() if (one.package, one.path) == (package, path)), None)


def room_of_test(package: str, parts: tuple[str, ...]) -> Room | None:
    """Return the room that a package's test is about; None if it is about several.

    parts  below the package's folder `test`, such as ('analysis', 'test_timing.py')
    """
    ours = [one for one in rooms() if one.package == package]
    if len(parts) > 1:
        return next((one for one in ours if one.path == "/".join(parts[:-1])), None)
    # Of a module beside the folders; its laws may have a file of their own.
    name = parts[0].removeprefix("test_")
    return next((one for one in ours if re.match(rf"{one.path}(_laws)?\.py", name)), None)
