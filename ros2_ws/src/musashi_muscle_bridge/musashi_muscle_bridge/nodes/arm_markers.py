"""The arm as `visualization_msgs/MarkerArray`."""

from collections.abc import Iterator

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.cdr.stamps import from_seconds
from fastswing_planner.execution.measurements import MuscleMeasurement
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.arm_view.muscle_lines import (
    SLACK_COLOUR,
    Colour,
    dashes,
    sagging,
    segments,
    tension_colour,
)
from musashi_muscle_bridge.arm_view.shapes import ArmShapes, Form, Solid

LINKS, MUSCLES, LIMP = "links", "muscles", "zero_current"
"""The markers' namespaces. The last one is the outline of muscles at zero current."""

_TYPES = {Form.BOX: Marker.CUBE, Form.BALL: Marker.SPHERE, Form.CYLINDER: Marker.CYLINDER}
_WIDTH, _OUTLINE_WIDTH = 0.006, 0.018  # [m]
_OUTLINE: Colour = (1.0, 0.75, 0.0)
_OUTLINE_OPACITY = 0.35


class ArmMarkers:
    """Draws a robot's states."""

    def __init__(self, robot: Robot, lifetime: float, slack_tension: float) -> None:
        """Read the robot's MJCF; raises RobotDescriptionError.

        lifetime       [s] after which a viewer forgets a marker
        slack_tension  [N] a muscle that pulls less is drawn slack
        """
        self._robot = robot
        self._shapes = ArmShapes(robot)
        sec, nanosec = from_seconds(lifetime)
        self._lifetime = Duration(sec=sec, nanosec=nanosec)
        self._slack_tension = slack_tension

    def draw(
        self, header: Header, joint_position: Vector, muscles: MuscleMeasurement | None
    ) -> MarkerArray:
        """Return the arm in a posture [rad], shape (n,); without `muscles` only its links."""
        self._shapes.move(joint_position)
        markers = [
            self._link(header, number, solid) for number, solid in enumerate(self._shapes.solids)
        ]
        if muscles is not None:
            lengths = self._robot.model.lengths(joint_position)
            slack = np.maximum(muscles.length - lengths, 0.0)
            markers += self._muscles(header, muscles, slack)
        return MarkerArray(markers=markers)

    def _link(self, header: Header, number: int, solid: Solid) -> Marker:
        pose = self._shapes.pose(solid)
        w, x, y, z = pose.orientation.tolist()
        marker = self._marker(header, LINKS, number, _TYPES[solid.form])
        marker.pose = Pose(
            position=_point(pose.position), orientation=Quaternion(x=x, y=y, z=z, w=w)
        )
        marker.scale = Vector3(**dict(zip("xyz", solid.size.tolist(), strict=True)))
        red, green, blue, opacity = solid.colour
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=opacity)
        return marker

    def _muscles(
        self, header: Header, muscles: MuscleMeasurement, slack: Vector
    ) -> Iterator[Marker]:
        names, limits = self._robot.model.muscle_names, self._robot.tension_limit
        for number, path in enumerate(self._shapes.paths()):
            tension = float(muscles.tension[number])
            if tension < self._slack_tension:
                points, colour = dashes(sagging(path, float(slack[number]))), SLACK_COLOUR
            else:
                points = segments(path)
                colour = tension_colour(tension, float(limits[number]))
            yield self._lines(header, MUSCLES, number, points, _WIDTH, (*colour, 1.0))
            if names[number] in muscles.limp:
                outline = (*_OUTLINE, _OUTLINE_OPACITY)
                yield self._lines(header, LIMP, number, points, _OUTLINE_WIDTH, outline)
            else:
                gone = self._marker(header, LIMP, number, Marker.LINE_LIST)
                gone.action = Marker.DELETE
                yield gone

    def _lines(
        self,
        header: Header,
        namespace: str,
        number: int,
        points: Matrix,
        width: float,
        colour: tuple[float, float, float, float],
    ) -> Marker:
        marker = self._marker(header, namespace, number, Marker.LINE_LIST)
        marker.points = [_point(point) for point in points]
        marker.scale.x = width
        red, green, blue, opacity = colour
        marker.color = ColorRGBA(r=red, g=green, b=blue, a=opacity)
        return marker

    def _marker(self, header: Header, namespace: str, number: int, kind: int) -> Marker:
        marker = Marker(header=header, ns=namespace, id=number, type=kind, action=Marker.ADD)
        marker.lifetime = self._lifetime
        marker.pose.orientation.w = 1.0
        return marker


def _point(position: Vector) -> Point:
    x, y, z = position.tolist()
    return Point(x=x, y=y, z=z)
