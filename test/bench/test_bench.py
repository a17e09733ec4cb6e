"""Each benchmark runs, and its results are kept and shown; no time is judged."""

import json
import math
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import run_bench
from performance_page import Result, number, page, table
from rounds import Row

SMOKE = 0.02


@pytest.mark.parametrize("name", run_bench.present())
def test_a_short_run_tells_finite_figures(name: str, tmp_path: Path) -> None:
    module: Any = import_module(name)
    rows: list[Row] = module.run(SMOKE, tmp_path)
    assert rows
    assert [one.name for one in rows if not math.isfinite(one.median)] == []
    names = [one.name for one in rows]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("name", run_bench.present())
def test_a_benchmark_asks_one_question(name: str) -> None:
    question: str = import_module(name).QUESTION
    assert question.endswith("?")
    assert "\n" not in question


def result(name: str, **fields: Any) -> Result:
    rows = (Row(name, 1.5, unit="ms", baseline="plain", ratio=0.25, rounds=(0.2, 0.3), **fields),)
    return Result("How fast?", rows, 1.0, "2026-01-01", {"cores": "2 of 2"})


def test_results_are_read_back(tmp_path: Path) -> None:
    told = {"planner": result("plan", bound="median <= 2 ms", met=True)}
    run_bench.write(told, tmp_path, tmp_path)
    assert run_bench.load_results(tmp_path / "summary.json") == told


def test_what_did_not_run_stays_as_it_was(tmp_path: Path) -> None:
    run_bench.write({"planner": result("old"), "bags": result("read")}, tmp_path, tmp_path)
    run_bench.write({"planner": result("new")}, tmp_path, tmp_path)
    kept = json.loads((tmp_path / "summary.json").read_text())
    assert [kept[name]["rows"][0]["name"] for name in ("planner", "bags")] == ["new", "read"]


def test_a_bound_that_is_not_met_stands_out() -> None:
    (line,) = table([Row("plan", 3.0, unit="ms", bound="median <= 2 ms", met=False)])[2:]
    assert "| median <= 2 ms | **no** |" in line


def test_the_page_shows_question_table_pictures_and_machine(tmp_path: Path) -> None:
    (tmp_path / "performance_planner.png").touch()
    text = page({"planner": result("plan")}, tmp_path)
    for part in ("How fast?", "| plan | 1.5 |", "images/performance_planner.png", "2 of 2"):
        assert part in text


@pytest.mark.parametrize(
    ("value", "text"), [(None, ""), (float("nan"), ""), (0.12345, "0.123"), (12345.6, "12,346")]
)
def test_numbers_have_three_digits(value: float | None, text: str) -> None:
    assert number(value) == text
