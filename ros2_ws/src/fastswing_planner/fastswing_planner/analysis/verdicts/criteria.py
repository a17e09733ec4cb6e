"""What recordings are checked against: the file that `analyse --check` calls limits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.errors import PlannerError

TOPIC_FIGURES = {
    "rate": ("rate", "Hz"),
    "longest_pause": ("longest pause", "s"),
    "gaps": ("gaps", ""),
    "dropped": ("dropped messages", ""),
}
NAMED = {
    "joints": ("joint", "rad/s"),
    "muscle_speeds": ("muscle", "m/s"),
    "tensions": ("muscle", "N"),
}
_SECTIONS = ("swings", "each_swing", "methods", "topics")


class CriteriaError(PlannerError, ValueError):
    """Criteria that cannot be used; the text names file, key and choices."""

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
class SwingCriteria:
    """What every swing, or every swing of one method, has to keep.

    figures  by name, see FIGURES
    named    'joints', 'muscle_speeds' or 'tensions' -> joint or muscle -> bounds
    """

    figures: Mapping[str, Bounds]
    named: Mapping[str, Mapping[str, Bounds]]


@dataclass(frozen=True)
class Criteria:
    """What a file asks for.

    swings      how many swings there must be, in all bags together
    each_swing  of every swing
    methods     more for the swings of one method
    topics      topic -> figure -> bounds
    """

    swings: Bounds
    each_swing: SwingCriteria
    methods: Mapping[str, SwingCriteria]
    topics: Mapping[str, Mapping[str, Bounds]]


class _UniqueKeys(yaml.SafeLoader):
    """Refuses a key that stands twice: plain YAML forgets the first one."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return a mapping; raises CriteriaError."""
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in seen:
                    line = key.start_mark.line + 1
                    raise CriteriaError(
                        f"line {line}: key '{key.value}' stands there a second time"
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep)


def read_criteria(path: Path) -> Criteria:
    """Read a file of criteria; raises CriteriaError."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CriteriaError(f"{path}: cannot be read: {error}") from error
    try:
        return parse_criteria(yaml.load(text, Loader=_UniqueKeys))
    except yaml.YAMLError as error:
        raise CriteriaError(f"{path}: not YAML: {' '.join(str(error).split())}") from error
    except CriteriaError as error:
        raise CriteriaError(f"{path}: {error}") from error


def parse_criteria(content: Any) -> Criteria:
    """Return what a file's content asks for; raises CriteriaError naming key and choices."""
    sections = _mapping("the file", content, _SECTIONS)
    if not sections:
        raise CriteriaError(f"no limits; choose from: {', '.join(_SECTIONS)}")
    swings = sections.get("swings")
    return Criteria(
        Bounds() if swings is None else _bounds("swings", swings),
        _swing_criteria("each_swing", sections.get("each_swing") or {}),
        {
            str(method): _swing_criteria(f"methods: {method}", entries)
            for method, entries in _mapping("methods", sections.get("methods") or {}).items()
        },
        {
            str(topic): {
                figure: _bounds(f"{topic}: {figure}", bounds)
                for figure, bounds in _mapping(f"topics: {topic}", figures, TOPIC_FIGURES).items()
            }
            for topic, figures in _mapping("topics", sections.get("topics") or {}).items()
        },
    )


def _mapping(
    what: str, content: Any, keys: Sequence[str] | Mapping[str, Any] = ()
) -> dict[str, Any]:
    if not isinstance(content, dict):
        raise CriteriaError(f"{what} is {content!r}, expected a mapping")
    for key in content:
        if keys and key not in keys:
            raise CriteriaError(f"{what}: unknown key '{key}', choose from: {', '.join(keys)}")
    return content


def _swing_criteria(what: str, content: Any) -> SwingCriteria:
    entries = _mapping(what, content, (*FIGURES, *NAMED))
    return SwingCriteria(
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
            for kind in NAMED
            if kind in entries
        },
    )


def _bounds(what: str, content: Any) -> Bounds:
    """Return {min, max}, either may be missing; a plain number means exactly this."""
    if _is_number(content):
        return Bounds(float(content), float(content))
    if not isinstance(content, dict) or not content:
        raise CriteriaError(f"{what} is {content!r}, expected a number, or min, max or both")
    entries = _mapping(what, content, ("min", "max"))
    for key, value in entries.items():
        if not _is_number(value):
            raise CriteriaError(f"{what}: {key} is {value!r}, expected a number")
    bounds = Bounds(float(entries.get("min", -np.inf)), float(entries.get("max", np.inf)))
    if bounds.least > bounds.most:
        raise CriteriaError(f"{what}: min {bounds.least:g} is above max {bounds.most:g}")
    return bounds


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and np.isfinite(value)
