"""Parameters that several nodes have."""

from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.lifecycle.real_time import REAL_TIME
from fastswing_planner.robot.path import MUSASHI

AUTOSTART = Parameter(
    "autostart",
    True,
    "Configure and activate at start, so that a bridge holds the arm at once; false: wait for a "
    "lifecycle manager.",
)
ROBOT_DESCRIPTION = Parameter(
    "robot_description",
    MUSASHI,
    "YAML file of the robot, beside its MJCF; a path or package://PACKAGE/PATH. The same for all "
    "nodes of an arm, or plans and limits are another arm's.",
)
EVERY_NODE = (AUTOSTART, *REAL_TIME)
"""Parameters that every node has."""
