"""Whatever breaks, the arm ends safe, the operator sees it, and nothing needs a kill by hand.

Each row of `fault_rows.py` runs through the executables. docs/fault_matrix.md is made from the
results by `make faults`, which runs the timed rows many times.
"""

import json
import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from bench import Bench
from fault_rows import ROWS, Row, Safe
from injections import NotPossible
from outcome import Outcome, carry_out

if TYPE_CHECKING:
    from test.system.suite import Suite


RUNS = int(os.environ.get("FASTSWING_FAULT_RUNS", "0"))
"""Runs of each timed row; 0: the rows of `make test`, once."""
RESULTS = os.environ.get("FASTSWING_FAULT_RESULTS", "")
LEASE_SEC, WATCHDOG_SEC, CONTROL_RATE = 0.05, 0.1, 500.0
"""Defaults of inhibitor and bridge, which the suite runs with."""


def cases() -> list[tuple[Row, int]]:
    if RUNS == 0:
        return [(row, 0) for row in ROWS if row.quick]
    # Round by round, and going on from the results that are there: it may be ended early.
    lines = Path(RESULTS).read_text().splitlines() if Path(RESULTS).is_file() else []
    done = Counter(json.loads(line)["row"] for line in lines)
    return [
        (row, run)
        for run in range(RUNS)
        for row in sorted(ROWS, key=lambda row: not row.quick)
        if run >= done[row.name] and (run == 0 or row.timing)
    ]


@pytest.fixture(scope="module")
def bench(new_suite: "Suite", tmp_path_factory: pytest.TempPathFactory) -> Bench:
    bench = Bench(new_suite, tmp_path_factory.mktemp("boards"))
    bench.start_all()
    return bench


CASES = cases()
OUTCOMES: dict[tuple[str, int], Outcome] = {}
TRIED: Counter[tuple[str, int]] = Counter()


def cases_of(concerns: Callable[[Row], bool]) -> pytest.MarkDecorator:
    """Return a mark: the test runs for these rows."""
    chosen = [case for case in CASES if concerns(case[0])]
    return pytest.mark.parametrize("case", chosen, ids=lambda case: f"{case[0].name}-{case[1]}")


def write(result: dict[str, Any]) -> None:
    """Add a result to those from which the page is made."""
    if RESULTS:
        with Path(RESULTS).open("a") as file:
            file.write(json.dumps(result) + "\n")


@pytest.fixture
def row(case: tuple[Row, int]) -> Row:
    return case[0]


@pytest.fixture
def outcome(bench: Bench, case: tuple[Row, int]) -> Outcome:
    """Carry out a row once for all tests of it."""
    row, run = case
    if (row.name, run) not in OUTCOMES:
        if TRIED[row.name, run] > 1:
            pytest.fail("the row failed already, in the test before")
        TRIED[row.name, run] += 1
        try:
            outcome = carry_out(bench, row)
        except NotPossible as reason:
            pytest.skip(str(reason))
        except (Exception, pytest.fail.Exception) as error:
            write({"row": row.name, "failed": str(error)})
            raise
        OUTCOMES[row.name, run] = outcome
        write(outcome.as_json())
    return OUTCOMES[row.name, run]


@cases_of(lambda row: True)
def test_the_arm_ends_safe_and_the_operator_sees_why(outcome: Outcome, row: Row) -> None:
    assert set(outcome.seen) == {place for place, _ in row.sees}


@cases_of(lambda row: True)
def test_all_muscles_hold_again_and_nothing_was_killed_by_hand(outcome: Outcome) -> None:
    assert outcome.recovered
    assert outcome.killed_by_hand == []


@cases_of(lambda row: True)
def test_no_command_is_beyond_a_limit(outcome: Outcome) -> None:
    assert outcome.beyond_limits == []


@cases_of(lambda row: row.fault.startswith("SIG") and row.name.endswith("of_inhibitor_swing"))
def test_without_inhibitor_no_muscle_is_let_go_longer_than_lease_and_two_periods(
    outcome: Outcome,
) -> None:
    # Frames of the bridge, not seconds of this machine: a bridge that is not scheduled sends none.
    assert outcome.frames_without_current <= LEASE_SEC * CONTROL_RATE + 2


@cases_of(lambda row: row.safe is Safe.WATCHDOG)
def test_without_commands_every_board_is_in_its_watchdog_within_its_time_and_one_period(
    outcome: Outcome,
) -> None:
    # The boards' own time, not this machine's: boards that are not scheduled do not age.
    assert outcome.silence is not None
    assert WATCHDOG_SEC <= outcome.silence <= WATCHDOG_SEC + 1.0 / CONTROL_RATE
