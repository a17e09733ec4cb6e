"""One pull tells which way round a muscle is wired."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from musashi_muscle_bridge.calibration import (
    MuscleReading,
    Pull,
    PullSettings,
    Verdict,
    length_offsets,
)

SETTINGS = PullSettings()
PERIOD = 0.002
LIMIT = 6.0


class Wired:
    """A muscle against a spring, whose signs may be wrong; 50 N/A and 10 N/mm."""

    def __init__(self, motor: int = 1, length: int = 1, tension: int = 1) -> None:
        self.motor, self.length, self.tension = motor, length, tension
        self.force = 20.0
        self.follows = True
        self.fault = False
        self.stiffness = 10_000.0

    def reading(self, time: float, current: float) -> MuscleReading:
        pull = 50.0 * current * self.motor
        shorter = (pull - 20.0 * self.motor) / self.stiffness
        return MuscleReading(
            time,
            0.3 - self.length * shorter,
            self.tension * pull,
            current,
            self.follows,
            self.fault,
        )


def pulled(muscle: Wired, settings: PullSettings = SETTINGS) -> tuple[Pull, list[float]]:
    """Return the finished pull and the currents it commanded."""
    before = muscle.reading(0.0, 0.4)
    pull = Pull(settings, before, LIMIT)
    currents: list[float] = []
    time, current = 0.0, pull.step(before)
    while current is not None:
        currents.append(current)
        time += PERIOD
        current = pull.step(muscle.reading(time, current))
    return pull, currents


@pytest.mark.parametrize(
    ("muscle", "verdict"),
    [
        (Wired(), Verdict.SOUND),
        (Wired(length=-1), Verdict.LENGTH_SIGN),
        (Wired(tension=-1), Verdict.TENSION_SIGN),
        (Wired(motor=-1), Verdict.MOTOR_SIGN),
        (Wired(tension=0), Verdict.NO_TENSION),
        (Wired(motor=0), Verdict.UNCLEAR),
    ],
    ids=lambda value: value.name if isinstance(value, Verdict) else "",
)
def test_each_wrong_sign_is_named(muscle: Wired, verdict: Verdict) -> None:
    assert pulled(muscle)[0].verdict is verdict


def test_a_board_that_never_follows_is_no_sign_error() -> None:
    muscle = Wired()
    muscle.follows = False
    assert pulled(muscle)[0].verdict is Verdict.NOT_FOLLOWED


def test_a_pull_that_somebody_ends_is_no_sign_error() -> None:
    muscle = Wired()
    before = muscle.reading(0.0, 0.4)
    pull = Pull(SETTINGS, before, LIMIT)
    pull.step(muscle.reading(0.5, 0.5))
    muscle.follows = False  # as under an emergency stop, where the wire pays out
    assert pull.step(muscle.reading(0.502, -5.0)) is None
    assert pull.verdict is Verdict.INTERRUPTED


def test_a_fault_ends_the_pull_at_once() -> None:
    muscle = Wired()
    muscle.fault = True
    pull, currents = pulled(muscle)
    assert (pull.verdict, currents) == (Verdict.FAULT, [])


def test_a_wire_that_runs_away_ends_the_pull_early() -> None:
    muscle = Wired()
    muscle.stiffness = 100.0
    pull, currents = pulled(muscle)
    assert pull.shortening < SETTINGS.most_travel + 0.002
    assert len(currents) * PERIOD < SETTINGS.ramp_time


def test_a_pull_begins_with_the_current_the_muscle_has() -> None:
    assert pulled(Wired())[1][0] == 0.4


@given(step=st.floats(0.01, 2.0), before=st.floats(-2.0, 6.0))
def test_the_current_only_grows_and_never_exceeds_step_or_limit(step: float, before: float) -> None:
    settings = PullSettings(current_step=step)
    first = MuscleReading(0.0, 0.3, 20.0, before, True, False)
    pull = Pull(settings, first, LIMIT)
    times = np.linspace(0.0, settings.ramp_time + settings.hold_time, 100)
    steps = [pull.step(MuscleReading(t, 0.3, 20.0, before, True, False)) for t in times]
    currents = [current for current in steps if current is not None]
    assert len(currents) == len(steps)
    assert all(later >= current for current, later in pairwise(currents))
    assert max(currents) <= min(max(before, 0.0) + step, LIMIT)
    assert min(currents) >= 0.0


def test_an_offset_makes_the_measured_length_the_models_stretch_left_out() -> None:
    path, stiffness, tension = np.array([0.3]), np.array([10_000.0]), np.array([20.0])
    wound = path - 0.002  # 20 N stretch it by 2 mm
    offset = length_offsets(path, wound + 0.05, tension, stiffness)
    assert offset == pytest.approx([-0.05])
