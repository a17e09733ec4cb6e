"""One control period of the bridge: state in, command out; without clock or I/O.

The bridge node runs it against a bus, the headless closed loop against emulated boards.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import BoolVector
from fastswing_planner.robot.board_groups import whole_robot
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import (
    JOINT_ROW,
    STATE_ROW,
    CommandFrame,
    Mode,
    StateFrame,
    WatchdogAction,
)
from musashi_muscle_bridge.control.arbiter import CommandArbiter, Setpoints
from musashi_muscle_bridge.control.board_group import GroupControl
from musashi_muscle_bridge.control.command_limits import CommandLimits
from musashi_muscle_bridge.control.pull_limit import limited_pull, pulls


def slack(state: StateFrame) -> BoolVector:
    """Return which boards follow a tension and measure none, shape (m,)."""
    followed = state.rows["mode"] == Mode.TENSION
    return np.asarray(followed & (state.rows["tension"] <= 0.0))


class ControlReport(NamedTuple):
    """What is latched and overridden in one control period; vectors of shape (m,)."""

    emergency: bool
    overridden: BoolVector
    latched: BoolVector
    rebooted: BoolVector
    lost: BoolVector
    clamped: int
    outdated: int


class ControlPeriod:
    """Turns the newest states of all groups of boards into their next commands.

    groups     in the order of the robot's `board_groups`
    read_only  ask for the states, command nothing
    """

    def __init__(
        self,
        robot: Robot,
        limits: CommandLimits,
        watchdog_action: WatchdogAction,
        watchdog_timeout: float,
        session: int = 0,
        read_only: bool = False,
    ) -> None:
        """watchdog_timeout [s] and action are what the boards do when frames stop.

        session  0 to 2**32 - 1; boards tell one bridge from another by it
        """
        self.arbiter = CommandArbiter(robot.model.muscle_names, limits)
        self._limits = limits
        self.groups = tuple(
            GroupControl(robot, group, watchdog_action, watchdog_timeout, session)
            for group in robot.board_groups
        )
        self.session = session
        self.read_only = read_only
        self._keeps_lost = watchdog_action is WatchdogAction.HOLD_LENGTH
        self._muscle_count = len(robot.model.muscle_names)
        self._joint_count = len(robot.model.joint_names)
        whole = whole_robot(self._muscle_count, self._joint_count)
        self._one_in_order = robot.board_groups == whole

    @property
    def rebooted(self) -> BoolVector:
        """Muscles whose boards started again since faults were last cleared, shape (m,)."""
        return self._whole([group.rebooted for group in self.groups])

    @property
    def lost(self) -> BoolVector:
        """Muscles whose group was lost since faults were last cleared, shape (m,)."""
        return self._whole([np.full(group.muscles.size, group.lost) for group in self.groups])

    def clear_faults(self, now: float | None = None) -> None:
        """Clear the boards' faults and the emergency stop; the muscles then hold.

        now  [s] what was commanded before it is forgotten; None: the last command's time
        """
        for group in self.groups:
            group.clear_faults()
        self.arbiter.clear_faults(now)

    def report(self, now: float) -> ControlReport:
        """Return a copy of what the diagnostics tell."""
        arbiter = self.arbiter
        return ControlReport(
            arbiter.emergency,
            arbiter.overridden(now),
            arbiter.latched,
            self.rebooted,
            self.lost,
            arbiter.clamped,
            arbiter.outdated,
        )

    # The robot with one group of boards.

    def check(self, state: StateFrame) -> None:
        """Raise FrameError unless `state` is one of this robot with a single group."""
        self.groups[0].check(state)

    def first_command(self) -> CommandFrame:
        """Return a command to the first group that moves nothing and asks for the state."""
        return self.groups[0].first_command()

    def next_command(self, state: StateFrame, now: float) -> CommandFrame:
        """Return the command that follows `state`, at the monotonic time `now` [s]."""
        return self.next_commands((state,), now)[0]

    # All groups.

    def next_commands(self, states: Sequence[StateFrame | None], now: float) -> list[CommandFrame]:
        """Return a command for each group, from its newest state; None: it never answered.

        Nothing is energised before every group has answered.
        """
        if self.read_only:
            return [group.question() for group in self.groups]
        # An emergency stop takes the current from boards that their watchdog holds, too.
        stop = self.arbiter.emergency
        release = [
            stop and group.may_hold(state, now)
            for group, state in zip(self.groups, states, strict=True)
        ]
        known = [state for state in states if state is not None]
        if len(known) < len(states):
            return [
                group.first_command(one) for group, one in zip(self.groups, release, strict=True)
            ]
        faulty = self._whole(
            [group.faulty(state, now) for group, state in zip(self.groups, known, strict=True)]
        )
        setpoints = self._setpoints(known, self._with_silence(faulty), now)
        return [
            # What is known of a silent group's lengths is old: without a command its boards'
            # watchdog acts, and holds those that they measure.
            group.question(lasting=True)
            if group.lost and group.silent and self._keeps_lost and not stop
            else group.command(setpoints, one)
            for group, one in zip(self.groups, release, strict=True)
        ]

    def _with_silence(self, faulty: BoolVector) -> BoolVector:
        """Hold what came back or is lost; with zero current instead, lost muscles are faulty."""
        some_lost = False
        for group in self.groups:
            some_lost |= group.lost
            if group.back:
                # Meanwhile the arm may have moved: hold it where it is, forget the commands.
                self.arbiter.hold(group.muscles)
        if not some_lost:
            return faulty
        # A lost group does what its watchdog does, whichever direction was cut.
        if not self._keeps_lost:
            return faulty | self.lost
        self.arbiter.keep(self.lost)
        return faulty

    def _setpoints(self, states: Sequence[StateFrame], faulty: BoolVector, now: float) -> Setpoints:
        tension = self._measured("tension", states)
        setpoints = self.arbiter.update(now, self._measured("length", states), tension, faulty)
        if pulls(setpoints):
            velocity, stale = self._measured("velocity", states), self._stale(states)
            setpoints = limited_pull(setpoints, tension, velocity, stale, self._limits)
        return setpoints

    def _measured(self, field: str, states: Sequence[StateFrame]) -> NDArray[Any]:
        if self._one_in_order:
            return states[0].rows[field]
        return self._whole([state.rows[field] for state in states])

    def _stale(self, states: Sequence[StateFrame]) -> BoolVector:
        return self._whole(
            [
                np.full(group.muscles.size, group.stale(state))
                for group, state in zip(self.groups, states, strict=True)
            ]
        )

    def merged(self, states: Sequence[StateFrame]) -> StateFrame:
        """Return the state of the whole robot, rows and joints in the robot's order."""
        if self._one_in_order:
            return states[0]
        rows = np.zeros(self._muscle_count, dtype=STATE_ROW)
        joints = np.zeros(self._joint_count, dtype=JOINT_ROW)
        for group, state in zip(self.groups, states, strict=True):
            rows[group.muscles] = state.rows
            joints[group.joints] = state.joints
        rows["id"] = np.arange(self._muscle_count)
        return StateFrame(max(state.sequence for state in states), rows, joints, self.session)

    def _whole(self, parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Put vectors of the groups, shapes (k,), into the robot's order, shape (m,)."""
        if self._one_in_order:
            return parts[0]
        whole = np.zeros(self._muscle_count, dtype=parts[0].dtype)
        for group, part in zip(self.groups, parts, strict=True):
            whole[group.muscles] = part
        return whole
