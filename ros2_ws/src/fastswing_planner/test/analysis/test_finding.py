"""A swing is a motion between two rests: a fast one, or any while the inhibitor was armed."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.analysis.finding import (
    FindingSettings,
    Interval,
    armed_intervals,
    fastest_joint_speed,
    find_bursts,
    moved_towards,
    segments,
    swing_command,
)
from fastswing_planner.analysis.recording import CommandSeries, StatusSeries
from fastswing_planner.arrays import Vector
from fastswing_planner.errors import InvalidLimit

SETTINGS = FindingSettings(swing_speed=1.0, rest_speed=0.15, rest_time=0.2, longest_gap=0.5)


def speeds(*pieces: tuple[float, float]) -> tuple[Vector, Vector]:
    """Return time and speed, 100 Hz, of pieces (duration [s], speed [rad/s])."""
    values = np.concatenate([np.full(round(100 * length), speed) for length, speed in pieces])
    return np.arange(values.size) / 100.0, values


def test_a_fast_motion_is_found_and_a_slow_one_is_not() -> None:
    time, speed = speeds((1, 0.0), (2, 0.8), (1, 0.0), (1, 2.0), (1, 0.0))
    (burst,) = find_bursts(time, speed, [], SETTINGS)
    assert (time[burst.first], time[burst.last]) == pytest.approx((4.0, 4.99))


def test_a_slow_motion_is_a_swing_while_the_inhibitor_is_armed() -> None:
    time, speed = speeds((1, 0.0), (1, 0.4), (1, 0.0))
    (burst,) = find_bursts(time, speed, [Interval(0.9, 1.5)], SETTINGS)
    assert burst.armed


def test_an_armed_inhibitor_without_motion_is_no_swing() -> None:
    time, speed = speeds((3, 0.1))
    assert find_bursts(time, speed, [Interval(0.5, 2.0)], SETTINGS) == []


@pytest.mark.parametrize(("rest", "count"), [(0.1, 1), (0.3, 2)])
def test_two_motions_are_two_swings_if_the_arm_rests_between_them(rest: float, count: int) -> None:
    time, speed = speeds((1, 0.0), (0.5, 2.0), (rest, 0.0), (0.5, 2.0), (1, 0.0))
    assert len(find_bursts(time, speed, [], SETTINGS)) == count


def test_a_motion_at_the_beginning_or_end_of_the_recording_is_cut() -> None:
    time, speed = speeds((0.5, 2.0), (1, 0.0), (0.5, 2.0))
    first, second = find_bursts(time, speed, [], SETTINGS)
    assert (first.begins_cut, first.ends_cut) == (True, False)
    assert (second.begins_cut, second.ends_cut) == (False, True)


def test_a_gap_cuts_a_motion() -> None:
    time, speed = speeds((1, 0.0), (1, 2.0), (1, 0.0))
    time = np.where(time >= 1.5, time + 3.0, time)
    before, after = find_bursts(time, speed, [], SETTINGS)
    assert before.ends_cut
    assert after.begins_cut


def without(time: Vector, speed: Vector, begin: float, end: float) -> tuple[Vector, Vector]:
    """Return both without the states between two times [s]."""
    kept = (time <= begin) | (time >= end)
    return time[kept], speed[kept]


@pytest.mark.parametrize("hole", [0.22, 0.45])
def test_a_pause_of_joint_states_is_no_rest(hole: float) -> None:
    time, speed = speeds((1, 0.0), (1, 2.0), (1, 0.0))
    time, speed = without(time, speed, 1.3, 1.3 + hole)
    (burst,) = find_bursts(time, speed, [], SETTINGS)
    assert burst.hole == pytest.approx(hole)
    assert (time[burst.first], time[burst.last]) == pytest.approx((1.0, 1.99))


def test_a_rest_is_seen_for_all_of_its_time() -> None:
    time, speed = speeds((1, 0.0), (0.5, 2.0), (0.3, 0.0), (0.5, 2.0), (1, 0.0))
    assert len(find_bursts(*without(time, speed, 1.6, 1.72), [], SETTINGS)) == 1


def test_a_rest_in_which_a_few_states_are_missing_is_a_rest() -> None:
    time, speed = speeds((1, 0.0), (0.5, 2.0), (0.3, 0.0), (0.5, 2.0), (1, 0.0))
    bursts = find_bursts(*without(time, speed, 1.6, 1.65), [], SETTINGS)
    assert [burst.hole for burst in bursts] == [0.0, 0.0]


@pytest.mark.parametrize(("begin", "end"), [(0.8, 1.2), (1.8, 2.2)])
def test_a_pause_beside_a_motion_belongs_to_it(begin: float, end: float) -> None:
    time, speed = speeds((1, 0.0), (1, 2.0), (1, 0.0))
    time, speed = without(time, speed, begin, end)
    (burst,) = find_bursts(time, speed, [], SETTINGS)
    assert burst.hole == pytest.approx(end - begin)
    assert begin >= time[burst.first] or end <= time[burst.last]


def test_a_clock_that_jumps_back_cuts_a_motion() -> None:
    time, speed = speeds((1, 0.0), (1, 2.0), (1, 0.0))
    time = np.where(time >= 1.5, time - 100.0, time)
    assert len(find_bursts(time, speed, [], SETTINGS)) == 2


def test_stamps_that_run_backwards_by_a_millisecond_cut_nothing() -> None:
    time, speed = speeds((1, 0.0), (1, 2.0), (1, 0.0))
    time[150] = time[149] - 0.001
    assert len(find_bursts(time, speed, [], SETTINGS)) == 1


def test_unknown_speeds_are_no_motion() -> None:
    time, speed = speeds((1, 0.0), (1, np.nan), (1, 0.0))
    assert find_bursts(time, speed, [], SETTINGS) == []


def test_unknown_speeds_are_no_rest() -> None:
    time, speed = speeds((1, 0.0), (0.5, 2.0), (0.3, np.nan), (0.5, 2.0), (1, 0.0))
    (burst,) = find_bursts(time, speed, [], SETTINGS)
    assert (time[burst.first], time[burst.last]) == pytest.approx((1.0, 2.29))


def test_no_joint_state_is_no_swing() -> None:
    assert find_bursts(np.zeros(0), np.zeros(0), [], SETTINGS) == []


@given(st.lists(st.floats(-2.0, 2.0), max_size=30))
def test_the_pieces_of_a_recording_are_all_of_it(steps: list[float]) -> None:
    time = np.cumsum([0.0, *steps])
    rows = [row for first, last in segments(time, 0.5) for row in range(first, last + 1)]
    assert rows == list(range(time.size))


@given(st.lists(st.sampled_from([0.0, 0.1, 0.3, 1.2, 3.0]), min_size=1, max_size=40))
def test_motions_follow_each_other_and_hold_their_fastest_state(levels: list[float]) -> None:
    time, speed = speeds(*((0.05, level) for level in levels))
    bursts = find_bursts(time, speed, [], SETTINGS)
    assert all(a.last < b.first for a, b in pairwise(bursts))
    for burst in bursts:
        assert speed[burst.fastest] == speed[burst.first : burst.last + 1].max()
        assert speed[burst.fastest] > SETTINGS.swing_speed


@given(
    st.lists(st.sampled_from([0.0, 0.1, 0.3, 1.2, 3.0]), min_size=1, max_size=30),
    st.floats(-1e4, 1e4),
)
def test_when_a_recording_began_changes_nothing(levels: list[float], shift: float) -> None:
    time, speed = speeds(*((0.05, level) for level in levels))
    # Times on a grid that shifting does not round.
    shift = round(shift)
    time = np.round(time * 128) / 128
    assert find_bursts(time, speed, [], SETTINGS) == find_bursts(time + shift, speed, [], SETTINGS)


def test_armed_is_from_the_first_message_that_says_so_to_the_first_that_does_not() -> None:
    status = StatusSeries(
        np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]),
        np.array([False, True, True, False, False, True]),
        np.zeros(6),
        ("",) * 6,
    )
    assert armed_intervals(status) == [Interval(2.0, 4.0), Interval(6.0, 6.0)]


def test_the_swings_command_is_the_largest_step_shortly_before_its_motion() -> None:
    commands = CommandSeries(np.array([1.0, 3.8, 3.9, 7.0]), np.array([0.5, 0.01, 0.2, 0.9]))
    assert swing_command(commands, begin=4.0, fastest=4.5) == 3.9


def test_a_command_begins_one_swing() -> None:
    commands = CommandSeries(np.array([3.8, 3.9]), np.array([0.2, 0.1]))
    assert swing_command(commands, begin=4.0, fastest=4.5, after=3.8) == 3.9
    assert swing_command(commands, begin=4.0, fastest=4.5, after=3.9) is None


@pytest.mark.parametrize("step", [0.0, 5e-4])
def test_a_command_that_changes_nothing_starts_no_swing(step: float) -> None:
    commands = CommandSeries(np.array([3.9]), np.array([step]))
    assert swing_command(commands, begin=4.0, fastest=4.5) is None


@pytest.mark.parametrize(("finish", "share"), [(1.0, 1.0), (0.5, 0.5), (0.0, 0.0), (-1.0, -1.0)])
def test_a_motion_goes_a_share_of_the_plans_way(finish: float, share: float) -> None:
    start, end = np.zeros(2), np.array([0.6, 0.8])
    assert moved_towards(start, end, start, finish * end) == pytest.approx(share)


def test_the_fastest_joint_counts_and_unknown_ones_do_not() -> None:
    velocity = np.array([[1.0, -3.0], [np.nan, 2.0], [np.nan, np.nan]])
    assert fastest_joint_speed(velocity) == pytest.approx([3.0, 2.0, np.nan], nan_ok=True)


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"rest_time": 0.0}, "rest_time is 0, expected a positive number"),
        ({"swing_speed": np.nan}, "swing_speed is nan, expected a positive number"),
        (
            {"swing_speed": 0.1},
            "swing_speed is 0.1 rad/s, must be above rest_speed, 0.15 rad/s",
        ),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings: dict[str, float], text: str) -> None:
    with pytest.raises(InvalidLimit) as caught:
        FindingSettings(**settings)
    assert str(caught.value) == text
