"""Draws the packages' folders, and which imports which, into docs/architecture.md.

scripts/ros_env python pages/folder_picture.py
"""

from graphlib import TopologicalSorter
from itertools import groupby
from operator import attrgetter
from pathlib import Path

from code_map import ROOT, Room, rooms

PAGE = ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- folders: made by `make docs` from code_map.md -->\n", "<!-- folders end -->\n"


def picture() -> str:
    """Return a mermaid diagram: arrows point to what is imported, those that follow left out."""
    lines = ["```mermaid", "flowchart TD"]
    for package, ours in groupby(rooms(), attrgetter("package")):
        members = list(ours)
        lines += [f"  subgraph {package}"]
        lines += [f"    {_key(one)}[{one.path}]{':::ros' if one.ros else ''}" for one in members]
        lines += [f"    {arrow}" for arrow in _arrows(members)]
        lines += ["  end"]
    lines += [
        "  fastswing_inhibitor ==> fastswing_planner",
        "  musashi_muscle_bridge ==> fastswing_inhibitor",
        "  classDef ros fill:#fde7c7,stroke:#b8741a",
        "```",
    ]
    return "\n".join(lines) + "\n"


def _key(room: Room) -> str:
    return f"{room.package}_{room.path}".replace("/", "_")


def _arrows(members: list[Room]) -> list[str]:
    """Return the arrows that no other arrows imply."""
    by_path = {one.path: one for one in members}
    reached: dict[str, set[str]] = {}
    for path in TopologicalSorter({one.path: one.imports for one in members}).static_order():
        direct = by_path[path].imports
        reached[path] = set(direct).union(*(reached[other] for other in direct))
    return [
        f"{_key(one)} --> {_key(by_path[other])}"
        for one in members
        for other in one.imports
        if not any(other in reached[third] for third in one.imports if third != other)
    ]


def with_picture(text: str) -> str:
    """Return the page's text with today's picture."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}{picture()}{END}{after}"


def main(page: Path = PAGE) -> None:
    """Write the page."""
    page.write_text(with_picture(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
