"""Muscles as lines: colours, dashes, sag."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from musashi_muscle_bridge.arm_view.muscle_lines import (
    SLACK_COLOUR,
    dashes,
    path_length,
    sagging,
    segments,
    tension_colour,
)

COORDINATES = st.floats(-1.0, 1.0)
POINTS = st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES), min_size=2, max_size=6)
TENSIONS = st.floats(0.0, 1000.0)


def polyline(points: list[tuple[float, float, float]]) -> np.ndarray:
    line = np.array(points)
    assume(np.linalg.norm(np.diff(line, axis=0), axis=1).min() > 0.02)
    return line


def drawn_length(ends: np.ndarray) -> float:
    return float(np.linalg.norm(ends[1::2] - ends[::2], axis=1).sum())


@given(TENSIONS, TENSIONS)
def test_more_tension_is_never_bluer_nor_less_red(one: float, other: float) -> None:
    low, high = (tension_colour(tension, 450.0) for tension in sorted((one, other)))
    assert low[0] <= high[0]
    assert low[2] >= high[2]


def test_the_colour_changes_between_none_and_the_limit_and_not_beyond() -> None:
    none, half, full, more = (tension_colour(share * 450.0, 450.0) for share in (0, 0.5, 1, 2))
    assert none[0] < half[0] < full[0] == more[0]


@given(TENSIONS)
def test_no_tension_has_the_colour_of_slack(tension: float) -> None:
    assert tension_colour(tension, 450.0) != SLACK_COLOUR


@given(POINTS)
def test_segments_are_the_whole_path(points: list[tuple[float, float, float]]) -> None:
    line = polyline(points)
    assert drawn_length(segments((line,))) == pytest.approx(path_length((line,)))


@given(POINTS)
def test_about_half_of_a_dashed_path_is_drawn(points: list[tuple[float, float, float]]) -> None:
    line = polyline(points)
    assert drawn_length(dashes((line,))) == pytest.approx(path_length((line,)) / 2, abs=0.012)


@given(POINTS, st.floats(0.0, 0.5))
def test_a_sagging_path_is_longer_by_the_slack(
    points: list[tuple[float, float, float]], slack: float
) -> None:
    path = (polyline(points),)
    longer = path_length(sagging(path, slack)) - path_length(path)
    # A curve of 16 straight parts is a little shorter than the curve.
    assert longer == pytest.approx(slack, rel=0.03, abs=1e-6)


@given(POINTS, st.floats(0.001, 0.5))
def test_a_sagging_path_keeps_its_ends(
    points: list[tuple[float, float, float]], slack: float
) -> None:
    line = polyline(points)
    (sagged,) = sagging((line,), slack)
    assert np.array_equal(sagged[[0, -1]], line[[0, -1]])


def test_a_level_wire_sags_down() -> None:
    (sagged,) = sagging((np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]]),), 0.05)
    assert sagged[:, 2].min() < 0.9
    assert np.allclose(sagged[:, 1], 0.0)
