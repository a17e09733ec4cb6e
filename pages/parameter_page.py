"""Makes docs/parameters.md from the tables that the nodes declare their parameters with.

scripts/ros_env python pages/parameter_page.py
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path

from fastswing_planner.lifecycle.common_parameters import EVERY_NODE
from fastswing_planner.lifecycle.parameters import Parameter

PAGE = Path(__file__).parents[1] / "docs" / "parameters.md"
PACKAGES = ("fastswing_planner", "fastswing_inhibitor", "musashi_muscle_bridge")
_PREFIXES = tuple(f"{package}." for package in PACKAGES)
_HEAD = """# Parameters

Made by `make docs` from the tables in the nodes' code. Do not edit it by hand: change the
description in the table.

Each parameter is set at the start, `--ros-args -p NAME:=VALUE`, in a YAML file, or by a launch
argument. A value outside its range is refused with the range. "when configured" takes effect only
then: deactivate and clean up the node first, or start it again. "any time" takes effect at once,
`ros2 param set /NODE NAME VALUE`. Numbers whose default has a decimal point need one.
A misspelt name is refused; another unknown name is a warning, as one file may serve all nodes.

`mock.launch.xml` and `robot.launch.xml` give all nodes one file, `config:=FILE`; a copy of
`ros2_ws/src/musashi_muscle_bridge/config/nodes.yaml` is a beginning. Have no section `/**:` in
it, and on a command line `--params-file FILE` before the first `-p`: otherwise ROS lets the file
win over arguments.

The faults of boards named here: [board_protocol.md](board_protocol.md#faults).
"""


@dataclass(frozen=True)
class NodeTable:
    """The declared parameters of one executable."""

    executable: str
    package: str
    rows: tuple[Parameter, ...]


def executables() -> dict[str, str]:
    """Return each installed executable of the suite with the module that it starts."""
    found = {
        entry.name: entry.value.partition(":")[0] for entry in entry_points(group="console_scripts")
    }
    return {name: found[name] for name in sorted(found) if found[name].startswith(_PREFIXES)}


def declared_tables() -> list[NodeTable]:
    """Return the table of each executable that has one."""
    tables = []
    for name, module_name in executables().items():
        rows: Sequence[Parameter] = getattr(import_module(module_name), "TABLE", ())
        if rows:
            package = module_name.partition(".")[0]
            tables.append(NodeTable(name, package, (*EVERY_NODE, *rows)))
    return tables


def _shown(value: object) -> str:
    if isinstance(value, list):
        return ", ".join(f"`{item}`" for item in value) or "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, float):
        text = f"{value:g}"
        return f"`{text}`" if "." in text else f"`{text}.0`"
    return f"`{value}`" if value != "" else "empty"


def _range(row: Parameter) -> str:
    if row.choices:
        return ", ".join(f"`{choice}`" for choice in row.choices)
    if isinstance(row.default, bool):
        return "`true`, `false`"
    if isinstance(row.default, int):
        return f"{row.low} to {row.high}"  # every digit of large ones
    return row.range_text.removesuffix(row.unit).rstrip()


def _line(row: Parameter) -> str:
    changes = "when configured" if row.read_only else "any time"
    cells = (
        f"`{row.name}`",
        _shown(row.default),
        row.unit,
        _range(row),
        changes,
        row.description.replace("|", "\\|"),
    )
    return "| " + " | ".join(cells) + " |"


def page(tables: Iterable[NodeTable]) -> str:
    """Return the text of the page."""
    parts = [_HEAD]
    for table in tables:
        parts.append(
            f"## {table.executable}\n\n`ros2 run {table.package} {table.executable}`\n\n"
            "| parameter | default | unit | range | takes effect | what it does |\n"
            "|---|---|---|---|---|---|\n" + "\n".join(map(_line, table.rows)) + "\n"
        )
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(declared_tables()))
