"""The documentation leaves nothing out; what there is to name is asked of tables and interfaces."""

import re
from importlib import import_module
from pathlib import Path

import pytest
from parameter_page import PACKAGES, PAGE, NodeTable, declared_tables, executables, page

from fastswing_msgs.msg import ErrorCode, MuscleState
from musashi_muscle_bridge.buses.protocol import Fault, WatchdogAction

ROOT = Path(__file__).parents[2]
SOURCES = [
    path.read_text()
    for package in PACKAGES
    for path in sorted((ROOT / "ros2_ws/src" / package / package).rglob("*.py"))
]
PAGES = {
    str(path.relative_to(ROOT)): path.read_text()
    for path in [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md"))]
}
RECOVERY = PAGES["docs/recovery.md"]
INTERFACES = sorted(
    path.stem
    for kind in ("msg", "srv", "action")
    for path in (ROOT / "ros2_ws/src/fastswing_msgs" / kind).iterdir()
)


def in_code(text: str) -> str:
    """Return what stands in backquotes and in blocks of code."""
    return "\n".join(re.findall(r"```.*?```|`[^`\n]+`", text, re.DOTALL))


CODE = "\n".join(in_code(text) for text in PAGES.values())
WRITTEN = "\n".join(
    in_code(text) for name, text in PAGES.items() if name != str(PAGE.relative_to(ROOT))
)
"""What people wrote, without the page that is made from the tables."""


def named(name: str, text: str) -> bool:
    """Whether a name stands in a text as a whole word."""
    return re.search(rf"(?<![\w-]){re.escape(name)}(?![\w-])", text) is not None


def found_in_sources(pattern: str) -> list[str]:
    return sorted({name for text in SOURCES for name in re.findall(pattern, text)})


def topics() -> list[str]:
    made = found_in_sources(r'create_(?:publisher|subscription)\(\s*\w+,\s*"/?(\w+)"')
    recorded: dict[str, str] = import_module("fastswing_planner.nodes.recorded_topics").TYPES
    return sorted({*made, *recorded})


def services() -> list[str]:
    return sorted(
        {
            *found_in_sources(r'create_service\(\s*\w+, "(?:~/)?(\w+)"'),
            *found_in_sources(r'ActionServer\(\s*self,\s*\w+,\s*"(\w+)"'),
            *found_in_sources(r'\("(\w+)", self\._\w+, "'),
        }
    )


def constants(message: type, prefix: str = "") -> dict[str, int]:
    """Return the constants of a message by name."""
    text = (ROOT / "ros2_ws/src/fastswing_msgs/msg" / f"{message.__name__}.msg").read_text()
    names = re.findall(rf"^\w+ ({prefix}[A-Z_]+) *=", text, re.MULTILINE)
    return {name.removeprefix(prefix): getattr(message, name) for name in names}


def rows(text: str) -> set[tuple[int, str]]:
    """Return number and name of each row of a page's tables that has both."""
    return {
        (int(number), name)
        for number, name in re.findall(r"^\| (-?\d+) \| `(\w+)` \|", text, re.MULTILINE)
    }


def test_the_page_of_parameters_is_up_to_date() -> None:
    assert PAGE.read_text() == page(declared_tables()), "run make docs"


@pytest.mark.parametrize("table", declared_tables(), ids=lambda table: str(table.executable))
def test_every_description_is_a_sentence(table: NodeTable) -> None:
    for row in table.rows:
        assert row.description[0].isupper(), row.name
        assert row.description.endswith("."), row.name


@pytest.mark.parametrize("name", topics())
def test_every_topic_is_named(name: str) -> None:
    assert named(name, WRITTEN)


@pytest.mark.parametrize("name", services())
def test_every_service_and_action_is_named(name: str) -> None:
    assert named(name, WRITTEN)


@pytest.mark.parametrize("name", INTERFACES)
def test_every_interface_is_named(name: str) -> None:
    assert named(name, WRITTEN)


@pytest.mark.parametrize("name", executables())
def test_every_executable_is_named(name: str) -> None:
    assert named(name, WRITTEN)


@pytest.mark.parametrize(
    "name", sorted({row.name for table in declared_tables() for row in table.rows})
)
def test_every_parameter_is_named(name: str) -> None:
    assert named(name, CODE)


def test_recovery_tells_every_fault_and_every_error_by_number_and_name() -> None:
    faults = {(fault.value, fault.name) for fault in Fault}
    errors = {(value, name) for name, value in constants(ErrorCode).items()}
    assert rows(RECOVERY) == faults | errors


def test_the_protocol_and_the_message_number_faults_alike() -> None:
    assert constants(MuscleState, "FAULT_") == {fault.name: fault.value for fault in Fault}


@pytest.mark.parametrize("action", WatchdogAction)
def test_every_watchdog_action_is_named(action: WatchdogAction) -> None:
    assert named(action.name.lower(), CODE)


@pytest.mark.parametrize(
    "name",
    sorted(
        {
            name
            for path in (ROOT / "ros2_ws/src").glob("*/launch/*.xml")
            for name in re.findall(r'<arg name="(\w+)"', path.read_text())
        }
    ),
)
def test_every_launch_argument_is_named(name: str) -> None:
    assert re.search(rf"(?<!\w){name}:=", WRITTEN)


@pytest.mark.parametrize(
    "target", re.findall(r"^([a-z][\w-]*):", (ROOT / "Makefile").read_text(), re.MULTILINE)
)
def test_every_make_target_is_named(target: str) -> None:
    assert named(f"make {target}", WRITTEN)


@pytest.mark.parametrize("name", PAGES)
def test_every_link_within_the_repository_leads_somewhere(name: str) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", PAGES[name]):
        path, _, heading = link.partition("#")
        if ":" in path:
            continue
        target = (ROOT / name).parent / path if path else ROOT / name
        assert target.exists(), link
        if heading:
            assert heading in headings(target.read_text()), link


def headings(text: str) -> set[str]:
    """Return the anchors of a page, as GitHub makes them."""
    titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}
