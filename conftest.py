"""Which tests need ROS, told by their folders; and with how many inputs a law is tried."""

from pathlib import Path

import pytest
from code_map import room_of_test
from hypothesis import settings

ROOT = Path(__file__).parent
PACKAGES = ROOT / "ros2_ws" / "src"

# The machine may be busy: time is no claim of these tests, and their inputs are the same each run.
settings.register_profile("full", deadline=None, max_examples=60, derandomize=True)
settings.register_profile("quick", settings.get_profile("full"), max_examples=10)
settings.load_profile("full")


def needs_ros(path: Path) -> bool:
    """Whether a test file needs ROS: all do but a package's own of what needs none."""
    if not path.is_relative_to(PACKAGES):
        return True
    package, _, *parts = path.relative_to(PACKAGES).parts
    room = room_of_test(package, tuple(parts))
    return room is None or room.ros


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let a run take one part of the tests only."""
    parser.addoption("--part", choices=["unit", "system"], help="tests without ROS, or the others")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out what is not of the part that is asked for, before it is imported."""
    part = config.getoption("part")
    if part is None or not collection_path.name.startswith("test_") or collection_path.is_dir():
        return None
    return True if needs_ros(collection_path) != (part == "system") else None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark by the folder what starts the installed executables, or may."""
    for item in items:
        if needs_ros(item.path):
            item.add_marker(pytest.mark.system)
