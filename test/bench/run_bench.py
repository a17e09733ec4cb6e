"""Runs the benchmarks, prints tables, and writes out/bench/summary.json and docs/performance.md.

Each benchmark is a module of this folder with QUESTION and run(scale, plots) -> list[Row]; one that
can run for ten minutes more offers run_long() too. Ends with 1 if `--check` finds a ratio worse.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(HERE), str(HERE.parent / "bags"), str(ROOT / "demo")]

from machine import machine  # noqa: E402
from performance_page import Result, page, table  # noqa: E402
from processes import free_domain, isolated_environment  # noqa: E402
from regression import accept, load_accepted, ratios_of, still_worse  # noqa: E402
from rounds import Row  # noqa: E402

BENCHMARKS = ("inhibitor", "bridge", "whole_loop", "planner", "headless", "bags", "startup")
ACCEPTED = HERE / "accepted.json"
_CHECK_SCALE = 0.25


def present() -> list[str]:
    """Return the benchmarks that are there, in order."""
    return [name for name in BENCHMARKS if (HERE / f"{name}.py").exists()]


def measure(name: str, scale: float, plots: Path | None, long: bool) -> Result:
    """Run one benchmark and print its table."""
    module: Any = import_module(name)
    found, date = machine(), time.strftime("%Y-%m-%d")
    print(f"\n{name}: {module.QUESTION}", flush=True)
    rows: list[Row] = module.run(scale, plots)
    if long and hasattr(module, "run_long"):
        rows += module.run_long()
    print("\n".join(table(rows)), flush=True)
    return Result(module.QUESTION, tuple(rows), scale, date, found)


def load_results(path: Path) -> dict[str, Result]:
    """Read what earlier runs told."""
    if not path.exists():
        return {}
    results = {}
    for name, fields in json.loads(path.read_text()).items():
        rows = tuple(Row(**{**one, "rounds": tuple(one["rounds"])}) for one in fields["rows"])
        results[name] = replace(Result(**fields), rows=rows)
    return results


def write(results: dict[str, Result], output: Path, docs: Path) -> None:
    """Write summary and page; what was not run now is as it was."""
    output.mkdir(parents=True, exist_ok=True)
    summary = output / "summary.json"
    known = load_results(summary) | results
    ordered = {name: known[name] for name in BENCHMARKS if name in known}
    content = {name: asdict(result) for name, result in ordered.items()}
    summary.write_text(json.dumps(content, indent=2) + "\n")
    (docs / "performance.md").write_text(page(ordered, docs / "images"))


def check(names: Sequence[str], scale: float) -> int:
    """Return 1 and say so if a ratio is worse than accepted in each of several runs."""

    def run_all(wanted: Sequence[str]) -> dict[str, dict[str, float]]:
        return ratios_of({name: measure(name, scale, None, False).rows for name in wanted})

    accepted = load_accepted(ACCEPTED)
    found = still_worse(accepted, [name for name in names if name in accepted], run_all)
    for benchmark, rows in found.items():
        for name, text in rows.items():
            print(f"worse: {benchmark}: {name}: {text}")
    return 1 if found else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__)
    parser.add_argument("--only", action="append", choices=present(), help="may be repeated")
    parser.add_argument("--scale", type=float, help="1: the full run; 0.02: a few seconds")
    parser.add_argument("--long", action="store_true", help="the ten-minute runs too")
    parser.add_argument("--accept", action="store_true", help="accept the ratios of this run")
    parser.add_argument("--check", action="store_true", help="compare with the accepted ratios")
    parser.add_argument("--output", type=Path, default=ROOT / "out" / "bench")
    return parser.parse_args()


def main() -> int:
    """Run the command."""
    arguments = _arguments()
    os.environ.update(isolated_environment(free_domain()))
    names = arguments.only or present()
    if arguments.check:
        return check(names, arguments.scale or _CHECK_SCALE)
    scale = arguments.scale or 1.0
    # A short run proves nothing: it stays out of the documentation.
    docs = ROOT / "docs" if scale >= 1.0 else arguments.output
    results = {name: measure(name, scale, docs / "images", arguments.long) for name in names}
    write(results, arguments.output, docs)
    print(f"\nwritten: {arguments.output / 'summary.json'}, {docs / 'performance.md'}")
    if arguments.accept:
        accept(ACCEPTED, ratios_of({name: result.rows for name, result in results.items()}))
        print(f"accepted: {ACCEPTED}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
