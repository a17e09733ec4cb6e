"""One page with everything that was found: no other file, no network, no script."""

import base64
import html
import time
from collections.abc import Mapping, Sequence
from string import Template

import numpy as np

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.analysis.findings import BagFindings
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.motor_limits import (
    MotorLimits,
    beyond_tension,
    beyond_velocity,
    drawn_limits,
    limits_known,
)
from fastswing_planner.analysis.report.drawing_style import LineStyle, joint_styles, muscle_styles
from fastswing_planner.analysis.report.page_style import CSS
from fastswing_planner.analysis.report.swing_drawing import PANELS, panel_svg
from fastswing_planner.analysis.report.text import (
    LATENCY_TITLES,
    TOPIC_HEAD,
    beyond_text,
    counted,
    counter_lines,
    latency_cells,
    topic_cells,
)
from fastswing_planner.analysis.verdicts.checks import CheckResult
from fastswing_planner.analysis.verdicts.comparison import Difference, Spread

CONTENTS_FROM = 3
"""A page with at least so many swings has a table of contents."""

_METHODS = {
    "basic": "Basic",
    "inhibit": "Method 1, inhibit",
    "elongate": "Method 2, elongate",
    "hybrid": "Hybrid",
    "unplanned": "No plan",
}


def page(
    findings: Sequence[BagFindings],
    limits: MotorLimits,
    result: CheckResult | None = None,
    comparison: tuple[Sequence[Difference], Mapping[str, bytes]] | None = None,
    groups: tuple[str, str] = ("A", "B"),
) -> str:
    """Return the page.

    result      of a check against limits
    comparison  differences and pictures (title -> SVG) of two groups named `groups`
    """
    swings = [swing for one in findings for swing in one.swings]
    styles = (joint_styles(swings), muscle_styles(swings))
    title = _title(findings) if comparison is None else f"{groups[0]} beside {groups[1]}"
    body = [_head(title, findings, swings)]
    if result is not None:
        body.append(_check(result))
    if comparison is not None:
        body.append(_comparison(*comparison, groups))
    if swings:
        body.append(_overview(findings, limits))
    for one in findings:
        body += [_swing(swing, styles, limits) for swing in one.swings]
    body += [_bag(one) for one in findings]
    body.append(_words(swings))
    return _PAGE.substitute(title=_text(title), style=CSS, body="\n".join(body))


def _text(value: object) -> str:
    return html.escape(str(value))


def _title(findings: Sequence[BagFindings]) -> str:
    names = ", ".join(one.source for one in findings[:3])
    return names + (f" and {len(findings) - 3} more" if len(findings) > 3 else "")


def _head(title: str, findings: Sequence[BagFindings], swings: Sequence[MeasuredSwing]) -> str:
    count = f"{len(swings)} swing{'' if len(swings) == 1 else 's'}"
    began = [one.began_ns for one in findings if one.began_ns]
    when = f" · recorded {_date(min(began))}" if began else ""
    bags = f"{len(findings)} bags · " if len(findings) > 1 else ""
    lines = [(one.source, line) for one in findings for line in one.lines]
    notes = "".join(f"<li><b>{_text(source)}</b> {_text(line)}</li>" for source, line in lines)
    return (
        f'<header><p class="kind">Swing analysis</p><h1>{_text(title)}</h1>'
        f"<p>{bags}{count}{when}</p></header>"
        + (f'<ul class="notes">{notes}</ul>' if notes else "")
    )


def _date(began_ns: int) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(began_ns / 1e9))


def _check(result: CheckResult) -> str:
    if result.passed:
        return (
            '<section class="verdict good" id="check"><h2>✓ Within limits</h2>'
            f"<p>All {result.checked} limits of the file were kept.</p></section>"
        )
    lines = "".join(f"<li>{_text(line)}</li>" for line in result.violations)
    what = f"{len(result.violations)} of {result.checked} limits were not kept."
    return (
        '<section class="verdict bad" id="check"><h2>✗ Beyond limits</h2>'
        f"<p>{what}</p><ul>{lines}</ul></section>"
    )


def _anchor(swing: MeasuredSwing) -> str:
    return html.escape(f"swing-{swing.source}{swing.namespace}-{swing.number}", quote=True)


def _swing_name(swing: MeasuredSwing) -> str:
    return _METHODS.get(swing.method, swing.method)


