"""A parameter table as ROS knows it: declared at start, judged at every change."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from fastswing_planner.errors import PlannerError
from fastswing_planner.lifecycle.parameters import Parameter, check_change, unknown_name_text


def declare(node: Node, table: Sequence[Parameter]) -> None:
    """Declare a table, and refuse what is misspelt: `read_ony` must not energise the arm.

    Other unknown names are a warning only: in ROS one file may serve all nodes.

    Raises InvalidParameterTypeException for an override of other type, InvalidParameter for one
    that is nearly the name of a parameter.
    """
    for row in table:
        node.declare_parameter(
            row.name,
            row.default,
            ParameterDescriptor(
                description=row.description,
                additional_constraints=row.range_text,
                # An empty list has no element that tells its type; `Parameter.check` does.
                dynamic_typing=isinstance(row.default, list),
            ),
        )
    known = [row.name for row in table]
    for name in node._parameter_overrides:  # rclpy offers no public way to see them
        if not node.has_parameter(name) and not name.startswith("qos_overrides."):
            node.get_logger().warning(unknown_name_text(name, known))


def judged(
    table: Sequence[Parameter],
    changes: Iterable[RosParameter],
    judge: Callable[[str, Any], None] | None,
) -> SetParametersResult:
    """Return whether parameters may change; see `check_change`."""
    rows = {row.name: row for row in table}
    for change in changes:
        if change.name not in rows:
            continue
        try:
            check_change(rows[change.name], change.value, judge)
        except PlannerError as error:
            return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)
