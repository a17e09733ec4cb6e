"""Whatever happened to bridge, cable and boards before: an emergency stop takes the current."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import Mode, StateFrame, WatchdogAction
from musashi_muscle_bridge.control.command_limits import command_limits
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.emulation.boards import Boards

PERIOD = 0.002
TIMEOUT = 0.1

times = st.sampled_from([0.004, 0.06, 0.12, 0.25, 0.4])
"""[s] around those after which boards and bridge act."""
cuts = st.sampled_from(["sound", "deaf", "mute", "stalled"])
actions = st.sampled_from(
    ["nothing", "clear", "hold", "length", "tension", "current", "override", "restart"]
)
happenings = st.lists(st.tuples(actions, cuts, times), max_size=6)


class Rig:
    """The hoist's bridge and boards, and what can be done to them."""

    def __init__(self, robot: Robot, action: WatchdogAction) -> None:
        self.robot, self.action = robot, action
        self.boards = Boards(robot)
        self.now = 10.0
        self.restart()
        self.run("sound", 0.05)

    def restart(self) -> None:
        """Put a new bridge in place of one that was killed; the boards' watchdog acts."""
        limits = command_limits(self.robot, 0.1, 0.2, 0.2)
        self.control = ControlPeriod(self.robot, limits, self.action, TIMEOUT)
        self.state: StateFrame | None = None
        self.run("stalled", TIMEOUT + 5 * PERIOD)

    def run(self, cut: str, duration: float) -> None:
        """Let time pass: `stalled` sends nothing, `deaf` boards hear, `mute` ones tell nothing."""
        for _ in range(round(duration / PERIOD)):
            self.now += PERIOD
            self.boards.advance(PERIOD)
            if cut == "stalled":
                continue
            (command,) = self.control.next_commands([self.state], self.now)
            if cut == "deaf":
                continue
            state = self.boards.handle(command)
            if cut != "mute":
                self.state = state

    def do(self, what: str) -> None:
        arbiter, now = self.control.arbiter, self.now
        if what == "clear":
            self.control.clear_faults(now)
        elif what == "hold":
            arbiter.hold(now=now)
        elif what == "length":
            arbiter.command(Mode.LENGTH, [0, 1], np.array([1.2, 0.9]), now)
        elif what == "tension":
            arbiter.command(Mode.TENSION, [0], np.array([30.0]), now)
        elif what == "current":
            arbiter.command(Mode.CURRENT, [1], np.array([2.0]), now)
        elif what == "override":
            arbiter.override([0], 0.1, now)
        elif what == "restart":
            self.restart()


@settings(max_examples=40, deadline=None)
@given(
    action=st.sampled_from(WatchdogAction),
    before=happenings,
    cut=st.sampled_from(["sound", "mute"]),
    after=happenings,
)
def test_an_emergency_stop_is_obeyed_by_boards_that_hear_it_and_stays(
    hoist: Robot,
    action: WatchdogAction,
    before: list[tuple[str, str, float]],
    cut: str,
    after: list[tuple[str, str, float]],
) -> None:
    rig = Rig(hoist, action)
    for what, line, duration in before:
        rig.do(what)
        rig.run(line, duration)
    rig.control.arbiter.emergency_stop()
    rig.run(cut, TIMEOUT)
    assert rig.boards.mode.tolist() == [Mode.ZERO_CURRENT] * 2
    for what, line, duration in after:
        if what not in ("clear", "restart"):
            rig.do(what)
            rig.run(line, duration)
            assert rig.boards.mode.tolist() == [Mode.ZERO_CURRENT] * 2
