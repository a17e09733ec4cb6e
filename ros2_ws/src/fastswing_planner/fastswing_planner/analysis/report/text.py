"""What was found, as text for a terminal."""

from collections.abc import Sequence

import numpy as np

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.analysis.findings import BagFindings
from fastswing_planner.analysis.latency import Latency
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.motor_limits import (
    MotorLimits,
    beyond_tension,
    beyond_velocity,
    limits_known,
)
from fastswing_planner.analysis.report.results import Results
from fastswing_planner.analysis.timing import TopicTiming
from fastswing_planner.analysis.verdicts.checks import CheckResult
from fastswing_planner.analysis.verdicts.comparison import Comparison, Difference, Spread
from fastswing_planner.command_line import text_table

SWING_HEAD = (
    "swing",
    "method",
    "at [s]",
    "peak joint speed [rad/s]",
    "time [s]",
    "muscle speed [m/s]",
    "beyond limit",
    "tension [N]",
    "masked",
)
LATENCY_TITLES = {
    "state_to_override": "joint state to override",
    "override_to_zero": "override to zero current",
    "state_to_zero": "joint state to zero current",
}
TOPIC_HEAD = ("topic", "messages", "rate [Hz]", "longest pause [ms]", "gaps", "missing", "dropped")


def results_text(results: Results) -> str:
    """Return everything that was found."""
    parts = [findings_text(results.findings, results.limits)]
    if results.comparison is not None:
        parts.append(comparison_text(results.comparison))
    if results.check is not None:
        parts.append(check_text(results.check))
    return "\n\n".join(parts)


def findings_text(findings: Sequence[BagFindings], limits: MotorLimits) -> str:
    """Return tables of swings, latencies and topics of each bag."""
    return "\n\n".join(_bag_text(one, limits) for one in findings)


def _bag_text(findings: BagFindings, limits: MotorLimits) -> str:
    parts = [findings.source]
    parts += [f"  {line}" for line in findings.lines]
    if findings.swings:
        rows = [swing_cells(swing, limits) for swing in findings.swings]
        parts += ["", text_table(SWING_HEAD, rows), "", "measured (predicted)"]
        parts += [f"  swing {one.number}: {note}" for one in findings.swings for note in one.notes]
        parts += [
            f"  swing {one.number}: faulty muscles: {', '.join(one.faulty)}"
            for one in findings.swings
            if one.faulty
        ]
        latencies = [row for swing in findings.swings for row in latency_cells(swing)]
        if latencies:
            head = ("latency", "swing", "count", "median [ms]", "99% [ms]", "longest [ms]")
            parts += ["", text_table(head, latencies)]
    if findings.topics:
        parts += ["", text_table(TOPIC_HEAD, [topic_cells(topic) for topic in findings.topics])]
    told = counter_lines(findings)
    if told:
        parts += ["", "counted by the nodes while it was recorded:", *told]
    return "\n".join(parts)


def swing_cells(swing: MeasuredSwing, limits: MotorLimits) -> list[str]:
    """Return a swing's row below SWING_HEAD."""
    joint, muscle, tight = swing.main_joint, swing.fastest_muscle, swing.tightest_muscle
    return [
        str(swing.number),
        swing.method,
        f"{swing.start:.2f}",
        f"{beside(joint.peak_speed, joint.predicted_peak_speed)} {joint.name}",
        beside(swing.arrival, swing.predicted_time),
        "–" if muscle is None else f"{muscle.peak_speed:.2f} {muscle.name}",
        beyond_text(swing, limits),
        "–" if tight is None else f"{tight.peak_tension:.0f} {tight.name}",
        " ".join(swing.plan.masked) or "none" if swing.plan is not None else "–",
    ]


def beyond_text(swing: MeasuredSwing, limits: MotorLimits) -> str:
    """Return the muscles that exceeded their speed limit, or pulled beyond the boards' limit.

    '–' if none did as far as is known, and not everything is.
    """
    fast, tight = beyond_velocity(swing, limits), beyond_tension(swing, limits)
    parts = [" ".join(fast)] if fast else []
    if tight:
        parts.append(f"tension {' '.join(tight)}")
    return ", ".join(parts) or ("none" if limits_known(swing, limits) else "–")


