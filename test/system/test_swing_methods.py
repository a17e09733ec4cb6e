"""Every method swings the emulated arm to its end, through all nodes."""

from typing import TYPE_CHECKING

import pytest

from fastswing_msgs.msg import ErrorCode, SwingOptions

if TYPE_CHECKING:
    from test.system.suite import Suite


METHODS = {
    "basic": SwingOptions.METHOD_BASIC,
    "inhibit": SwingOptions.METHOD_INHIBIT,
    "elongate": SwingOptions.METHOD_ELONGATE,
    "hybrid": SwingOptions.METHOD_HYBRID,
}


@pytest.mark.parametrize("method", METHODS)
def test_the_arm_arrives(all_nodes: "Suite", method: str) -> None:
    goal = all_nodes.goal(options=SwingOptions(method=METHODS[method]))
    result = all_nodes.execute(goal)
    assert (result.error_code, result.error_string) == (ErrorCode.SUCCESS, "")