def _overview(findings: Sequence[BagFindings], limits: MotorLimits) -> str:
    """Return one row for each swing; with several swings it is the table of contents."""
    swings = [swing for one in findings for swing in one.swings]
    linked = len(swings) >= CONTENTS_FROM
    rows = []
    for swing in swings:
        name = f"{_text(swing.source)} <small>{swing.number}</small>"
        if linked:
            name = f'<a href="#{_anchor(swing)}">{name}</a>'
        name += f"<br><small>{_text(_swing_name(swing))}</small>"
        joint, muscle, tight = swing.main_joint, swing.fastest_muscle, swing.tightest_muscle
        cells = [
            _pair(swing.arrival, swing.predicted_time),
            _of(_pair(joint.peak_speed, joint.predicted_peak_speed), joint.name),
            "–" if muscle is None else _of(f"{muscle.peak_speed:.2f}", muscle.name),
            _beyond(swing, limits),
            "–" if tight is None else _of(f"{tight.peak_tension:.0f}", tight.name),
        ]
        rows.append(_row([name, *cells]))
    head = (
        "swing",
        "time [s]",
        "joint speed [rad/s]",
        "muscle speed [m/s]",
        "beyond limits",
        "tension [N]",
    )
    title = "Contents" if linked else "Summary"
    tag = "nav" if linked else "section"
    return (
        f'<{tag} id="contents"><h2>{title}</h2>{_wide_table(head, rows)}'
        f'<p class="small">Peaks, measured and <i>predicted</i> by the plan in the bag.</p></{tag}>'
    )


