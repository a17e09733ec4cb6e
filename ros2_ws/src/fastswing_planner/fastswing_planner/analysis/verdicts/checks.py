"""Pass or fail: the figures of swings and topics against a file of limits."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.analysis.measured_swing import MeasuredSwing, swing_label
from fastswing_planner.analysis.timing import TopicTiming
from fastswing_planner.errors import PlannerError

_TOPIC_FIGURES = {
    "rate": ("rate", "Hz"),
    "longest_pause": ("longest pause", "s"),
    "gaps": ("gaps", ""),
    "dropped": ("dropped messages", ""),
}
_NAMED = {
    "joints": ("joint", "rad/s"),
    "muscle_speeds": ("muscle", "m/s"),
    "tensions": ("muscle", "N"),
}
_SECTIONS = ("swings", "each_swing", "methods", "topics")


class LimitsFileError(PlannerError, ValueError):
    """A file of limits that cannot be used; the text names file, key and choices."""

    code_name = "INVALID_REQUEST"


@dataclass(frozen=True)
class Bounds:
    """At least `least` and at most `most`; infinite: no bound."""

    least: float = -np.inf
    most: float = np.inf

    def allows(self, value: float) -> bool:
        """Return whether a value is within; NaN never is."""
        return self.least <= value <= self.most

    def __str__(self) -> str:
        """As printed: 'at least 1', 'at most 2', '1 to 2'."""
        if self.least == -np.inf:
            return f"at most {self.most:g}"
        if self.most == np.inf:
            return f"at least {self.least:g}"
        if self.least == self.most:
            return f"exactly {self.least:g}"
        return f"{self.least:g} to {self.most:g}"


@dataclass(frozen=True)
class SwingLimits:
    """What every swing, or every swing of one method, has to keep.

    figures  by name, see FIGURES
    named    'joints', 'muscle_speeds' or 'tensions' -> joint or muscle -> bounds
    """

    figures: Mapping[str, Bounds]
    named: Mapping[str, Mapping[str, Bounds]]


@dataclass(frozen=True)
class Limits:
    """A file of limits.

    swings      how many swings there must be, in all bags together
    each_swing  of every swing
    methods     further limits of the swings of one method
    topics      topic -> figure -> bounds
    """

    swings: Bounds
    each_swing: SwingLimits
    methods: Mapping[str, SwingLimits]
    topics: Mapping[str, Mapping[str, Bounds]]


@dataclass(frozen=True)
class CheckResult:
    """violations: one line each; checked: how many limits were tried."""

    violations: tuple[str, ...]
    checked: int

    @property
    def passed(self) -> bool:
        """Whether nothing was violated, and anything was tried at all."""
        return not self.violations and self.checked > 0


class _UniqueKeys(yaml.SafeLoader):
    """Refuses a key that stands twice: plain YAML forgets the first one."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return a mapping; raises LimitsFileError."""
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    line = key.start_mark.line + 1
                    raise LimitsFileError(
                        f"line {line}: key '{key.value}' stands there a second time"
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep)


def read_limits(path: Path) -> Limits:
    """Read a file of limits; raises LimitsFileError."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise LimitsFileError(f"{path}: cannot be read: {error}") from error
    try:
        return parse_limits(yaml.load(text, Loader=_UniqueKeys))
    except yaml.YAMLError as error:
        raise LimitsFileError(f"{path}: not YAML: {' '.join(str(error).split())}") from error
    except LimitsFileError as error:
        raise LimitsFileError(f"{path}: {error}") from error


def parse_limits(content: Any) -> Limits:
    """Return the limits of a file's content; raises LimitsFileError naming key and choices."""
    sections = _mapping("the file", content, _SECTIONS)
    if not sections:
        raise LimitsFileError(f"no limits; choose from: {', '.join(_SECTIONS)}")
    swings = sections.get("swings")
    return Limits(
        Bounds() if swings is None else _bounds("swings", swings),
        _swing_limits("each_swing", sections.get("each_swing") or {}),
        {
            str(method): _swing_limits(f"methods: {method}", limits)
            for method, limits in _mapping("methods", sections.get("methods") or {}).items()
        },
        {
            str(topic): {
                figure: _bounds(f"{topic}: {figure}", bounds)
                for figure, bounds in _mapping(f"topics: {topic}", limits, _TOPIC_FIGURES).items()
            }
            for topic, limits in _mapping("topics", sections.get("topics") or {}).items()
        },
    )


def _mapping(
    what: str, content: Any, keys: Sequence[str] | Mapping[str, Any] = ()
) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise LimitsFileError(f"{what} is {content!r}, expected a mapping")
    for key in content:
        if keys and key not in keys:
            raise LimitsFileError(f"{what}: unknown key '{key}', choose from: {', '.join(keys)}")
    return content


def _swing_limits(what: str, content: Any) -> SwingLimits:
    entries = _mapping(what, content, (*FIGURES, *_NAMED))
    return SwingLimits(
        {
            name: _bounds(f"{what}: {name}", bounds)
            for name, bounds in entries.items()
            if name in FIGURES
        },
        {
            kind: {
                str(name): _bounds(f"{what}: {kind}: {name}", bounds)
                for name, bounds in _mapping(f"{what}: {kind}", entries[kind]).items()
            }
            for kind in _NAMED
            if kind in entries
        },
    )


