"""What the benchmarks make of the boards' log and of the baseline beside it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from board_times import BoardTimes, missed_periods, read_board_log
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from pace_baseline import Pace

LOG = (
    "boards\t0.9\t33\t00\t0.0\t1.0\n"
    "command\t1.1\t0\t5\t7\t33\t0.1,0.2\t60.0\t33\t00\t1.0\n"
    "answer\t1.2\t0\t7\t1.0\t1.1\n"
    "command\t2.1\t0\t5\t8\t30\t0.1,0.0\t60.0\t30\t00\t1.0\n"
    "answer\t2.2\t0\t8\t2.0\t2.1\n"
)


@pytest.fixture
def boards(tmp_path: Path) -> BoardTimes:
    path = tmp_path / "boards.tsv"
    path.write_text(LOG)
    return read_board_log(path)


def test_commands_have_the_times_of_their_answers(boards: BoardTimes) -> None:
    assert boards.arrived.tolist() == [1.0, 2.0]
    assert boards.measured.tolist() == [1.1, 2.1]
    assert boards.sent.tolist() == [1.2, 2.2]


def test_the_first_command_without_current_is_found(boards: BoardTimes) -> None:
    assert boards.first_off(1, 1.5) == 1
    assert boards.first_off(0, 1.5) is None


@pytest.mark.parametrize(("time", "answer"), [(1.1, -1), (1.3, 0), (9.0, 1)])
def test_an_answer_belongs_to_the_state_that_was_received_after_it(
    boards: BoardTimes, time: float, answer: int
) -> None:
    assert boards.answer_before(time) == answer


@pytest.mark.parametrize(
    ("begin", "end", "stalled"), [(0.5, 0.9, False), (0.9, 1.1, True), (1.3, 1.9, False)]
)
def test_a_stall_explains_what_was_missed_while_it_lasted(
    begin: float, end: float, stalled: bool
) -> None:
    pace = Pace(began=np.array([1.2, 2.0]), lateness=np.array([0.2, 0.0]), round_trip=np.zeros(2))
    assert pace.stalled(begin, end, limit=0.1) is stalled


def frames(*late: tuple[int, float], without: Sequence[int] = ()) -> NDArray[np.float64]:
    """Return when frames of 1 ms came: some late, by their number and [ms], some not at all."""
    times = np.arange(50.0)
    for number, by in late:
        times[number] += by
    return 5.0 + np.delete(times, list(without)) * 1e-3


@given(st.dictionaries(st.integers(1, 48), st.floats(0.0, 0.7), max_size=15))
def test_no_period_is_missed_by_frames_that_came_late(late: dict[int, float]) -> None:
    assert missed_periods(frames(*late.items()), 1e-3) == []


def test_no_period_is_missed_by_frames_that_a_stall_held_back() -> None:
    assert missed_periods(frames((20, 3.4), (21, 2.5), (22, 1.6), (23, 0.7)), 1e-3) == []


@given(st.integers(2, 40), st.integers(1, 6), st.floats(0.0, 0.4))
def test_periods_without_a_frame_are_missed(first: int, count: int, late: float) -> None:
    behind = first + count
    times = frames((behind, late), without=range(first, behind))
    assert missed_periods(times, 1e-3) == [(times[first - 1], times[first], count)]


def test_what_is_missed_near_late_frames_is_where_it_is_missed() -> None:
    times = frames((20, 0.7), (25, 0.7), without=[31])
    assert missed_periods(times, 1e-3) == [(times[30], times[31], 1)]