def _wide_table(head: Sequence[str], rows: Sequence[str]) -> str:
    cells = "".join(f"<th scope=col>{_text(title)}</th>" for title in head)
    return (
        f'<div class="wide" tabindex="0"><table><thead><tr>{cells}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _of(value: str, name: str) -> str:
    return f"{value} <small>{_text(name)}</small>"


def _row(cells: Sequence[str]) -> str:
    first, *others = cells
    return f"<tr><th scope=row>{first}</th>{''.join(f'<td>{cell}</td>' for cell in others)}</tr>"


def _pair(measured: float, predicted: float) -> str:
    text = "–" if np.isnan(measured) else f"{measured:.2f}"
    return text if np.isnan(predicted) else f"{text} <i>{predicted:.2f}</i>"


def _beyond(swing: MeasuredSwing, limits: MotorLimits) -> str:
    text = beyond_text(swing, limits)
    if text in ("–", "none"):
        return text
    return f'<span class="mark">▲ {_text(text)}</span>'


def _swing(
    swing: MeasuredSwing,
    styles: tuple[Mapping[str, LineStyle], Mapping[str, LineStyle]],
    limits: MotorLimits,
) -> str:
    joints, muscles = styles
    shown = [name for name in PANELS if swing.muscles or name == "joint speed"]
    pictures = "".join(
        _picture(
            panel_svg(swing, name, joints if name == "joint speed" else muscles, limits),
            f"{name} over time, {_swing_name(swing)}, {swing.source} swing {swing.number}",
        )
        for name in shown
    )
    notes = "".join(f"<li>{_text(note)}</li>" for note in _notes(swing))
    return (
        f'<section class="swing" id="{_anchor(swing)}">'
        f"<h2>{_text(_swing_name(swing))} "
        f"<small>{_text(swing.source)}{_text(swing.namespace)}, swing {swing.number}</small></h2>"
        f'<p class="small">{_facts(swing)}</p>'
        + (f'<ul class="notes">{notes}</ul>' if notes else "")
        + _tiles(swing, limits)
        + f'<div class="pictures">{pictures}</div>{_key(swing, limits)}'
        + f'<div class="tables">{_joint_table(swing)}{_muscle_table(swing, limits)}</div>'
        + _latency_table([swing])
        + "</section>"
    )


def _facts(swing: MeasuredSwing) -> str:
    facts = [f"Begins {swing.start:.2f} s into the recording"]
    if swing.plan is not None:
        masked = " ".join(swing.plan.masked) or "none"
        facts.append(f"muscles masked: {masked}")
    if swing.ended:
        facts.append(f"the inhibitor disarmed: {swing.ended}")
    return _text(" · ".join(facts))


def _notes(swing: MeasuredSwing) -> list[str]:
    notes = list(swing.notes)
    if swing.faulty:
        notes.append(f"faulty muscles: {', '.join(swing.faulty)}")
    if swing.rejected > 0:
        notes.append(f"the inhibitor rejected {swing.rejected:.0f} joint states")
    return notes


def _tiles(swing: MeasuredSwing, limits: MotorLimits) -> str:
    joint, muscle, tight = swing.main_joint, swing.fastest_muscle, swing.tightest_muscle
    tiles = [
        _tile(
            f"peak speed of {joint.name}",
            f"{joint.peak_speed:.2f}",
            "rad/s",
            _predicted(joint.predicted_peak_speed, "rad/s"),
        ),
        _tile(
            "time to the end posture",
            "–" if np.isnan(swing.arrival) else f"{swing.arrival:.2f}",
            "" if np.isnan(swing.arrival) else "s",
            _predicted(swing.predicted_time, "s"),
        ),
    ]
    if muscle is not None:
        fast = beyond_velocity(swing, limits)
        if fast:
            verdict = f"▲ beyond the limit: {' '.join(fast)}"
        elif limits_known(swing, limits):
            verdict = "no muscle beyond its limit"
        else:
            verdict = "not every speed and limit is known"
        tiles.append(
            _tile(
                f"largest muscle speed, {muscle.name}",
                f"{muscle.peak_speed:.2f}",
                "m/s",
                verdict,
            )
        )
    if tight is not None:
        over = beyond_tension(swing, limits)
        note = f"▲ the boards pay out: {' '.join(over)}" if over else "not predicted"
        tiles.append(
            _tile(f"largest tension, {tight.name}", f"{tight.peak_tension:.0f}", "N", note)
        )
    return f'<div class="tiles">{"".join(tiles)}</div>'


def _tile(title: str, value: str, unit: str, note: str) -> str:
    return (
        f'<div class="tile"><span>{_text(title)}</span><b>{_text(value)} <small>{unit}</small></b>'
        f"<span>{_text(note)}</span></div>"
    )


def _predicted(value: float, unit: str) -> str:
    return "not predicted" if np.isnan(value) else f"predicted {value:.2f} {unit}"


def _picture(picture: bytes, text: str) -> str:
    source = base64.b64encode(picture).decode()
    alternative = html.escape(text, quote=True)
    return (
        f'<figure><img alt="{alternative}" width="461" height="336" '
        f'src="data:image/svg+xml;base64,{source}"></figure>'
    )


def _key(swing: MeasuredSwing, limits: MotorLimits) -> str:
    """Return what the lines mean, so that each picture stays free for its lines."""
    parts = ["grey lines: the slower ones"]
    if swing.plan is not None:
        parts.insert(0, "dotted steps: the plan")
    if swing.muscles:
        parts.append("solid: paid out, short dashes: wound in")
    if drawn_limits(swing, limits, "velocity"):
        parts.append("long dashes: limits")
    if swing.inhibited:
        parts.append('<span class="shade">shaded</span>: muscles inhibited')
    parts.append("upright lines: begin" + ("" if np.isnan(swing.arrival) else " and arrival"))
    return f'<p class="small">{"; ".join(parts)}.</p>'


def _joint_table(swing: MeasuredSwing) -> str:
    rows = [
        _row(
            [
                _text(joint.name),
                _decimal(joint.peak_speed, 2),
                _decimal(joint.predicted_peak_speed, 2),
            ]
        )
        for joint in swing.joints
    ]
    return _wide_table(("joint", "peak [rad/s]", "predicted"), rows)


def _muscle_table(swing: MeasuredSwing, limits: MotorLimits) -> str:
    if not swing.muscles:
        return ""
    fast, tight = beyond_velocity(swing, limits), beyond_tension(swing, limits)
    columns: dict[str, list[str]] = {
        "muscle": [_text(muscle.name) for muscle in swing.muscles],
        "peak [m/s]": [
            _marked(_decimal(muscle.peak_speed, 2), muscle.name in fast) for muscle in swing.muscles
        ],
        "predicted": [_decimal(muscle.predicted_peak_speed, 2) for muscle in swing.muscles],
        "limit": [
            f"{limits[muscle.name].velocity:.2f}" if muscle.name in limits else "–"
            for muscle in swing.muscles
        ],
        "tension [N]": [
            _marked(_decimal(muscle.peak_tension, 0), muscle.name in tight)
            for muscle in swing.muscles
        ],
        "inhibited [s]": [
            f"{muscle.inhibited:.2f}" if muscle.inhibited else "" for muscle in swing.muscles
        ],
        "paid out [mm]": [
            f"{1e3 * muscle.elongation:.0f}" if muscle.elongation else ""
            for muscle in swing.muscles
        ],
    }
    told = {title: cells for title, cells in columns.items() if any(cells)}
    return _wide_table(tuple(told), [_row(cells) for cells in zip(*told.values(), strict=True)])


def _decimal(value: float, decimals: int) -> str:
    return "–" if np.isnan(value) else f"{value:.{decimals}f}"


def _marked(text: str, marked: bool) -> str:
    return f'<span class="mark">▲ {text}</span>' if marked else text


def _latency_table(swings: Sequence[MeasuredSwing]) -> str:
    cells = [(row[0], *row[2:]) for swing in swings for row in latency_cells(swing)]
    if not cells:
        return ""
    head = ("latency", "count", "median [ms]", "99% [ms]", "longest [ms]")
    return _wide_table(head, [_row([_text(cell) for cell in row]) for row in cells])


def _comparison(
    differences: Sequence[Difference], pictures: Mapping[str, bytes], groups: tuple[str, str]
) -> str:
    rows = []
    for one in differences:
        figure = FIGURES[one.figure]
        spreads = [
            f"{figure.text(part.median)} <small>{figure.text(part.low)} to "
            f"{figure.text(part.high)}, {_swings(one.figure, part)}</small>"
            for part in (one.first, one.second)
        ]
        change = "–" if np.isnan(one.change) else f"{one.change:+.{figure.decimals}f}"
        p_value = "–" if np.isnan(one.p_value) else f"{one.p_value:.3f}"
        verdict = _text(one.verdict)
        if one.verdict == "different":
            verdict = f"<b>≠ {verdict}</b>"
        title = f"{figure.title} [{figure.unit}]" if figure.unit else figure.title
        rows.append(
            _row([_text(_METHODS.get(one.method, one.method)), _text(title), *spreads])[:-5]
            + f"<td>{change}</td><td>{p_value}</td><td>{verdict}</td></tr>"
        )
    head = ("method", "figure", f"A: {groups[0]}", f"B: {groups[1]}", "B − A", "p", "verdict")
    shown = "".join(_picture(picture, title) for title, picture in pictures.items())
    return (
        '<section id="comparison"><h2>Comparison</h2>'
        f'<p><span class="first">━ A</span> {_text(groups[0])} · '
        f'<span class="second">╍ B</span> {_text(groups[1])}</p>'
        f'<div class="pictures">{shown}</div>{_wide_table(head, rows)}'
        '<p class="small">Medians with their quartiles. p: exact rank-sum test, the chance of a '
        "difference at least as clear if nothing differed, adjusted for all figures of the method "
        "(Holm); below 0.05 it counts.</p></section>"
    )


def _swings(figure: str, part: Spread) -> str:
    number = counted(figure, part)
    return f"{number} swings" if part.count == part.total else number


def _bag(findings: BagFindings) -> str:
    if not findings.topics:
        return ""
    rows = [_row([_text(cell) for cell in topic_cells(topic)]) for topic in findings.topics]
    gaps = [
        f"{_text(topic.name)}: {1e3 * gap.length:.1f} ms at {gap.start:.2f} s"
        for topic in findings.topics
        for gap in topic.gaps[:3]
    ]
    told = [line.strip() for line in counter_lines(findings)]
    lists = ""
    for title, lines in (("Longest gaps", gaps), ("Counted by the nodes", map(_text, told))):
        items = "".join(f"<li>{line}</li>" for line in lines)
        lists += f"<h3>{title}</h3><ul>{items}</ul>" if items else ""
    return (
        f'<section class="bag"><h2>Topics <small>{_text(findings.source)}</small></h2>'
        f"{_wide_table(TOPIC_HEAD, rows)}{lists}</section>"
    )


def _words(swings: Sequence[MeasuredSwing]) -> str:
    tolerance = swings[0].tolerance if swings else 0.1
    latencies = ", ".join(LATENCY_TITLES.values())
    return (
        '<section class="small"><h2>What the words mean</h2><p>'
        "Time: from the swing's length command to the first joint state within "
        f"{tolerance:g} rad (norm) of the end posture; a prediction ends nearer, within its "
        "epsilon, so compare repeated swings rather than the two. Predicted: from the plan in the "
        "bag, kinematics and speed ramps only; it knows no dynamic tension. Peaks: between command "
        "and rest. Muscle speed: longer is positive. Beyond limits: faster than 1.01 times the "
        f"muscle's speed limit, or above the boards' tension limit. Latencies ({latencies}) are "
        "known to one period of the states. A gap is a pause of more than three periods; missing: "
        "messages that would fill the gaps; dropped: numbers missing in the publisher's count.</p>"
        "</section>"
    )


_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="icon" href="data:,">
<title>$title – swing analysis</title>
<style>
$style</style>
</head>
<body>
<main>
$body
</main>
</body>
</html>
""")