def _bounds(what: str, content: Any) -> Bounds:
    """Return {min, max}, either may be missing; a plain number means exactly this."""
    if _is_number(content):
        return Bounds(float(content), float(content))
    if not isinstance(content, dict) or not content:
        raise LimitsFileError(f"{what} is {content!r}, expected a number, or min, max or both")
    entries = _mapping(what, content, ("min", "max"))
    for key, value in entries.items():
        if not _is_number(value):
            raise LimitsFileError(f"{what}: {key} is {value!r}, expected a number")
    bounds = Bounds(float(entries.get("min", -np.inf)), float(entries.get("max", np.inf)))
    if bounds.least > bounds.most:
        raise LimitsFileError(f"{what}: min {bounds.least:g} is above max {bounds.most:g}")
    return bounds


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and np.isfinite(value)


def check(
    limits: Limits,
    swings: Sequence[MeasuredSwing],
    topics: Mapping[str, Sequence[TopicTiming]],
    joints: Sequence[str] = (),
    muscles: Sequence[str] = (),
) -> CheckResult:
    """Try every limit.

    topics           bag -> the timing of its topics
    joints, muscles  their names in all bags, for limits that no swing is there to be tried on
    """
    lines: list[str] = []
    tried = 0
    if limits.swings != Bounds():
        tried += 1
        if not limits.swings.allows(len(swings)):
            lines.append(f"{len(swings)} swings, {limits.swings} allowed")
    for swing in swings:
        for part in (limits.each_swing, limits.methods.get(swing.method)):
            if part is not None:
                count, found = _check_swing(part, swing)
                tried += count
                lines += found
    if not swings:
        count, found = _check_without_swings(limits, {"joint": joints, "muscle": muscles})
        tried += count
        lines += found
    for method in limits.methods:
        if method not in {swing.method for swing in swings}:
            tried += 1
            lines.append(f"no swing by method '{method}': its limits could not be tried")
    count, found = _check_topics(limits, topics)
    return CheckResult((*lines, *found), tried + count)


def _check_without_swings(
    limits: Limits, names: Mapping[str, Sequence[str]]
) -> tuple[int, list[str]]:
    """Say what of `each_swing` could not be tried; only `swings` can allow that there is none."""
    each = limits.each_swing
    if not each.figures and not each.named:
        return 0, []
    lines = []
    if limits.swings == Bounds() or not limits.swings.allows(0.0):
        lines.append("no swing: the limits of each_swing could not be tried")
    for kind, entries in each.named.items():
        what, _ = _NAMED[kind]
        known = names[what]
        lines += [
            _unknown(what, name, known, "the bags hold") for name in entries if name not in known
        ]
    return 1, lines


def _unknown(what: str, name: str, known: Iterable[str], holder: str) -> str:
    return f"unknown {what} '{name}', {holder}: {', '.join(known) or 'none'}"


def _check_swing(limits: SwingLimits, swing: MeasuredSwing) -> tuple[int, list[str]]:
    label = swing_label(swing)
    tried = 0
    lines = []
    for name, bounds in limits.figures.items():
        figure = FIGURES[name]
        tried += 1
        value = figure.of(swing)
        if not bounds.allows(value):
            lines.append(f"{label}: {_told(figure.title, value, figure.unit, bounds)}")
    for kind, entries in limits.named.items():
        what, unit = _NAMED[kind]
        values = _named_values(kind, swing)
        for name, bounds in entries.items():
            tried += 1
            if name not in values:
                lines.append(f"{label}: {_unknown(what, name, values, 'the bag holds')}")
            elif not bounds.allows(values[name]):
                title = "largest tension" if kind == "tensions" else "peak speed"
                lines.append(f"{label}: {_told(f'{title} of {name}', values[name], unit, bounds)}")
    return tried, lines


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


def _check_topics(
    limits: Limits, topics: Mapping[str, Sequence[TopicTiming]]
) -> tuple[int, list[str]]:
    tried = 0
    lines = []
    for source, timings in topics.items():
        for topic, entries in limits.topics.items():
            matching = [one for one in timings if topic in (one.name, one.name.rpartition("/")[2])]
            if not matching:
                tried += 1
                held = ", ".join(one.name for one in timings) or "none"
                lines.append(f"{source}: no topic '{topic}', the bag holds: {held}")
            for timing in matching:
                for name, bounds in entries.items():
                    tried += 1
                    title, unit = _TOPIC_FIGURES[name]
                    value = _topic_value(name, timing)
                    if not bounds.allows(value):
                        lines.append(f"{source} {timing.name}: {_told(title, value, unit, bounds)}")
    return tried, lines


def _topic_value(name: str, timing: TopicTiming) -> float:
    if name == "gaps":
        return float(len(timing.gaps)) if timing.steady else np.nan
    if name == "dropped":
        return np.nan if timing.dropped is None else float(timing.dropped)
    return timing.rate if name == "rate" else timing.longest
