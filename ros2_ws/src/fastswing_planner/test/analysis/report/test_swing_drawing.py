"""What the panels of a swing show."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Rectangle

from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.measuring import measure_swings
from fastswing_planner.analysis.motor_limits import MotorLimit, beyond_tension, beyond_velocity
from fastswing_planner.analysis.recording import Recording
from fastswing_planner.analysis.report.drawing_style import joint_styles, muscle_styles
from fastswing_planner.analysis.report.svg import shortened
from fastswing_planner.analysis.report.swing_drawing import PANELS, panel_svg, save_swing

NAMES = ("#1", "#9", "#10")
LIMITS = dict.fromkeys(NAMES, MotorLimit(0.3, 200.0, 450.0))


@pytest.fixture(scope="module")
def swing(recorded: Callable[..., Recording]) -> MeasuredSwing:
    return measure_swings(recorded())[0]


def drawn(swing: MeasuredSwing, panel: str, labelled: bool = True) -> Axes:
    axes = Figure().subplots()
    styles = joint_styles([swing]) if panel == "joint speed" else muscle_styles([swing])
    PANELS[panel](axes, swing, styles, LIMITS, labelled)
    return axes


def levels(axes: Axes) -> set[float]:
    """Return the heights of the level lines across the whole panel."""
    heights = [np.asarray(line.get_ydata(), dtype=float) for line in axes.lines]
    return {float(one[0]) for one in heights if one.size == 2 and one[0] == one[1]}


def test_muscles_that_are_paid_out_are_solid_and_those_wound_in_dashed(
    swing: MeasuredSwing,
) -> None:
    styles = muscle_styles([swing])
    assert list(styles) == ["#9", "#10", "#1"]
    assert [style.dashes == "-" for style in styles.values()] == [True, True, False]


def test_every_style_has_a_colour_of_its_own(swing: MeasuredSwing) -> None:
    styles = muscle_styles([swing])
    assert len({style.colour for style in styles.values()}) == len(styles)


def test_a_joint_that_hardly_moves_is_not_singled_out(swing: MeasuredSwing) -> None:
    assert list(joint_styles([swing])) == ["E-p"]


def test_the_speed_limit_is_drawn_both_ways(swing: MeasuredSwing) -> None:
    assert {-0.3, 0.3} <= levels(drawn(swing, "muscle speed"))


def test_a_tension_limit_is_drawn_only_if_tensions_come_near(swing: MeasuredSwing) -> None:
    # The largest tension is 170 N.
    assert levels(drawn(swing, "muscle tension")) >= {200.0}
    assert 450.0 not in levels(drawn(swing, "muscle tension"))


@pytest.mark.parametrize("panel", PANELS)
def test_inhibition_is_shaded(swing: MeasuredSwing, panel: str) -> None:
    (one,) = swing.inhibited
    (shade,) = drawn(swing, panel).patches
    assert isinstance(shade, Rectangle)
    assert (shade.get_x(), shade.get_x() + shade.get_width()) == pytest.approx((one.start, one.end))


@pytest.mark.parametrize(
    ("panel", "names"),
    [
        ("joint speed", {"E-p"}),
        ("muscle speed", {"#1", "#9", "#10"}),
        ("muscle tension", {"#1", "#9", "#10"}),
    ],
)
def test_lines_are_named_at_their_peaks(swing: MeasuredSwing, panel: str, names: set[str]) -> None:
    assert {text.get_text() for text in drawn(swing, panel).texts} == names
    assert not drawn(swing, panel, labelled=False).texts


def test_labels_stay_within_the_panel(swing: MeasuredSwing) -> None:
    for panel in PANELS:
        for text in drawn(swing, panel).texts:
            assert all(0.0 <= share <= 1.0 for share in text.get_position())


def test_a_panel_is_the_same_each_time(swing: MeasuredSwing) -> None:
    panels = [panel_svg(swing, "joint speed", joint_styles([swing]), LIMITS) for _ in range(2)]
    assert panels[0] == panels[1]
    assert panels[0].lstrip().startswith(b"<?xml")


def test_paths_are_shortened_and_nothing_else() -> None:
    picture = b'<g transform="scale(0.015625)"><path id="a" d="M 1.23456 -0.98765 L 3 4.5"/></g>'
    assert shortened(picture) == (
        b'<g transform="scale(0.015625)"><path id="a" d="M 1.23 -0.98 L 3 4.5"/></g>'
    )


def test_a_swing_without_muscle_states_can_be_drawn(
    recorded: Callable[..., Recording], tmp_path: Path
) -> None:
    (swing,) = measure_swings(recorded(muscles=None, plans=()))
    path = tmp_path / "swing.png"
    save_swing(path, swing, joint_styles([swing]), muscle_styles([swing]), {}, "title")
    assert imread(path)[..., :3].std() > 0.05


def test_beyond_a_limit_is_beyond_its_tolerance(swing: MeasuredSwing) -> None:
    peak = max(muscle.peak_speed for muscle in swing.muscles)
    just = dict.fromkeys(NAMES, MotorLimit(peak / 1.005, 200.0, 450.0))
    clearly = dict.fromkeys(NAMES, MotorLimit(peak / 1.02, 200.0, 450.0))
    assert beyond_velocity(swing, just) == ()
    assert beyond_velocity(swing, clearly) == ("#9",)
    assert beyond_velocity(swing, {}) == ()


def test_beyond_the_boards_tension_is_named(swing: MeasuredSwing) -> None:
    low = dict.fromkeys(NAMES, MotorLimit(0.3, 100.0, 160.0))
    assert beyond_tension(swing, low) == ("#1",)
    assert np.isclose(swing.muscles[0].peak_tension, 170.0, rtol=1e-3)
