"""A node that reuses the name of one of rclpy's own attributes loses services or parameters."""

import ast
import inspect
from pathlib import Path

import pytest
import rclpy.lifecycle
import rclpy.lifecycle.node
import rclpy.node

SOURCES = Path(__file__).parents[2] / "ros2_ws" / "src"
BASES = [rclpy.node, rclpy.lifecycle.node]


def assigned_attributes(source: str) -> set[str]:
    """Return every X of a `self.X = ...`."""
    return {
        node.attr
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Attribute)
        and isinstance(node.ctx, ast.Store)
        and isinstance(node.value, ast.Name)
        and node.value.id == "self"
    }


def holds_a_node(path: Path) -> bool:
    """Whether a file defines a class whose base is a node."""
    classes = [
        node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ClassDef)
    ]
    bases = {ast.unparse(base).rpartition(".")[2] for one in classes for base in one.bases}
    return any(base.endswith("Node") for base in bases)


PACKAGES = [path.parent for path in SOURCES.glob("*/setup.py")]
NODES = sorted(
    path
    for package in PACKAGES
    for path in (package / package.name).rglob("*.py")
    if holds_a_node(path)
)


def test_all_nodes_are_looked_at() -> None:
    named = {"bridge", "swing_executor", "planner", "recorder", "mock_driver", "monitor"}
    named |= {"show_arm", "managed_node", "polling", "inhibitor_node", "node"}
    assert {path.stem for path in NODES} >= named


@pytest.mark.parametrize("path", NODES, ids=lambda path: path.stem)
def test_a_node_assigns_no_attribute_of_rclpy(path: Path) -> None:
    taken = set().union(*(assigned_attributes(inspect.getsource(base)) for base in BASES))
    assert "_services" in taken
    assert assigned_attributes(path.read_text()) & taken == set()
