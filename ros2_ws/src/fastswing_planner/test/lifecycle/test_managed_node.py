"""A node's own attributes never take the place of rclpy's."""

import ast
import inspect
from importlib import import_module

import pytest
import rclpy
from rclpy.lifecycle import LifecycleNode

NODES = {
    "fastswing_planner.lifecycle.managed_node": "ManagedNode",
    "fastswing_planner.nodes.planner": "PlannerNode",
    "fastswing_planner.nodes.recorder": "RecordNode",
    "fastswing_planner.nodes.swing_executor": "ExecutorNode",
}


@pytest.fixture(scope="module")
def taken() -> set[str]:
    """Return what a node of rclpy sets."""
    context = rclpy.Context()
    rclpy.init(context=context)
    node = LifecycleNode("bare", context=context)
    try:
        return set(vars(node))
    finally:
        node.destroy_node()
        context.try_shutdown()


@pytest.mark.parametrize(("module", "name"), NODES.items())
def test_a_node_sets_no_attribute_of_rclpys(taken: set[str], module: str, name: str) -> None:
    tree = ast.parse(inspect.getsource(getattr(import_module(module), name)))
    own = {
        one.attr
        for one in ast.walk(tree)
        if isinstance(one, ast.Attribute)
        and isinstance(one.ctx, ast.Store)
        and isinstance(one.value, ast.Name)
        and one.value.id == "self"
    }
    assert not own & taken
