"""The README keeps its word, and what the tables of docs/interfaces.md name exists."""

import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from processes import Process, free_domain, isolated_environment, stop_all

if TYPE_CHECKING:
    from test.system.suite import Suite

ROOT = Path(__file__).parents[2]

PACKAGES = ("fastswing_inhibitor", "fastswing_planner", "musashi_muscle_bridge")
README = (ROOT / "README.md").read_text()
EXAMPLES = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
INTERFACES = (ROOT / "docs/interfaces.md").read_text()
RECOVERY = (ROOT / "docs/recovery.md").read_text()
SOURCES = ROOT / "ros2_ws/src"
NODE_SOURCES = {
    path.stem.removesuffix("_node"): path.read_text()
    for package in PACKAGES
    for pattern in ("nodes/*.py", "*_node.py")
    for path in (SOURCES / package / package).glob(pattern)
}
EXAMPLE_SEC = 90.0


def table(first_heading: str) -> list[list[str]]:
    """Return the cells of the table of interfaces with this first heading, without its head."""
    lines = INTERFACES.splitlines()
    (start,) = (
        number for number, line in enumerate(lines) if line.startswith(f"| {first_heading} |")
    )
    rows = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    return rows


def code(cell: str) -> str:
    """Return the first thing in backquotes."""
    found = re.search(r"`([^`]+)`", cell)
    assert found, cell
    return found[1]


def executables() -> dict[str, str]:
    """Return the package of each executable that the packages install."""
    return {
        entry.name: entry.value.partition(".")[0]
        for entry in entry_points(group="console_scripts")
        if entry.value.partition(".")[0] in PACKAGES
    }


def interface(name: str, kind: str) -> type:
    package, _, type_name = name.partition("/")
    found: type = getattr(import_module(f"{package}.{kind}"), type_name)
    return found


@pytest.fixture
def environment(tmp_path: Path) -> Iterator[dict[str, str]]:
    """Yield the environment of a domain of its own in which a planner runs."""
    own = isolated_environment(free_domain())
    planner = Process("fastswing_planner", "planner", {}, own, tmp_path / "planner.log")
    try:
        yield own
        assert planner.running, planner.log_tail()
    finally:
        stop_all([planner])


def test_the_python_example_plans_method_2_and_masks_the_biceps(
    environment: dict[str, str],
) -> None:
    example, _ = EXAMPLES
    run = subprocess.run(
        [sys.executable, "-c", example],
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=EXAMPLE_SEC,
    )
    assert run.returncode == 0, run.stdout
    promised = re.search(r"It prints `([^`]+)`", README)
    assert promised
    assert "('#9',)" in run.stdout
    assert run.stdout.strip() == promised[1]


def test_the_python_examples_together_swing_the_arm(all_nodes: "Suite") -> None:
    run = subprocess.run(
        [sys.executable, "-c", "\n".join(EXAMPLES)],
        env=isolated_environment(all_nodes.domain),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=EXAMPLE_SEC,
    )
    assert run.returncode == 0, run.stdout
    assert re.search(r"^arrived after 0\.\d\d s$", run.stdout, re.MULTILINE), run.stdout


def test_the_table_of_nodes_names_every_executable_and_no_other() -> None:
    named = {}
    for first, _, _ in table("executable (package)"):
        executable, package = re.findall(r"`([^`]+)`", first)
        named[executable] = package
    assert named == executables()


def test_the_table_of_nodes_gives_each_node_its_name() -> None:
    sources = "\n".join(NODE_SOURCES.values())
    for _, name, _ in table("executable (package)"):
        if name != "none":
            assert f'super().__init__("{code(name)}", TABLE)' in sources


def test_the_table_of_topics_names_what_is_recorded_or_shown_with_its_type() -> None:
    named = {code(row[0]): code(row[1]).replace("/", "/msg/") for row in table("topic")}
    recorded: dict[str, str] = import_module("fastswing_planner.nodes.recorded_topics").TYPES
    shown = {"arm_markers": "visualization_msgs/msg/MarkerArray"}
    assert named == shown | {name: kind for name, kind in recorded.items() if name != "diagnostics"}


