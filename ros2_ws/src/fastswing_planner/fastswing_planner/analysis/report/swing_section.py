"""What the page tells of one swing."""

from collections.abc import Mapping
from dataclasses import dataclass

from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.motor_limits import (
    MotorLimits,
    beyond_tension,
    beyond_velocity,
    drawn_limits,
    limits_known,
)
from fastswing_planner.analysis.report.drawing_style import LineStyle
from fastswing_planner.analysis.report.swing_drawing import PANELS, panel_svg
from fastswing_planner.analysis.report.templating import data_url
from fastswing_planner.analysis.report.text import beyond_text, latency_cells

_METHODS = {
    "basic": "Basic",
    "inhibit": "Method 1, inhibit",
    "elongate": "Method 2, elongate",
    "hybrid": "Hybrid",
    "unplanned": "No plan",
}


def method_title(method: str) -> str:
    """Return a method's name as a heading."""
    return _METHODS.get(method, method)


@dataclass(frozen=True)
class Picture:
    """url: the picture itself; text: what it shows, in words."""

    url: str
    text: str


@dataclass(frozen=True)
class SwingSection:
    """A swing, the limits of its motors, and how joints and muscles are drawn on this page."""

    swing: MeasuredSwing
    limits: MotorLimits
    joint_styles: Mapping[str, LineStyle]
    muscle_styles: Mapping[str, LineStyle]

    @property
    def anchor(self) -> str:
        """What links to the section name."""
        return f"swing-{self.swing.source}{self.swing.namespace}-{self.swing.number}"

    @property
    def title(self) -> str:
        """The swing's method."""
        return method_title(self.swing.method)

    @property
    def notes(self) -> list[str]:
        """What a reader has to know before trusting the figures."""
        swing = self.swing
        notes = list(swing.notes)
        if swing.faulty:
            notes.append(f"faulty muscles: {', '.join(swing.faulty)}")
        if swing.rejected > 0:
            notes.append(f"the inhibitor rejected {swing.rejected:.0f} joint states")
        return notes

    @property
    def pictures(self) -> list[Picture]:
        """The panels; without muscle states that of the joints alone."""
        swing = self.swing
        shown = [name for name in PANELS if swing.muscles or name == "joint speed"]
        return [
            Picture(
                data_url("svg+xml", panel_svg(swing, name, self._styles(name), self.limits)),
                f"{name} over time, {self.title}, {swing.source} swing {swing.number}",
            )
            for name in shown
        ]

    def _styles(self, panel: str) -> Mapping[str, LineStyle]:
        return self.joint_styles if panel == "joint speed" else self.muscle_styles

    @property
    def beyond(self) -> str:
        """The muscles beyond a limit: 'none', or '–' if that is not known."""
        return beyond_text(self.swing, self.limits)

    @property
    def fast(self) -> tuple[str, ...]:
        """The muscles beyond their speed limit."""
        return beyond_velocity(self.swing, self.limits)

    @property
    def tight(self) -> tuple[str, ...]:
        """The muscles beyond the boards' tension limit."""
        return beyond_tension(self.swing, self.limits)

    @property
    def speed_verdict(self) -> str:
        """Whether all muscles kept their speed limits."""
        if self.fast:
            return f"▲ beyond the limit: {' '.join(self.fast)}"
        if limits_known(self.swing, self.limits):
            return "no muscle beyond its limit"
        return "not every speed and limit is known"

    @property
    def tension_verdict(self) -> str:
        """Whether the boards paid out."""
        return f"▲ the boards pay out: {' '.join(self.tight)}" if self.tight else "not predicted"

    @property
    def speed_limits(self) -> list[float]:
        """The speed limits in the picture [m/s]."""
        return drawn_limits(self.swing, self.limits, "velocity")

    @property
    def latencies(self) -> list[list[str]]:
        """A row for each latency, without the swing's number."""
        return [[title, *cells] for title, _, *cells in latency_cells(self.swing)]
