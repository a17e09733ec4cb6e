"""Two groups of swings: medians, spread, and whether they differ."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.measuring import measure_swings
from fastswing_planner.analysis.recording import Recording
from fastswing_planner.analysis.report.text import comparison_cells
from fastswing_planner.analysis.verdicts.comparison import Difference, compare, spread


@pytest.fixture
def swings(recorded: Callable[..., Recording]) -> Callable[..., list[MeasuredSwing]]:
    """Return swings with these times [s] and a method."""
    (swing,) = measure_swings(recorded())

    def build(times: Sequence[float], method: str = "inhibit") -> list[MeasuredSwing]:
        return [replace(swing, arrival=time, method=method) for time in times]

    return build


def of_time(differences: Sequence[Difference]) -> Difference:
    (found,) = [one for one in differences if one.figure == "time"]
    return found


Swings = Callable[..., list[MeasuredSwing]]
SLOW = [0.9, 0.91, 0.92, 0.93, 0.94, 0.95]
FAST = [0.7, 0.71, 0.72, 0.73, 0.74, 0.75]


def test_groups_that_do_not_overlap_differ(swings: Swings) -> None:
    found = of_time(compare(swings(SLOW), swings(FAST)))
    assert found.verdict == "different"
    assert found.change == pytest.approx(-0.2)
    # 2 of the 924 ways to divide twelve values into sixes, and one of seven figures.
    assert found.p_value == pytest.approx(7 * 2 / 924)


def test_equal_groups_show_no_difference(swings: Swings) -> None:
    assert of_time(compare(swings(SLOW), swings(SLOW))).verdict == "no difference shown"


@pytest.mark.parametrize("count", [3, 5])
def test_five_against_five_can_never_tell_by_seven_figures(swings: Swings, count: int) -> None:
    found = of_time(compare(swings(SLOW[:count]), swings(FAST[:count])))
    assert found.verdict == "too few swings to tell"


def test_each_method_is_adjusted_for_its_own_figures_only(swings: Swings) -> None:
    alone = of_time(compare(swings(SLOW), swings(FAST)))
    both = compare(
        swings(SLOW) + swings(SLOW, "basic"),
        swings(FAST) + swings(FAST, "basic"),
    )
    assert of_time([one for one in both if one.method == "basic"]).p_value == alone.p_value


def test_swings_that_did_not_arrive_are_told(swings: Swings) -> None:
    found = of_time(compare(swings(SLOW), swings([*FAST, np.nan, np.nan])))
    assert (found.second.count, found.second.total) == (6, 8)
    first, second = comparison_cells(found)[2:4]
    assert first.endswith("), 6")
    assert second.endswith("), 6 of 8 arrived")


def test_a_figure_that_one_group_lacks_is_named_so(swings: Swings) -> None:
    found = of_time(compare(swings(SLOW), swings([np.nan] * 4)))
    assert (found.second.count, found.verdict) == (0, "only in one group")


def test_methods_are_compared_with_themselves(swings: Swings) -> None:
    first = swings(SLOW, "basic") + swings(FAST, "elongate")
    found = compare(first, swings(SLOW, "basic") + swings(FAST, "hybrid"))
    assert {one.method for one in found} == {"basic"}


def test_groups_of_different_methods_are_compared_as_wholes(swings: Swings) -> None:
    found = compare(swings(SLOW, "basic"), swings(FAST, "elongate"))
    assert {one.method for one in found} == {"all"}


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=20))
def test_a_spread_is_in_order(values: list[float]) -> None:
    found = spread([*values, np.nan])
    assert (found.count, found.total) == (len(values), len(values) + 1)
    assert found.least <= found.low <= found.median <= found.high <= found.most
