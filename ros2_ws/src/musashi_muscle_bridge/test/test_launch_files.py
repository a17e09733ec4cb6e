"""The launch files and the parameter file name only what the packages have.

`ros2 launch` is not everywhere where the tests run, so the files are read, not launched.
"""

import re
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from ament_index_python.packages import get_package_share_directory

from fastswing_planner.lifecycle.common_parameters import EVERY_NODE
from fastswing_planner.lifecycle.parameters import Parameter, check_all

PACKAGE = Path(__file__).parents[1]
FILES = ("mock.launch.xml", "replay.launch.xml", "robot.launch.xml")
ON_A_BUS = ("mock.launch.xml", "robot.launch.xml")
COMMON = [
    ("fastswing_inhibitor", "inhibitor"),
    ("fastswing_planner", "planner"),
    ("fastswing_planner", "swing_executor"),
    ("musashi_muscle_bridge", "bridge"),
    ("musashi_muscle_bridge", "show_arm"),
]
NODES = {
    "mock.launch.xml": sorted([*COMMON, ("musashi_muscle_bridge", "mock_driver")]),
    "replay.launch.xml": [("fastswing_inhibitor", "inhibitor"), ("fastswing_inhibitor", "replay")],
    "robot.launch.xml": COMMON,
}
# What the parameter file has a section for.
CONFIGURED = [row for row in COMMON if row[1] != "show_arm"]
LAUNCH_ARGUMENTS = {"robot_description", "bus_url", "control_rate"}
# What depends on what is installed, and what a copied file must not turn off again.
NOT_CONFIGURED = {*LAUNCH_ARGUMENTS, "autostart", "solver", "read_only"}
# rclpy's own, not in the node's table.
OF_EVERY_NODE = {"use_sim_time"}
NO_DEFAULT = {"replay.launch.xml": {"bag"}, "robot.launch.xml": {"bus_url"}}


def launch_file(name: str) -> ElementTree.Element:
    return ElementTree.parse(PACKAGE / "launch" / name).getroot()


def arguments(root: ElementTree.Element) -> dict[str, ElementTree.Element]:
    return {argument.attrib["name"]: argument for argument in root.findall("arg")}


def nodes(root: ElementTree.Element) -> list[ElementTree.Element]:
    return list(root.iter("node"))


def executable(package: str, name: str) -> EntryPoint:
    (found,) = {
        entry
        for entry in entry_points(group="console_scripts")
        if entry.name == name and entry.value.startswith(f"{package}.")
    }
    return found


def table(package: str, name: str) -> dict[str, Parameter]:
    rows = import_module(executable(package, name).module).TABLE
    return {row.name: row for row in (*EVERY_NODE, *rows)}


def parameters(root: ElementTree.Element) -> Iterator[tuple[Parameter, str]]:
    """Yield each parameter's row of its node's table, and the value it is given."""
    for node in nodes(root):
        for parameter in node.findall("param"):
            if parameter.get("name", "use_sim_time") not in OF_EVERY_NODE:
                rows = table(node.attrib["pkg"], node.attrib["exec"])
                yield rows[parameter.attrib["name"]], parameter.attrib["value"]


def configured(node: str) -> dict[str, object]:
    """Return what the parameter file says of a node, in whatever namespace."""
    content = yaml.safe_load((PACKAGE / "config" / "nodes.yaml").read_text())
    assert sorted(content) == sorted(f"/**/{name}" for _, name in CONFIGURED)
    (values,) = content[f"/**/{node}"].values()
    assert list(content[f"/**/{node}"]) == ["ros__parameters"]
    return dict(values)


@pytest.mark.parametrize("name", FILES)
def test_a_launch_file_starts_the_nodes_it_promises(name: str) -> None:
    root = launch_file(name)
    started = [(node.attrib["pkg"], node.attrib["exec"]) for node in nodes(root)]
    assert sorted(started) == NODES[name]
    for package, program in started:
        assert callable(executable(package, program).load())


@pytest.mark.parametrize("name", FILES)
def test_every_argument_is_described_and_used_and_no_other_is_used(name: str) -> None:
    root = launch_file(name)
    text = (PACKAGE / "launch" / name).read_text()
    assert set(re.findall(r"\$\(var (\w+)\)", text)) == set(arguments(root))
    for argument in arguments(root).values():
        assert argument.attrib["description"].endswith(".")


