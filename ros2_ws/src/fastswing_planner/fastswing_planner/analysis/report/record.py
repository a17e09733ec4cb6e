"""What was found, as plain numbers, texts, lists and dictionaries; null for what is unknown."""

import json
import math
from dataclasses import asdict
from typing import Any

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.analysis.findings import BagFindings
from fastswing_planner.analysis.latency import InhibitionLatency, Latency
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.motor_limits import (
    MotorLimits,
    beyond_tension,
    beyond_velocity,
    limits_known,
)
from fastswing_planner.analysis.report.results import Results
from fastswing_planner.analysis.timing import TopicTiming
from fastswing_planner.analysis.verdicts.comparison import Difference


def json_text(results: Results) -> str:
    """Return the record as JSON, which has no word for NaN: unknown is null."""
    return json.dumps(results_record(results), indent=2, allow_nan=False)


def results_record(results: Results) -> dict[str, Any]:
    """Return everything that was found; units stand in FIGURES and in docs/bags.md."""
    record: dict[str, Any] = {"bags": [_bag(one, results.limits) for one in results.findings]}
    check, comparison = results.check, results.comparison
    if check is not None:
        record["check"] = {
            "passed": check.passed,
            "checked": check.checked,
            "violations": list(check.violations),
        }
    if comparison is not None and comparison.differences:
        record["comparison"] = [_difference(one) for one in comparison.differences]
    return record


def _bag(findings: BagFindings, limits: MotorLimits) -> dict[str, Any]:
    return {
        "bag": findings.source,
        "began_ns": findings.began_ns,
        "lines": list(findings.lines),
        "swings": [_swing(swing, limits) for swing in findings.swings],
        "topics": [_topic(topic) for topic in findings.topics],
        "counters": {node: dict(counts) for node, counts in findings.counters.items()},
    }


def _swing(swing: MeasuredSwing, limits: MotorLimits) -> dict[str, Any]:
    none: list[str] | None = [] if limits_known(swing, limits) else None
    return {
        "number": swing.number,
        "namespace": swing.namespace,
        "method": swing.method,
        "start": swing.start,
        "commanded": swing.commanded,
        "figures": {name: _number(figure.of(swing)) for name, figure in FIGURES.items()},
        "joints": {
            joint.name: {
                "peak_speed": _number(joint.peak_speed),
                "predicted_peak_speed": _number(joint.predicted_peak_speed),
            }
            for joint in swing.joints
        },
        "muscles": {
            muscle.name: {
                "peak_speed": _number(muscle.peak_speed),
                "predicted_peak_speed": _number(muscle.predicted_peak_speed),
                "peak_tension": _number(muscle.peak_tension),
                "inhibited": muscle.inhibited,
                "elongation": _number(muscle.elongation),
                "masked": muscle.masked,
            }
            for muscle in swing.muscles
        },
        "beyond_velocity_limit": list(beyond_velocity(swing, limits)) or none,
        "beyond_tension_limit": list(beyond_tension(swing, limits)) or none,
        "inhibited": [
            {"start": one.start, "end": one.end, "muscles": list(one.muscles)}
            for one in swing.inhibited
        ],
        "latency": _latencies(swing.latency),
        "inhibitor_ended": swing.ended,
        "faulty": list(swing.faulty),
        "notes": list(swing.notes),
    }


def _latencies(latency: InhibitionLatency) -> dict[str, Any]:
    return {
        "state_to_override": _latency(latency.state_to_override),
        "override_to_zero": _latency(latency.override_to_zero),
        "state_to_zero": _latency(latency.state_to_zero),
    }


def _latency(latency: Latency) -> dict[str, Any]:
    return {
        "count": int(latency.values.size),
        "median": _number(latency.median),
        "p99": _number(latency.p99),
        "longest": _number(latency.longest),
        "missing": latency.missing,
        "unusable": latency.unusable,
    }


def _topic(topic: TopicTiming) -> dict[str, Any]:
    gaps = [{"start": gap.start, "length": gap.length} for gap in topic.gaps]
    return {
        "name": topic.name,
        "type": topic.type_name,
        "count": topic.count,
        "rate": _number(topic.rate),
        "longest_pause": _number(topic.longest),
        "gaps": gaps if topic.steady else None,
        "missing": topic.missing if topic.steady else None,
        "dropped": topic.dropped,
        "clock_jumps": topic.jumps,
    }


def _difference(difference: Difference) -> dict[str, Any]:
    return {
        "method": difference.method,
        "figure": difference.figure,
        "first": {name: _number(value) for name, value in asdict(difference.first).items()},
        "second": {name: _number(value) for name, value in asdict(difference.second).items()},
        "change": _number(difference.change),
        "p_value": _number(difference.p_value),
        "verdict": difference.verdict,
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