def beside(measured: float, predicted: float) -> str:
    """Return 'measured (predicted)' with two decimals; '–' for what is unknown."""
    text = "–" if np.isnan(measured) else f"{measured:.2f}"
    return text if np.isnan(predicted) else f"{text} ({predicted:.2f})"


def latency_cells(swing: MeasuredSwing) -> list[list[str]]:
    """Return a row for each latency that was measured in a swing."""
    rows = []
    for name, title in LATENCY_TITLES.items():
        latency: Latency = getattr(swing.latency, name)
        if latency.values.size or latency.missing or latency.unusable:
            count = str(latency.values.size)
            if latency.missing:
                count += f", {latency.missing} never"
            if latency.unusable:
                count += f", {latency.unusable} before their state"
            figures = (latency.median, latency.p99, latency.longest)
            rows.append([title, str(swing.number), count, *(_milliseconds(one) for one in figures)])
    return rows


def _milliseconds(seconds: float) -> str:
    return "–" if np.isnan(seconds) else f"{1e3 * seconds:.2f}"


def topic_cells(topic: TopicTiming) -> list[str]:
    """Return a topic's row below TOPIC_HEAD."""
    return [
        topic.name + (f" (clock back {topic.jumps} times)" if topic.jumps else ""),
        str(topic.count),
        "–" if np.isnan(topic.rate) else f"{topic.rate:.1f}",
        _milliseconds(topic.longest) if topic.steady else "–",
        str(len(topic.gaps)) if topic.steady else "–",
        str(topic.missing) if topic.steady else "–",
        "–" if topic.dropped is None else str(topic.dropped),
    ]


def counter_lines(findings: BagFindings) -> list[str]:
    """Return what the nodes rejected or lost, a line for each node."""
    return [
        f"  {node}: " + ", ".join(f"{name} {count}" for name, count in counts.items())
        for node, counts in findings.counters.items()
        if counts
    ]


_P_VALUE = "p: exact rank-sum test, adjusted for all figures of the method (Holm)"


def counted(figure: str, part: Spread) -> str:
    """Return how many swings a figure of one group is of, and of how many if not of all."""
    if part.count == part.total:
        return str(part.count)
    return f"{part.count} of {part.total} {'arrived' if figure == 'time' else 'known'}"


def comparison_text(comparison: Comparison) -> str:
    """Return a comparison of two groups as a table."""
    head = ("method", "figure", *comparison.names, "change", "p", "verdict")
    rows = [comparison_cells(one) for one in comparison.differences]
    return f"{text_table(head, rows)}\n\nmedian (quartiles), number of swings; {_P_VALUE}"


def comparison_cells(difference: Difference) -> list[str]:
    """Return a row: method, figure, both groups, change of the median, p-value, verdict."""
    figure = FIGURES[difference.figure]
    groups = []
    for one in (difference.first, difference.second):
        quartiles = f"{figure.text(one.low)} to {figure.text(one.high)}"
        groups.append(f"{figure.text(one.median)} ({quartiles}), {counted(difference.figure, one)}")
    return [
        difference.method,
        figure_title(difference),
        *groups,
        change_text(difference),
        "–" if np.isnan(difference.p_value) else f"{difference.p_value:.3f}",
        difference.verdict,
    ]


def figure_title(difference: Difference) -> str:
    """Return what is compared, with its unit."""
    figure = FIGURES[difference.figure]
    return f"{figure.title} [{figure.unit}]" if figure.unit else figure.title


def change_text(difference: Difference) -> str:
    """Return the change of the median with its sign; '–' if it is unknown."""
    change = difference.change
    return "–" if np.isnan(change) else f"{change:+.{FIGURES[difference.figure].decimals}f}"


def check_text(result: CheckResult) -> str:
    """Return one line for each violation, and the verdict."""
    lines = [f"FAIL {line}" for line in result.violations]
    if result.passed:
        lines.append(f"PASS: {result.checked} limits kept")
    elif not result.checked:
        lines.append("FAIL no swing and no topic to check")
    return "\n".join(lines)