@pytest.mark.parametrize("name", FILES)
def test_every_parameter_is_in_its_nodes_table_and_defaults_are_the_nodes_own(name: str) -> None:
    root = launch_file(name)
    for row, value in parameters(root):
        variable = re.fullmatch(r"\$\(var (\w+)\)", value)
        assert variable, f"{row.name} is set to {value}, not by an argument"
        default = arguments(root)[variable[1]].get("default")
        if default is not None:
            # As launch does: a text that reads as a number becomes one, of the same type.
            read = yaml.safe_load(default)
            assert type(read) is type(row.default)
            assert read == row.default


@pytest.mark.parametrize(
    ("name", "default"), [("mock.launch.xml", "true"), ("robot.launch.xml", "false")]
)
def test_the_arm_is_shown_by_default_where_there_is_no_robot(name: str, default: str) -> None:
    root = launch_file(name)
    assert arguments(root)["show"].attrib["default"] == default
    asked = {node.attrib["exec"]: node.attrib["if"] for node in nodes(root) if "if" in node.attrib}
    assert asked == {"show_arm": "$(var show)"}


@pytest.mark.parametrize("name", FILES)
def test_only_what_nobody_can_guess_has_no_default(name: str) -> None:
    rows = arguments(launch_file(name))
    without = {row for row, element in rows.items() if "default" not in element.attrib}
    assert without == NO_DEFAULT.get(name, set())


@pytest.mark.parametrize("name", FILES)
def test_the_same_argument_means_the_same_in_every_file(name: str) -> None:
    for other in FILES:
        ours, theirs = arguments(launch_file(name)), arguments(launch_file(other))
        for row in ours.keys() & theirs.keys() & {"control_rate", "config", "enclave"}:
            assert ours[row].attrib == theirs[row].attrib
        assert ours["robot_description"].get("default") == theirs["robot_description"].get(
            "default"
        )


@pytest.mark.parametrize("name", FILES)
def test_only_nodes_that_begin_with_nothing_to_do_are_started_again(name: str) -> None:
    again = {node.attrib["exec"] for node in nodes(launch_file(name)) if "respawn" in node.attrib}
    assert again == (
        {"inhibitor", "planner", "show_arm", "swing_executor"} if name in ON_A_BUS else set()
    )
    for node in nodes(launch_file(name)):
        # launch takes no substitution here, and without a delay a wrong parameter floods the log.
        assert (node.get("respawn"), node.get("respawn_delay")) in [(None, None), ("true", "2.0")]


@pytest.mark.parametrize("name", FILES)
def test_files_named_are_installed(name: str) -> None:
    values = " ".join(row.get("default", "") for row in arguments(launch_file(name)).values())
    named = re.findall(r"(?:\$\(find-pkg-share |package://)(\w+)\)?/([\w/.]+)", values)
    assert len(named) == (2 if name in ON_A_BUS else 1)
    for package, path in named:
        assert (Path(get_package_share_directory(package)) / path).is_file()


@pytest.mark.parametrize("name", FILES)
def test_all_nodes_are_in_one_group_with_the_namespace(name: str) -> None:
    root = launch_file(name)
    (group,) = root.findall("group")
    first = group[0]
    assert first.tag == "push-ros-namespace"
    assert first.attrib == {"namespace": "$(var namespace)"}
    assert root.findall("node") == []


@pytest.mark.parametrize("name", ON_A_BUS)
def test_every_node_loads_the_parameter_file_before_its_arguments(name: str) -> None:
    root = launch_file(name)
    for node in nodes(root):
        first, *others = node.findall("param")
        assert first.attrib == {"from": "$(var config)"}
        assert not any("from" in parameter.attrib for parameter in others)
    default = arguments(root)["config"].attrib["default"]
    assert default == "$(find-pkg-share musashi_muscle_bridge)/config/nodes.yaml"


@pytest.mark.parametrize("name", FILES)
def test_launch_itself_parses_the_file(name: str) -> None:
    frontend = pytest.importorskip("launch.frontend", reason="ros2 launch is not installed")
    pytest.importorskip("launch_ros", reason="ros2 launch is not installed")
    entity, parser = frontend.Parser.load(str(PACKAGE / "launch" / name))
    assert parser.parse_description(entity).entities


@pytest.mark.parametrize(("package", "name"), CONFIGURED)
def test_the_parameter_file_states_the_defaults_of_the_tables(package: str, name: str) -> None:
    rows = table(package, name)
    values = configured(name)
    assert set(values) == set(rows) - NOT_CONFIGURED
    check_all([rows[name] for name in values], values)
    for name, value in values.items():
        assert type(value) is type(rows[name].default), name
        assert value == rows[name].default, name
