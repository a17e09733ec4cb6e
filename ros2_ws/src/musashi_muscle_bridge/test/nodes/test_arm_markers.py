"""The arm's state as markers."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from fastswing_planner.execution.measurements import MuscleMeasurement
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.arm_view.muscle_lines import SLACK_COLOUR
from musashi_muscle_bridge.nodes.arm_markers import LIMP, LINKS, MUSCLES, ArmMarkers

LIFETIME, SLACK_TENSION = 0.5, 1.0
TENSIONS = st.lists(st.floats(0.0, 600.0), min_size=10, max_size=10)


@pytest.fixture(scope="module")
def markers(musashi: Robot) -> ArmMarkers:
    return ArmMarkers(musashi, LIFETIME, SLACK_TENSION)


def measured(
    robot: Robot, tension: list[float], paid_out: float = 0.0, limp: tuple[str, ...] = ()
) -> MuscleMeasurement:
    length = robot.model.lengths(robot.postures["home"]) + paid_out
    return MuscleMeasurement(0.0, length, np.zeros(10), np.array(tension), limp=limp)


def drawn(markers: ArmMarkers, robot: Robot, muscles: MuscleMeasurement | None) -> MarkerArray:
    return markers.draw(Header(frame_id="world"), robot.postures["home"], muscles)


def of(array: MarkerArray, namespace: str) -> list[Marker]:
    return [marker for marker in array.markers if marker.ns == namespace]


def points_of(marker: Marker) -> np.ndarray:
    return np.array([(point.x, point.y, point.z) for point in marker.points])


def line_length(marker: Marker) -> float:
    points = points_of(marker)
    return float(np.linalg.norm(points[1::2] - points[::2], axis=1).sum())


def colour(marker: Marker) -> tuple[float, float, float]:
    return marker.color.r, marker.color.g, marker.color.b


@given(TENSIONS)
def test_no_two_markers_have_the_same_namespace_and_id(
    markers: ArmMarkers, musashi: Robot, tension: list[float]
) -> None:
    array = drawn(markers, musashi, measured(musashi, tension))
    assert set(Counter((one.ns, one.id) for one in array.markers).values()) == {1}


@given(TENSIONS)
def test_every_marker_expires_and_is_in_the_frame(
    markers: ArmMarkers, musashi: Robot, tension: list[float]
) -> None:
    for marker in drawn(markers, musashi, measured(musashi, tension)).markers:
        assert marker.lifetime.sec + marker.lifetime.nanosec * 1e-9 == pytest.approx(LIFETIME)
        assert marker.header.frame_id == "world"


def test_the_same_marker_is_the_same_thing_whatever_its_state(
    markers: ArmMarkers, musashi: Robot
) -> None:
    taut = drawn(markers, musashi, measured(musashi, [20.0] * 10))
    slack = drawn(markers, musashi, measured(musashi, [0.0] * 10, limp=("#3",)))
    assert [(one.ns, one.id) for one in taut.markers] == [(one.ns, one.id) for one in slack.markers]


def test_a_taut_muscle_is_drawn_from_end_to_end(markers: ArmMarkers, musashi: Robot) -> None:
    lines = of(drawn(markers, musashi, measured(musashi, [20.0] * 10)), MUSCLES)
    lengths = musashi.model.lengths(musashi.postures["home"])
    assert [line_length(line) for line in lines] == pytest.approx(lengths, abs=1e-4)


@given(st.floats(2.0, 600.0), st.floats(2.0, 600.0))
def test_more_tension_is_redder_or_equally_red(
    markers: ArmMarkers, musashi: Robot, one: float, other: float
) -> None:
    low, high = sorted((one, other))
    lines = of(drawn(markers, musashi, measured(musashi, [low, high] * 5)), MUSCLES)
    assert lines[0].color.r <= lines[1].color.r


def test_a_slack_muscle_is_grey_dashed_and_sags(markers: ArmMarkers, musashi: Robot) -> None:
    taut = of(drawn(markers, musashi, measured(musashi, [20.0] * 10)), MUSCLES)[1]
    slack = of(drawn(markers, musashi, measured(musashi, [0.0] * 10, paid_out=0.05)), MUSCLES)[1]
    assert colour(slack) == pytest.approx(SLACK_COLOUR)
    assert line_length(slack) == pytest.approx((line_length(taut) + 0.05) / 2, abs=0.015)
    begin, end = points_of(taut)
    along = (end - begin) / np.linalg.norm(end - begin)
    away = np.linalg.norm(np.cross(points_of(slack) - begin, along), axis=1)
    assert away.max() > 0.02


def test_a_taut_muscle_is_not_grey(markers: ArmMarkers, musashi: Robot) -> None:
    line = of(drawn(markers, musashi, measured(musashi, [20.0] * 10)), MUSCLES)[0]
    assert colour(line) != pytest.approx(SLACK_COLOUR)


def test_muscles_at_zero_current_are_outlined_and_no_others(
    markers: ArmMarkers, musashi: Robot
) -> None:
    array = drawn(markers, musashi, measured(musashi, [20.0] * 10, limp=("#3", "#9")))
    assert [one.action == Marker.ADD for one in of(array, LIMP)] == [
        name in ("#3", "#9") for name in musashi.model.muscle_names
    ]


def test_an_outline_is_wider_than_its_muscle(markers: ArmMarkers, musashi: Robot) -> None:
    array = drawn(markers, musashi, measured(musashi, [20.0] * 10, limp=("#1",)))
    outline, muscle = of(array, LIMP)[0], of(array, MUSCLES)[0]
    assert outline.points == muscle.points
    assert outline.scale.x > 2 * muscle.scale.x


def test_without_a_muscle_state_only_links_are_drawn(markers: ArmMarkers, musashi: Robot) -> None:
    assert {one.ns for one in drawn(markers, musashi, None).markers} == {LINKS}


def test_every_orientation_is_a_rotation(markers: ArmMarkers, musashi: Robot) -> None:
    for marker in drawn(markers, musashi, measured(musashi, [20.0] * 10)).markers:
        turn = marker.pose.orientation
        assert np.linalg.norm([turn.x, turn.y, turn.z, turn.w]) == pytest.approx(1.0)
