"""docs/code_map.md is true: who may import whom, and what needs no ROS."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from ament_index_python.packages import get_packages_with_prefixes

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "ros2_ws" / "src"
MAP = (ROOT / "docs" / "code_map.md").read_text()
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text()
PACKAGES = sorted(path.parent.name for path in SOURCE.glob("*/setup.py"))
MSGS = "fastswing_msgs"
TOP = "nodes and commands"


@dataclass(frozen=True)
class Row:
    """A row of the map; `floor` counts from its package's ground."""

    package: str
    name: str
    floor: int
    ros: bool
    patterns: tuple[str, ...]


@dataclass(frozen=True)
class Import:
    """One name that a module imports."""

    what: str
    within_function: bool


def rows() -> list[Row]:
    found = []
    for section in MAP.split("\n## ")[1:]:
        package = re.findall(r"`(\w+)`", section)[0]
        lines = re.findall(r"^\| ([^|]+) \| (`[^|]+) \|", section, re.MULTILINE)
        for floor, (name, modules) in enumerate(lines):
            patterns = tuple(re.findall(r"`([^`]+)`", modules))
            ros = name.endswith(" (ROS)")
            found.append(Row(package, name.removesuffix(" (ROS)"), floor, ros, patterns))
    return found


ROWS = rows()
FILES = {
    ".".join(path.relative_to(SOURCE / package).with_suffix("").parts): path
    for package in PACKAGES
    for path in sorted((SOURCE / package / package).rglob("*.py"))
    if path.name != "__init__.py"
}
MODULES = sorted(FILES)
# ProxSuite's own package is installed like one of ROS, and is none.
ROS = get_packages_with_prefixes().keys() - {*PACKAGES, "proxsuite"}
each_module = pytest.mark.parametrize("module", MODULES)


def rows_of(module: str) -> list[Row]:
    """Return the rows that name a module; if none does, those whose pattern fits it best."""
    package, _, name = module.partition(".")
    ours = [row for row in ROWS if row.package == package]
    named = [row for row in ours if name in row.patterns]
    fitting = [(row, p) for row in ours for p in row.patterns if fnmatchcase(name, p)]
    # The ends of names say more than their beginnings: a bag_node is a node.
    ending = [row for row, pattern in fitting if pattern.startswith("*")]
    return named or ending or [row for row, _ in fitting]


@cache
def row_of(module: str) -> Row:
    (row,) = rows_of(module)
    return row


@cache
def imports(path: Path) -> tuple[Import, ...]:
    return tuple(_imports(ast.parse(path.read_text()), False))


def _imports(node: ast.AST, within: bool) -> Iterator[Import]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import):
            yield from (Import(alias.name, within) for alias in child.names)
        elif isinstance(child, ast.ImportFrom):
            for alias in child.names:
                whole = f"{child.module}.{alias.name}"
                yield Import(whole if whole in FILES else str(child.module), within)
        inner = within or isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef)
        yield from _imports(child, inner)


def bound(module: str) -> set[str]:
    """Return what a module imports, without what a command imports for one of its options."""
    return {
        one.what
        for one in imports(FILES[module])
        if not (one.within_function and module.endswith("_command"))
    }


def package_dependencies() -> dict[str, set[str]]:
    """Return what each package may import: what architecture.md's table says, and what that may."""
    lines = re.findall(r"^\| `(\w+)` \|[^|]*\|([^|]*)\|$", ARCHITECTURE, re.MULTILINE)
    direct = {name: set(re.findall(r"`(\w+)`", cell)) for name, cell in lines}
    whole: dict[str, set[str]] = {}
    for name in TopologicalSorter(direct).static_order():
        whole[name] = direct[name].union(*(whole[other] for other in direct[name]))
    return whole


@each_module
def test_a_module_is_in_one_row(module: str) -> None:
    found = [row.name for row in rows_of(module)]
    assert len(found) == 1, f"docs/code_map.md has {module} in {found or 'no row'}"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.package}-{row.name}")
def test_every_module_named_exists(row: Row) -> None:
    for pattern in row.patterns:
        assert any(fnmatchcase(module, f"{row.package}.{pattern}") for module in MODULES), pattern


@each_module
def test_a_module_imports_only_packages_that_its_own_depends_on(module: str) -> None:
    package = module.partition(".")[0]
    ours = {one.what.partition(".")[0] for one in imports(FILES[module])} & {*PACKAGES, MSGS}
    assert ours - {package} <= package_dependencies()[package]


@each_module
def test_a_module_imports_from_its_row_and_rows_above(module: str) -> None:
    row = row_of(module)
    for other in (row_of(what) for what in bound(module) & FILES.keys()):
        if other.package == row.package:
            assert other.floor <= row.floor, f"{module} imports from {other.name}"
        else:
            assert other.name != TOP, f"{module} imports a node of {other.package}"


@pytest.mark.parametrize("module", [module for module in MODULES if not row_of(module).ros])
def test_a_module_without_ros_imports_nothing_of_ros(module: str) -> None:
    found = bound(module)
    assert {what.partition(".")[0] for what in found} & ROS == set()
    assert [what for what in found & FILES.keys() if row_of(what).ros] == []


def test_there_are_no_circles() -> None:
    graph = {module: bound(module) & FILES.keys() - {module} for module in MODULES}
    assert len(list(TopologicalSorter(graph).static_order())) == len(MODULES)


def test_control_and_emulated_arm_know_nothing_of_each_other() -> None:
    sides = {"control": "emulated arm", "emulated arm": "control"}
    for module in MODULES:
        row = row_of(module)
        if row.package == "musashi_muscle_bridge" and row.name in sides:
            others = {row_of(what).name for what in bound(module) & FILES.keys()}
            assert sides[row.name] not in others, module


def test_the_scripts_need_nothing_but_python() -> None:
    paths = list((ROOT / "scripts").glob("*.py"))
    allowed = {*sys.stdlib_module_names, *(path.stem for path in paths)}
    assert {one.what.partition(".")[0] for path in paths for one in imports(path)} <= allowed


PROGRAM = """
import importlib, sys
sys.modules.update(dict.fromkeys(sys.argv[1].split()))
for module in sys.argv[2].split():
    importlib.import_module(module)
"""


def import_without(blocked: str, modules: list[str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", PROGRAM, blocked, " ".join(modules)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


def test_everything_without_ros_is_imported_where_there_is_none() -> None:
    result = import_without(" ".join(ROS), [m for m in MODULES if not row_of(m).ros])
    assert (result.returncode, result.stderr) == (0, "")


def test_the_obstacle_to_importing_works() -> None:
    assert import_without("numpy", ["fastswing_planner.planning.swing"]).returncode == 1
