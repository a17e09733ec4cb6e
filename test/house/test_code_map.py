"""docs/code_map.md is true: who may import whom, and what needs no ROS."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import folder_picture
import pytest
from ament_index_python.packages import get_packages_with_prefixes
from code_map import ROOT, Room, never, room_of_module, room_of_test, rooms

SOURCE = ROOT / "ros2_ws" / "src"
ARCHITECTURE = (ROOT / "docs" / "architecture.md").read_text()
PACKAGES = sorted(path.parent.name for path in SOURCE.glob("*/setup.py"))
MSGS = "fastswing_msgs"
TOP = ("nodes", "commands")
MOST_MODULES = 16
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
each_room = pytest.mark.parametrize("room", rooms(), ids=lambda one: f"{one.package}-{one.path}")


@dataclass(frozen=True)
class Import:
    """One name that a module imports."""

    what: str
    within_function: bool


@cache
def room_of(module: str) -> Room | None:
    package, *parts = module.split(".")
    return room_of_module(package, tuple(parts))


def known_room(module: str) -> Room:
    room = room_of(module)
    assert room is not None, f"docs/code_map.md has no row for {module}"
    return room


def files_of(path: Path) -> tuple[Import, ...]:
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


@cache
def bound(module: str) -> frozenset[str]:
    """Return what a module imports, but what it imports in a function: for one of its options."""
    return frozenset(one.what for one in files_of(FILES[module]) if not one.within_function)


def rooms_imported(room: Room) -> set[tuple[str, str]]:
    """Return package and path of the rooms that a room's modules import."""
    mine = [module for module in MODULES if room_of(module) == room]
    found = {
        (known_room(what).package, known_room(what).path)
        for module in mine
        for what in bound(module) & FILES.keys()
    }
    return found - {(room.package, room.path)}


def package_dependencies() -> dict[str, set[str]]:
    """Return what each package may import: what architecture.md's table says, and what that may."""
    lines = re.findall(r"^\| `(\w+)` \|[^|]*\|([^|]*)\|$", ARCHITECTURE, re.MULTILINE)
    direct = {name: set(re.findall(r"`(\w+)`", cell)) for name, cell in lines}
    whole: dict[str, set[str]] = {}
    for name in TopologicalSorter(direct).static_order():
        whole[name] = direct[name].union(*(whole[other] for other in direct[name]))
    return whole


@each_module
def test_a_module_stands_in_a_row(module: str) -> None:
    known_room(module)


@each_room
def test_a_row_holds_modules(room: Room) -> None:
    assert any(room_of(module) == room for module in MODULES)


@each_room
def test_a_row_names_what_its_modules_import_and_no_more(room: Room) -> None:
    own = {path for package, path in rooms_imported(room) if package == room.package}
    assert own == set(room.imports)


@each_room
def test_a_row_imports_only_rows_above_it(room: Room) -> None:
    ours = [one.path for one in rooms() if one.package == room.package]
    assert set(room.imports) <= set(ours[: ours.index(room.path)])


@each_room
def test_no_row_imports_nodes_or_commands_of_another_package(room: Room) -> None:
    foreign = {path for package, path in rooms_imported(room) if package != room.package}
    assert foreign & {*TOP} == set()


@pytest.mark.parametrize(("first", "second"), never())
def test_what_never_imports_another_does_not(first: str, second: str) -> None:
    for module in MODULES:
        room = known_room(module)
        if f"{room.package}/{room.path}".startswith(first):
            others = {one.what.replace(".", "/") for one in files_of(FILES[module])}
            assert not any(other.startswith(f"{second}/") for other in others), module


def test_there_are_pairs_that_never_import_each_other() -> None:
    assert ("musashi_muscle_bridge/control", "musashi_muscle_bridge/emulation") in never()


@each_module
def test_a_module_imports_only_packages_that_its_own_depends_on(module: str) -> None:
    package = module.partition(".")[0]
    ours = {one.what.partition(".")[0] for one in files_of(FILES[module])} & {*PACKAGES, MSGS}
    assert ours - {package} <= package_dependencies()[package]


@pytest.mark.parametrize("module", [module for module in MODULES if not known_room(module).ros])
def test_a_module_without_ros_imports_nothing_of_ros(module: str) -> None:
    found = bound(module)
    assert {what.partition(".")[0] for what in found} & ROS == set()
    assert [what for what in found & FILES.keys() if known_room(what).ros] == []


@each_room
def test_a_row_that_is_said_to_need_ros_does(room: Room) -> None:
    mine = [module for module in MODULES if room_of(module) == room]
    found = {what for module in mine for what in bound(module)}
    needs = {what.partition(".")[0] for what in found} & ROS
    needs |= {what for what in found & FILES.keys() if known_room(what).ros}
    assert bool(needs) == room.ros


def test_there_are_no_circles() -> None:
    graph = {module: bound(module) & FILES.keys() - {module} for module in MODULES}
    assert len(list(TopologicalSorter(graph).static_order())) == len(MODULES)


def test_no_folder_is_a_list() -> None:
    folders = {path.parent for path in FILES.values()}
    modules = {folder: len(list(folder.glob("*.py"))) - 1 for folder in folders}
    assert [str(folder) for folder, count in modules.items() if count > MOST_MODULES] == []


@pytest.mark.parametrize("package", PACKAGES)
def test_tests_mirror_the_folders(package: str) -> None:
    """A folder of tests has the name of what it tests; comparisons with ROS stand below it."""
    tests = SOURCE / package / "test"
    for path in tests.rglob("test_*.py"):
        parts = path.relative_to(tests).parts
        if len(parts) > 1:
            without = tuple(part for part in parts if part != "against_ros")
            assert room_of_test(package, without) is not None, path


def test_the_picture_of_the_folders_is_that_of_the_table() -> None:
    assert folder_picture.with_picture(ARCHITECTURE) == ARCHITECTURE


def test_the_scripts_need_nothing_but_python() -> None:
    paths = list((ROOT / "scripts").glob("*.py"))
    allowed = {*sys.stdlib_module_names, *(path.stem for path in paths)}
    assert {one.what.partition(".")[0] for path in paths for one in files_of(path)} <= allowed


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
    result = import_without(" ".join(ROS), [m for m in MODULES if not known_room(m).ros])
    assert (result.returncode, result.stderr) == (0, "")


def test_the_obstacle_to_importing_works() -> None:
    assert import_without("numpy", ["fastswing_planner.planning.swing"]).returncode == 1
