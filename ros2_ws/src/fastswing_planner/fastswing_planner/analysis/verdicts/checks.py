"""Pass or fail: the figures of swings and topics against criteria."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.analysis.measured_swing import MeasuredSwing, swing_label
from fastswing_planner.analysis.timing import TopicTiming
from fastswing_planner.analysis.verdicts.criteria import (
    NAMED,
    TOPIC_FIGURES,
    Bounds,
    Criteria,
    SwingCriteria,
)


@dataclass(frozen=True)
class CheckResult:
    """violations: one line each; checked: how many limits were tried."""

    violations: tuple[str, ...]
    checked: int

    @property
    def passed(self) -> bool:
        """Whether nothing was violated, and anything was tried at all."""
        return not self.violations and self.checked > 0

    def __add__(self, other: "CheckResult") -> "CheckResult":
        """Return both together."""
        return CheckResult((*self.violations, *other.violations), self.checked + other.checked)


def check(
    criteria: Criteria,
    swings: Sequence[MeasuredSwing],
    topics: Mapping[str, Sequence[TopicTiming]],
    joints: Sequence[str] = (),
    muscles: Sequence[str] = (),
) -> CheckResult:
    """Try every criterion.

    topics           bag -> the timing of its topics
    joints, muscles  their names in all bags, for criteria that no swing is there to be tried on
    """
    methods = {swing.method for swing in swings}
    result = _check_count(criteria.swings, len(swings))
    for swing in swings:
        for part in (criteria.each_swing, criteria.methods.get(swing.method)):
            if part is not None:
                result += _check_swing(part, swing)
    if not swings:
        result += _check_without_swings(criteria, {"joint": joints, "muscle": muscles})
    for method in criteria.methods:
        if method not in methods:
            line = f"no swing by method '{method}': its limits could not be tried"
            result += CheckResult((line,), 1)
    return result + _check_topics(criteria, topics)


def _check_count(bounds: Bounds, count: int) -> CheckResult:
    if bounds == Bounds():
        return CheckResult((), 0)
    return CheckResult(() if bounds.allows(count) else (f"{count} swings, {bounds} allowed",), 1)


def _check_without_swings(criteria: Criteria, names: Mapping[str, Sequence[str]]) -> CheckResult:
    """Say what of `each_swing` could not be tried; only `swings` can allow that there is none."""
    each = criteria.each_swing
    if not each.figures and not each.named:
        return CheckResult((), 0)
    lines = []
    if criteria.swings == Bounds() or not criteria.swings.allows(0.0):
        lines.append("no swing: the limits of each_swing could not be tried")
    for kind, entries in each.named.items():
        what, _ = NAMED[kind]
        known = names[what]
        lines += [
            _unknown(what, name, known, "the bags hold") for name in entries if name not in known
        ]
    return CheckResult(tuple(lines), 1)


def _unknown(what: str, name: str, known: Iterable[str], holder: str) -> str:
    return f"unknown {what} '{name}', {holder}: {', '.join(known) or 'none'}"


def _check_swing(criteria: SwingCriteria, swing: MeasuredSwing) -> CheckResult:
    label = swing_label(swing)
    tried = 0
    lines = []
    for name, bounds in criteria.figures.items():
        figure = FIGURES[name]
        tried += 1
        value = figure.of(swing)
        if not bounds.allows(value):
            lines.append(f"{label}: {_told(figure.title, value, figure.unit, bounds)}")
    for kind, entries in criteria.named.items():
        what, unit = NAMED[kind]
        values = _named_values(kind, swing)
        for name, bounds in entries.items():
            tried += 1
            if name not in values:
                lines.append(f"{label}: {_unknown(what, name, values, 'the bag holds')}")
            elif not bounds.allows(values[name]):
                title = "largest tension" if kind == "tensions" else "peak speed"
                lines.append(f"{label}: {_told(f'{title} of {name}', values[name], unit, bounds)}")
    return CheckResult(tuple(lines), tried)


def _named_values(kind: str, swing: MeasuredSwing) -> dict[str, float]:
    if kind == "joints":
        return {joint.name: joint.peak_speed for joint in swing.joints}
    figure = "peak_tension" if kind == "tensions" else "peak_speed"
    return {muscle.name: float(getattr(muscle, figure)) for muscle in swing.muscles}


def _told(title: str, value: float, unit: str, bounds: Bounds) -> str:
    if np.isnan(value):
        return f"{title} is unknown, {bounds} {unit} allowed".replace("  ", " ")
    return f"{title} is {value:.4g} {unit}, {bounds} {unit} allowed".replace("  ", " ").replace(
        " ,", ","
    )


def _check_topics(criteria: Criteria, topics: Mapping[str, Sequence[TopicTiming]]) -> CheckResult:
    tried = 0
    lines = []
    for source, timings in topics.items():
        for topic, entries in criteria.topics.items():
            matching = [one for one in timings if topic in (one.name, one.name.rpartition("/")[2])]
            if not matching:
                tried += 1
                held = ", ".join(one.name for one in timings) or "none"
                lines.append(f"{source}: no topic '{topic}', the bag holds: {held}")
            for timing in matching:
                for name, bounds in entries.items():
                    tried += 1
                    title, unit = TOPIC_FIGURES[name]
                    value = _topic_value(name, timing)
                    if not bounds.allows(value):
                        lines.append(f"{source} {timing.name}: {_told(title, value, unit, bounds)}")
    return CheckResult(tuple(lines), tried)


def _topic_value(name: str, timing: TopicTiming) -> float:
    if name == "gaps":
        return float(len(timing.gaps)) if timing.steady else np.nan
    if name == "dropped":
        return np.nan if timing.dropped is None else float(timing.dropped)
    return timing.rate if name == "rate" else timing.longest
