"""A current command neither breaks a taut wire nor lets a slack one run away."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import Mode, WatchdogAction
from musashi_muscle_bridge.control.arbiter import Setpoints
from musashi_muscle_bridge.control.command_limits import CommandLimits, command_limits
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.control.pull_limit import limited_pull, pulls
from musashi_muscle_bridge.emulation.boards import Boards

PERIOD = 0.002
TENSIONS = st.floats(0.0, 1e4)
VELOCITIES = st.floats(-10.0, 10.0)


@pytest.fixture(scope="module")
def limits(musashi: Robot) -> CommandLimits:
    return command_limits(musashi, stream_timeout=0.1, max_lease=0.2, payout_allowance=0.2)


def pull(limits: CommandLimits, tension: float, velocity: float, stale: bool = False) -> float:
    """Return the current [A] that is left of 6 A on the first muscle."""
    count = limits.tension_max.size
    asked = Setpoints(np.full(count, Mode.CURRENT, dtype=np.uint8), np.full(count, 6.0))
    measured = np.full(count, tension), np.full(count, velocity), np.full(count, stale)
    return float(limited_pull(asked, *measured, limits).value[0])


@given(tension=st.floats(0.0, 200.0), velocity=st.floats(-0.15, 10.0))
def test_a_muscle_within_the_plans_tension_and_half_the_speed_gets_all_its_current(
    limits: CommandLimits, tension: float, velocity: float
) -> None:
    assert pull(limits, tension, velocity) == 6.0


@given(tension=st.floats(450.0, 1e4), velocity=VELOCITIES)
def test_a_muscle_at_the_tension_limit_gets_none(
    limits: CommandLimits, tension: float, velocity: float
) -> None:
    assert pull(limits, tension, velocity) == 0.0


@given(tension=TENSIONS, velocity=st.floats(-10.0, -0.3))
def test_a_muscle_that_winds_in_at_the_speed_limit_gets_none(
    limits: CommandLimits, tension: float, velocity: float
) -> None:
    assert pull(limits, tension, velocity) == 0.0


@given(low=TENSIONS, high=TENSIONS, slow=VELOCITIES, fast=VELOCITIES)
def test_more_tension_and_faster_winding_never_get_more_current(
    limits: CommandLimits, low: float, high: float, slow: float, fast: float
) -> None:
    low, high = sorted((low, high))
    fast, slow = sorted((fast, slow))
    assert 0.0 <= pull(limits, high, fast) <= pull(limits, low, slow) <= 6.0


@given(bad=st.sampled_from([np.nan, np.inf]))
def test_what_is_not_measured_gets_no_current(limits: CommandLimits, bad: float) -> None:
    assert pull(limits, bad, 0.0) == 0.0
    assert pull(limits, 0.0, np.nan) == 0.0


@given(tension=TENSIONS, velocity=VELOCITIES)
def test_a_muscle_that_was_not_measured_lately_gets_none(
    limits: CommandLimits, tension: float, velocity: float
) -> None:
    assert pull(limits, tension, velocity, stale=True) == 0.0


def test_when_answers_stop_a_current_ends_after_five_more_frames(
    musashi: Robot, limits: CommandLimits
) -> None:
    control = ControlPeriod(musashi, limits, WatchdogAction.ZERO_CURRENT, 0.1)
    boards = Boards(musashi)
    state = boards.handle(control.first_command())
    currents = []
    for period in range(20):
        control.arbiter.command(Mode.CURRENT, [0], np.array([1.0]), period * PERIOD)
        currents.append(float(control.next_command(state, period * PERIOD).rows["setpoint"][0]))
    assert currents == [1.0] * 6 + [0.0] * 14


@given(mode=st.sampled_from([Mode.LENGTH, Mode.TENSION, Mode.ZERO_CURRENT]), tension=TENSIONS)
def test_other_modes_stay_as_they_are(limits: CommandLimits, mode: Mode, tension: float) -> None:
    count = limits.tension_max.size
    modes = np.full(count, mode, dtype=np.uint8)
    modes[0] = Mode.CURRENT
    asked = Setpoints(modes, np.full(count, 1.0))
    measured = np.full(count, tension), np.full(count, -1.0), np.zeros(count, dtype=bool)
    limited = limited_pull(asked, *measured, limits)
    assert limited.mode.tolist() == modes.tolist()
    assert limited.value[1:].tolist() == [1.0] * (count - 1)


@given(modes=st.lists(st.sampled_from(list(Mode)), min_size=1))
def test_who_follows_a_current_pulls(modes: list[Mode]) -> None:
    asked = Setpoints(np.array(modes, dtype=np.uint8), np.ones(len(modes)))
    assert pulls(asked) == (Mode.CURRENT in modes)


def highest_tension(robot: Robot, limits: CommandLimits, muscle: int, slack: float) -> float:
    """Return the largest tension [N] of all muscles under the largest current on one of them."""
    control = ControlPeriod(robot, limits, WatchdogAction.ZERO_CURRENT, 0.1)
    boards = Boards(robot)
    states = [boards.handle(control.first_command())] * 2
    highest = 0.0
    for period in range(600):
        now = period * PERIOD
        if period == 10 and slack:
            longer = boards.plant.length.copy()
            longer[muscle] += slack
            control.arbiter.command(Mode.LENGTH, slice(None), longer, now)
        if period >= 300:
            most = limits.current_max[[muscle]]
            control.arbiter.command(Mode.CURRENT, [muscle], most, now)
            highest = max(highest, float(boards.plant.tension.max()))
        # The state before the last one: a control loop's measurement is a period old.
        command = control.next_command(states[-2], now)
        boards.advance(PERIOD)
        states.append(boards.handle(command))
    return highest


@pytest.mark.parametrize("slack", [0.0, 0.02, 0.1], ids="{} m slack".format)
@pytest.mark.parametrize("muscle", range(10))
def test_the_largest_current_on_an_emulated_muscle_stays_below_the_tension_limit(
    musashi: Robot, limits: CommandLimits, muscle: int, slack: float
) -> None:
    assert 100.0 < highest_tension(musashi, limits, muscle, slack) < musashi.tension_limit[muscle]
