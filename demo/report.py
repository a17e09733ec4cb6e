"""The results of the demo: a table for the terminal, and one page with table and picture."""

import base64
import html
import math
from collections.abc import Mapping
from pathlib import Path
from string import Template
from typing import Any

from swing_picture import TITLES, draw_swing

__all__ = ["draw_swing", "table_text", "write_report"]

_SPEED = "peak_elbow_pitch_velocity_rad_s"
_TIME = "time_cost_s"
_TENSION = "max_tension_n"
_MUSCLE = "max_muscle_velocity_m_s"

# (heading, sub-heading, kind, figure, decimals)
_COLUMNS = (
    ("peak E-p speed [rad/s]", "predicted", "predicted", _SPEED, 2),
    ("peak E-p speed [rad/s]", "measured", "measured", _SPEED, 2),
    ("time [s]", "predicted", "predicted", _TIME, 2),
    ("time [s]", "measured", "measured", _TIME, 2),
    ("muscle speed", "[m/s]", "measured", _MUSCLE, 2),
    ("tension", "[N]", "measured", _TENSION, 0),
)
_WIDTHS = (12, 13, 13, 13, 13, 11)
_NOTE = (
    "In brackets: the paper; its simulation beside predicted, its robot beside measured.\n"
    "Muscle speed and tension: the largest measured."
)


def _number(value: Any, decimals: int) -> str:
    """Return a figure as text; '-' for None, NaN and what was not printed."""
    if value is None or not math.isfinite(value):
        return "-"
    return f"{value:.{decimals}f}"


def _figure(methods: Mapping[str, Any], method: str, kind: str, name: str) -> Any:
    return methods.get(method, {}).get(kind, {}).get(name)


def _paper_number(value: float | None, name: str) -> str:
    """Return a figure with the digits that the paper prints; empty if it prints none."""
    if value is None:
        return ""
    return _number(value, {_SPEED: 1, _TIME: 2, _TENSION: 0}.get(name, 2))


def _cells(summary: Mapping[str, Any], method: str) -> list[tuple[str, str]]:
    """Return (ours, the paper's) for each column."""
    paper = summary.get("paper", {})
    return [
        (
            _number(_figure(summary["methods"], method, kind, name), decimals),
            _paper_number(_figure(paper, method, kind, name), name),
        )
        for _, _, kind, name, decimals in _COLUMNS
    ]


def _masked(summary: Mapping[str, Any], method: str) -> str:
    return " ".join(summary["methods"].get(method, {}).get("masked_muscles", ())) or "none"


def table_text(summary: Mapping[str, Any]) -> str:
    """Return the table for a terminal of 110 columns, without a line feed at the end."""
    lines = [_heading_text(), _text_row("", [column[1] for column in _COLUMNS], "muscles masked")]
    lines.append("-" * max(len(line) for line in lines))
    for method, title in TITLES.items():
        cells = [f"{ours} ({paper})" if paper else ours for ours, paper in _cells(summary, method)]
        lines.append(_text_row(title, cells, _masked(summary, method)))
    return "\n".join([*lines, "", _NOTE])


def _text_row(title: str, cells: list[str], masked: str) -> str:
    middle = "".join(f"{cell:<{width}}" for cell, width in zip(cells, _WIDTHS, strict=True))
    return f"{title:<10}{middle}{masked}".rstrip()


def _heading_text() -> str:
    """Return the first line of the headings, each above its first column."""
    line, seen = " " * 10, ""
    for (heading, *_), width in zip(_COLUMNS, _WIDTHS, strict=True):
        begin = len(line) if heading != seen else None
        line = line + " " * width
        if begin is not None:
            line = f"{line[:begin]}{heading}".ljust(len(line))
        seen = heading
    return line.rstrip()


def write_report(summary: Mapping[str, Any], picture: Path, output: Path) -> None:
    """Write one page with table and picture that needs no other file."""
    rows = "\n".join(_html_row(summary, method) for method in TITLES)
    image = base64.b64encode(picture.read_bytes()).decode()
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text(_PAGE.substitute(rows=rows, image=image), encoding="utf-8")


def _html_row(summary: Mapping[str, Any], method: str) -> str:
    cells = "".join(
        f"<td>{html.escape(ours)}{f'<small>{html.escape(paper)}</small>' if paper else ''}</td>"
        for ours, paper in _cells(summary, method)
    )
    masked = html.escape(_masked(summary, method))
    return f"<tr><th scope=row>{html.escape(TITLES[method])}</th>{cells}<td>{masked}</td></tr>"


_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>fastswing: three swings</title>
<style>
body { font: 16px/1.5 system-ui, sans-serif; color: #1a1a1a; background: #fff;
       max-width: 75rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; margin: 0.5rem 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { padding: 0.4rem 0.7rem; border-bottom: 1px solid #ddd; text-align: left;
         white-space: nowrap; vertical-align: top; }
thead th { border-bottom: 0; padding-bottom: 0; }
thead tr:last-child th { border-bottom: 2px solid #444; font-weight: normal; padding-top: 0; }
td small { color: #666; margin-left: 0.5em; }
td small::before { content: "paper "; }
img { width: 100%; min-width: 45rem; height: auto; }
@media print { body { max-width: none; padding: 0; font-size: 11px; }
  .wide { overflow: visible; } img { min-width: 0; } figure, table { break-inside: avoid; }
  @page { size: landscape; margin: 12mm; } }
</style>
</head>
<body>
<h1>One arm, three swings</h1>
<p>A tendon-driven arm swings down as fast as its muscles allow. With <b>Basic</b>, the muscles
that are pulled by the motion cannot pay out faster than their motors turn, and hold the arm back.
<b>Method 1</b> switches the current of those muscles off while the arm swings, so that they are
back-driven. <b>Method 2</b> pays one of them out before the swing.</p>
<div class="wide">
<table>
<thead>
<tr><th></th><th colspan="2">peak E-p speed [rad/s]</th><th colspan="2">time [s]</th>
<th>muscle speed [m/s]</th><th>tension [N]</th><th>muscles masked</th></tr>
<tr><th></th><th>predicted</th><th>measured</th><th>predicted</th><th>measured</th>
<th>largest measured</th><th>largest measured</th><th></th></tr>
</thead>
<tbody>
$rows
</tbody>
</table>
</div>
<p>E-p is the elbow's pitch. Predicted: by the planner, before the swing. Measured: while it ran,
from the topics in the bag of each swing. Beside each number stands what the paper prints: its
simulation for predicted, its robot for measured. Masked muscles are those that Method 1 inhibits
and Method 2 elongates.</p>
<figure class="wide" style="margin: 1rem 0">
<img alt="Joint speed, muscle speed and muscle tension over time, for the three methods"
 src="data:image/png;base64,$image">
<figcaption>Time 0 is the swing command, the dotted upright line the arrival. Dotted steps: joint
speed of the plan; short dashes: muscles wound in; long dashes: the motors' speed limit, and
the largest tension that a plan asks for; shaded: muscles inhibited.</figcaption>
</figure>
</body>
</html>
""")
