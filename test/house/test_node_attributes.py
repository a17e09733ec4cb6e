"""A node that reuses the name of one of rclpy's own attributes loses services or parameters."""

import ast
import inspect
from pathlib import Path

import pytest
import rclpy.lifecycle
import rclpy.lifecycle.node
import rclpy.node

SOURCES = Path(__file__).parents[2] / "ros2_ws" / "src"
NODES = sorted(SOURCES.glob("*/*/*_node.py"))
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


@pytest.mark.parametrize("path", NODES, ids=lambda path: path.stem)
def test_a_node_assigns_no_attribute_of_rclpy(path: Path) -> None:
    taken = set().union(*(assigned_attributes(inspect.getsource(base)) for base in BASES))
    assert "_services" in taken
    assert assigned_attributes(path.read_text()) & taken == set()
