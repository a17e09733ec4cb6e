"""Writes docs/performance.md from the results of `make bench`."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rounds import Row

HEAD = """# Performance

Made by `make bench` (`test/bench/performance_page.py`). Do not edit it by hand.

Every figure stands beside a baseline that was measured in the same run, in turns (A B A B). The
ratio is the median over the rounds of the ratio to the baseline of the same round: it says more
than the times, which change with the machine and with what else it does. Times are of the wall
clock. `make bench-check` compares the ratios with `test/bench/accepted.json`. "Tuned" is with the
[real-time rights](on_the_robot.md#real-time-rights) that a robot PC should give.
"""


@dataclass(frozen=True)
class Result:
    """What a benchmark told.

    scale    1.0: the full benchmark
    date     on which it ran
    machine  see `machine.machine`
    """

    question: str
    rows: tuple[Row, ...]
    scale: float
    date: str
    machine: Mapping[str, str]


def table(rows: Iterable[Row]) -> list[str]:
    """Return rows as the lines of a Markdown table."""
    lines = [
        "| | median | p99 | max | | baseline | ratio | ratio of p99 | asked | met | |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for one in rows:
        cells = (
            one.name,
            number(one.median),
            number(one.p99),
            number(one.maximum),
            one.unit,
            one.baseline,
            number(one.ratio),
            number(one.ratio_p99),
            one.bound,
            {True: "yes", False: "**no**", None: ""}[one.met],
            one.note,
        )
        lines.append("| " + " | ".join(cells).replace("\n", " ") + " |")
    return lines


def number(value: float | None) -> str:
    """Return a number with three digits; empty for None."""
    if value is None or value != value:
        return ""
    return f"{value:,.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def page(results: Mapping[str, Result], pictures: Path) -> str:
    """Return the page.

    pictures  the folder of the pictures performance_*.png, as `images` beside the page
    """
    parts = [HEAD]
    for name, result in results.items():
        facts = ", ".join(f"{key} {value}" for key, value in result.machine.items())
        whole = "" if result.scale == 1.0 else f"; a run of {result.scale:g} of the usual length"
        parts.append(f"## {name.replace('_', ' ').capitalize()}\n\n{result.question}\n")
        parts.append("\n".join(table(result.rows)) + "\n")
        for picture in sorted(pictures.glob(f"performance_{name}*.png")):
            parts.append(f"![{result.question}](images/{picture.name})\n")
        parts.append(f"{result.date}{whole}: {facts}.\n")
    return "\n".join(parts)
