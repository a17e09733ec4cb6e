"""The results of the demo: a table for the terminal, and one page with table and picture."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swing_picture import TITLES

from fastswing_planner.analysis.report.templating import data_url, page_templates

_SPEED = "peak_elbow_pitch_velocity_rad_s"
_TIME = "time_cost_s"
_TENSION = "max_tension_n"
_MUSCLE = "max_muscle_velocity_m_s"


@dataclass(frozen=True)
class _Column:
    """A figure of the summary: two headings, where it stands there, and how it is printed."""

    heading: str
    subheading: str
    kind: str
    figure: str
    decimals: int
    width: int


_COLUMNS = (
    _Column("peak E-p speed [rad/s]", "predicted", "predicted", _SPEED, 2, 12),
    _Column("peak E-p speed [rad/s]", "measured", "measured", _SPEED, 2, 13),
    _Column("time [s]", "predicted", "predicted", _TIME, 2, 13),
    _Column("time [s]", "measured", "measured", _TIME, 2, 13),
    _Column("muscle speed", "[m/s]", "measured", _MUSCLE, 2, 13),
    _Column("tension", "[N]", "measured", _TENSION, 0, 11),
)
_NOTE = (
    "In brackets: the paper; its simulation beside predicted, its robot beside measured.\n"
    "Muscle speed and tension: the largest measured."
)


@dataclass(frozen=True)
class _Figure:
    """As printed: ours, and the paper's, which is empty if it prints none."""

    ours: str
    paper: str


@dataclass(frozen=True)
class _Row:
    """A method of the page's table."""

    title: str
    figures: list[_Figure]
    masked: str


def _number(value: Any, decimals: int) -> str:
    """Return a figure as text; '-' for None, NaN and what was not printed."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.{decimals}f}"


def _value(methods: Mapping[str, Any], method: str, column: _Column) -> Any:
    return methods.get(method, {}).get(column.kind, {}).get(column.figure)


def _paper_number(value: float | None, name: str) -> str:
    """Return a figure with the digits that the paper prints; empty if it prints none."""
    if value is None:
        return ""
    return _number(value, {_SPEED: 1, _TIME: 2, _TENSION: 0}.get(name, 2))


def _figures(summary: Mapping[str, Any], method: str) -> list[_Figure]:
    paper = summary.get("paper", {})
    return [
        _Figure(
            _number(_value(summary["methods"], method, column), column.decimals),
            _paper_number(_value(paper, method, column), column.figure),
        )
        for column in _COLUMNS
    ]


def _masked(summary: Mapping[str, Any], method: str) -> str:
    return " ".join(summary["methods"].get(method, {}).get("masked_muscles", ())) or "none"


def table_text(summary: Mapping[str, Any]) -> str:
    """Return the table for a terminal of 110 columns, without a line feed at the end."""
    lines = [
        _heading_text(),
        _text_row("", [column.subheading for column in _COLUMNS], "muscles masked"),
    ]
    lines.append("-" * max(len(line) for line in lines))
    for method, title in TITLES.items():
        figures = _figures(summary, method)
        cells = [f"{one.ours} ({one.paper})" if one.paper else one.ours for one in figures]
        lines.append(_text_row(title, cells, _masked(summary, method)))
    return "\n".join([*lines, "", _NOTE])


def _text_row(title: str, cells: list[str], masked: str) -> str:
    columns = zip(cells, _COLUMNS, strict=True)
    middle = "".join(f"{cell:<{column.width}}" for cell, column in columns)
    return f"{title:<10}{middle}{masked}".rstrip()


def _heading_text() -> str:
    """Return the first line of the headings, each above its first column."""
    line, seen = " " * 10, ""
    for column in _COLUMNS:
        begin = len(line) if column.heading != seen else None
        line = line + " " * column.width
        if begin is not None:
            line = f"{line[:begin]}{column.heading}".ljust(len(line))
        seen = column.heading
    return line.rstrip()


def write_report(summary: Mapping[str, Any], picture: Path, output: Path) -> None:
    """Write one page with table and picture that needs no other file."""
    template = page_templates(Path(__file__).parent).get_template("report.html")
    rows = [
        _Row(title, _figures(summary, method), _masked(summary, method))
        for method, title in TITLES.items()
    ]
    page = template.render(rows=rows, picture=data_url("png", picture.read_bytes()))
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(page, encoding="utf-8")
