"""A ratio counts as worse when three runs out of three say so."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import pytest
from regression import Ratios, accept, load_accepted, ratios_of, still_worse, worse
from rounds import Row, in_turns, ratios, row

ACCEPTED = {"planner": {"plan": 0.4, "cold": 1.0}, "bags": {"read": 0.1}}


def measuring(runs: Sequence[float], asked: list[list[str]]) -> Callable[[Sequence[str]], Ratios]:
    """Return a measurement whose ratio of `plan` is the next of `runs`."""
    left = list(runs)

    def measure(benchmarks: Sequence[str]) -> dict[str, dict[str, float]]:
        asked.append(list(benchmarks))
        plan = {"plan": left.pop(0), "cold": 1.0}
        return {name: plan if name == "planner" else dict(ACCEPTED[name]) for name in benchmarks}

    return measure


@pytest.mark.parametrize(("ratio", "is_worse"), [(0.3, False), (0.499, False), (0.501, True)])
def test_a_quarter_worse_is_worse(ratio: float, is_worse: bool) -> None:
    found = worse(ACCEPTED, {"planner": {"plan": ratio, "cold": 1.0}})
    assert found == ({"planner": {"plan": "ratio 0.501, accepted 0.4"}} if is_worse else {})


def test_no_number_is_worse() -> None:
    found = worse(ACCEPTED, {"planner": {"plan": float("nan"), "cold": 1.0}})
    assert list(found["planner"]) == ["plan"]


def test_an_accepted_row_that_is_gone_is_told() -> None:
    found = worse(ACCEPTED, {"planner": {"plan": 0.4}})
    assert found == {"planner": {"cold": "is not measured any more"}}


def test_what_was_never_accepted_is_not_judged() -> None:
    assert (
        worse(ACCEPTED, {"planner": {"plan": 0.4, "cold": 1.0, "new": 9.0}, "x": {"y": 9.0}}) == {}
    )


def test_where_only_p99_was_asked_for_its_ratio_counts() -> None:
    jitter = Row("jitter", 6.0, ratio=0.7, ratio_p99=2.0, bound="p99 < 0.5 ms")
    echo = Row("echo", 6.0, ratio=0.7, ratio_p99=2.0, bound="median <= 1.5, p99 <= 2.5")
    assert ratios_of({"bridge": [jitter, echo]}) == {"bridge": {"jitter": 2.0, "echo": 0.7}}


def test_worse_three_times_out_of_three_fails() -> None:
    found = still_worse(ACCEPTED, ["planner", "bags"], measuring([0.6, 0.7, 0.8], []))
    assert found == {"planner": {"plan": "ratio 0.8, accepted 0.4"}}


@pytest.mark.parametrize("runs", [[0.4], [0.6, 0.4], [0.6, 0.6, 0.4]])
def test_one_good_run_is_enough(runs: list[float]) -> None:
    asked: list[list[str]] = []
    assert still_worse(ACCEPTED, ["planner", "bags"], measuring(runs, asked)) == {}
    assert len(asked) == len(runs)


def test_only_what_looks_worse_is_run_again() -> None:
    asked: list[list[str]] = []
    still_worse(ACCEPTED, ["planner", "bags"], measuring([0.6, 0.6, 0.6], asked))
    assert asked == [["planner", "bags"], ["planner"], ["planner"]]


def test_two_rows_that_are_worse_in_turns_are_not_worse() -> None:
    runs = [{"plan": 0.9, "cold": 1.0}, {"plan": 0.4, "cold": 9.0}]
    assert still_worse(ACCEPTED, ["planner"], lambda _: {"planner": runs.pop(0)}) == {}


def test_accepting_keeps_the_benchmarks_that_did_not_run(tmp_path: Path) -> None:
    path = tmp_path / "accepted.json"
    accept(path, ACCEPTED)
    accept(path, {"bags": {"read": 0.2}})
    assert load_accepted(path) == {**ACCEPTED, "bags": {"read": 0.2}}


def test_nothing_is_accepted_at_first(tmp_path: Path) -> None:
    assert load_accepted(tmp_path / "accepted.json") == {}


def test_rows_without_a_baseline_have_no_ratio() -> None:
    rows = [Row("alone", 3.0), Row("beside", 3.0, ratio=0.5)]
    assert ratios_of({"planner": rows}) == {"planner": {"beside": 0.5}}


# Rounds.


def test_programs_take_turns() -> None:
    order: list[str] = []

    def program(name: str) -> list[float]:
        order.append(name)
        return [1.0]

    in_turns({name: partial(program, name) for name in "AB"}, 3)
    assert order == list("ABABAB")


def test_a_ratio_is_to_the_baseline_of_the_same_round() -> None:
    found = in_turns({"A": lambda: [2.0, 4.0, 6.0], "B": lambda: [1.0, 2.0, 3.0]}, 2)
    assert ratios(found["A"], found["B"], 50.0).tolist() == [2.0, 2.0]


def test_a_round_that_was_disturbed_does_not_count_in_the_ratio() -> None:
    slow = [[1.0], [1.0], [9.0]]
    found = in_turns({"A": lambda: slow.pop(0), "B": lambda: [2.0]}, 3)
    told = row("A", found["A"], "s", ("B", found["B"]), ratio_at_most=0.5)
    assert (told.ratio, told.rounds, told.met) == (0.5, (0.5, 0.5, 4.5), True)


def test_a_row_tells_median_p99_and_maximum_in_its_unit() -> None:
    told = row("A", in_turns({"A": lambda: [0.001, 0.002, 0.006]}, 2)["A"], "ms", at_most=1.5)
    assert (told.median, told.maximum, told.bound, told.met) == (
        2.0,
        6.0,
        "median <= 1.5 ms",
        False,
    )