def test_every_topic_is_published_or_subscribed_by_a_node() -> None:
    recording = ("recorder", "recorded_topics")
    sources = "\n".join(t for name, t in NODE_SOURCES.items() if name not in recording)
    for topic, kind, _, _ in table("topic"):
        assert f'"{code(topic)}"' in sources
        assert interface(code(kind), "msg")


def test_every_service_and_action_is_offered_by_the_node_named() -> None:
    offered = {"swing executor": "swing_executor"}
    for name, kind, node, _ in table("service or action"):
        assert f'"{code(name)}"' in NODE_SOURCES[offered.get(node, node)], name
        assert interface(code(kind), "action" if "(action)" in name else "srv")


def test_no_service_and_no_action_is_missing() -> None:
    named = {code(row[0]) for row in table("service or action")}
    in_code = set()
    for text in NODE_SOURCES.values():
        in_code |= set(re.findall(r'create_service\(\s*\w+, "(\w+)"', text))
        in_code |= set(re.findall(r'ActionServer\(\s*self,\s*\w+,\s*"(\w+)"', text))
        in_code |= set(re.findall(r'\("(\w+)", self\._\w+, "', text))
    assert in_code == named


def test_every_service_in_the_text_is_in_the_table() -> None:
    named = {code(row[0]) for row in table("service or action")}
    called = set(re.findall(r"ros2 service call /(\w+)", README))
    assert called
    assert called <= named


def test_every_make_target_explains_itself() -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets = set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))
    listed = subprocess.run(["make"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert set(re.findall(r"^make ([\w-]+) +\w", listed, re.MULTILINE)) == targets
    (phony,) = re.findall(r"^\.PHONY:(.*)$", makefile, re.MULTILINE)
    assert set(phony.split()) == targets


def test_every_make_target_named_exists() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for path in [ROOT / "README.md", *ROOT.glob("*.md"), *ROOT.glob("docs/*.md")]:
        named = set(re.findall(r"`make ([a-z-]+)", path.read_text()))
        assert named <= set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE)), path


def test_every_file_named_exists() -> None:
    linked = re.findall(r"\]\(([^)#]+)[^)]*\)", README)
    mentioned = re.findall(
        r"`((?:demo|docs|fit|ros2_ws/src|scripts)/[\w/.]+)`", README + INTERFACES
    )
    assert linked
    assert mentioned
    for path in [*linked, *mentioned]:
        assert (ROOT / path).exists(), path
    launch_files = re.findall(r"\b(\w+\.launch\.xml)", README)
    assert launch_files
    for name in launch_files:
        assert (ROOT / "ros2_ws/src/musashi_muscle_bridge/launch" / name).is_file()


def test_numbers_that_are_defaults_are_still_the_defaults() -> None:
    bridge = {row.name: row for row in import_module("musashi_muscle_bridge.nodes.bridge").TABLE}
    inhibitor = {row.name: row for row in import_module("fastswing_inhibitor.inhibitor_node").TABLE}
    executor = {
        row.name: row for row in import_module("fastswing_planner.nodes.swing_executor").TABLE
    }
    planner = {row.name: row for row in import_module("fastswing_planner.nodes.planner").TABLE}
    text = " ".join([*README.split(), *RECOVERY.split()])
    assert f"`watchdog_timeout`, {bridge['watchdog_timeout'].default:g} s" in text
    assert f"`{bridge['watchdog_action'].default}`, the default" in text
    assert f"holds its length after {bridge['command_timeout'].default:g} s" in text
    assert f"{bridge['control_rate'].default:g} frames per second" in text
    assert f"a lease of {inhibitor['lease'].default:g} s" in text
    assert f"within {executor['arrival_tolerance'].default:g} rad (`arrival_tolerance`)" in text
    assert f"within {planner['epsilon'].default:g} rad of the end" in text
