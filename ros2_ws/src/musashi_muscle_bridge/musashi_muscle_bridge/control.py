"""One control period of the bridge: state in, command out; without clock or I/O.

The bridge node runs it against a bus, the headless closed loop against emulated boards.
"""

from collections.abc import Sequence

import numpy as np

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.muscle_model import MuscleModel
from fastswing_planner.robot import Robot
from musashi_muscle_bridge.arbiter import CommandArbiter, CommandLimits, Setpoints
from musashi_muscle_bridge.errors import FrameError
from musashi_muscle_bridge.protocol import (
    COMMAND_ROW,
    CommandFrame,
    Fault,
    Mode,
    StateFrame,
    WatchdogAction,
)

_CLEAR_FRAMES = 3
_NO_FAULT = int(Fault.NONE)  # numpy compares with it faster than with the enumeration's member


def length_range(model: MuscleModel, count: int = 400) -> tuple[Vector, Vector]:
    """Return the shortest and longest path [m] of each muscle, both shape (m,), over the travel.

    count  number of postures sampled, the same ones each time
    """
    low = np.maximum(model.joint_lower, -np.pi)
    high = np.minimum(model.joint_upper, np.pi)
    fractions = np.random.default_rng(0).uniform(size=(count, low.size))
    corners = np.array(np.meshgrid(*[[0.0, 1.0]] * low.size)).T.reshape(-1, low.size)
    samples = low + np.vstack([fractions, corners]) * (high - low)
    lengths = np.array([model.lengths(sample) for sample in samples])
    return frozen(lengths.min(axis=0)), frozen(lengths.max(axis=0))


def command_limits(
    robot: Robot, stream_timeout: float, max_lease: float, payout_allowance: float
) -> CommandLimits:
    """Return what commands to a robot are clamped to.

    payout_allowance  [m] of slack beyond the longest path; Method 2 needs some
    """
    shortest, longest = length_range(robot.model)
    return CommandLimits(
        length_min=frozen(shortest - robot.tension_limit / robot.wire_stiffness),
        length_max=frozen(longest + payout_allowance),
        tension_max=robot.limits.tension_max,
        current_max=robot.current_limit,
        velocity=robot.limits.velocity,
        stream_timeout=stream_timeout,
        max_lease=max_lease,
    )


class ControlPeriod:
    """Turns each state of the boards into their next command."""

    def __init__(
        self,
        robot: Robot,
        limits: CommandLimits,
        watchdog_action: WatchdogAction,
        watchdog_timeout: float,
    ) -> None:
        """watchdog_timeout [s] and action are what the boards do when frames stop."""
        self._robot = robot
        self.arbiter = CommandArbiter(robot.model.muscle_names, limits)
        self._watchdog_action = watchdog_action
        self._watchdog_timeout = watchdog_timeout
        self._ids: Sequence[int] = range(len(robot.model.muscle_names))
        self._nothing = np.zeros(len(self._ids), dtype=bool)
        self._healthy = bytes([_NO_FAULT] * len(self._ids))
        self._rows = np.zeros(len(self._ids), dtype=COMMAND_ROW)
        self._rows["id"] = self._ids
        self._rows["tension_limit"] = robot.tension_limit
        self._rows["current_limit"] = robot.current_limit
        self._setpoints: Setpoints | None = None  # those that stand in the rows
        self._sequence = 0
        self._clear_frames = 0
        self._cleared_from: int | None = None  # the first frame that asked to clear
        self._answered: int | None = None
        self._answered_at = -np.inf

    def clear_faults(self) -> None:
        """Clear the boards' faults and the emergency stop; the muscles then hold."""
        self._clear_frames = _CLEAR_FRAMES
        self._cleared_from = self._sequence + 1
        self.arbiter.clear_faults()

    def check(self, state: StateFrame) -> None:
        """Raise FrameError unless `state` is one of this robot."""
        if len(state.rows) != len(self._ids) or not np.array_equal(state.rows["id"], self._ids):
            raise FrameError(
                f"the boards answer for muscles {state.rows['id'].tolist()}, expected 0 to "
                f"{len(self._ids) - 1}: do robot_description and boards belong together?"
            )
        for field in ("length", "velocity", "tension"):
            if not np.isfinite(state.rows[field]).all():
                raise FrameError(f"the boards report a {field} that is not finite")
        joints = len(self._robot.model.joint_names)
        if len(state.joints) != joints:
            raise FrameError(f"the boards measure {len(state.joints)} joints, expected {joints}")

    def first_command(self) -> CommandFrame:
        """Return a command that moves nothing and asks for the state."""
        self._rows["mode"] = Mode.ZERO_CURRENT
        self._rows["setpoint"] = 0.0
        self._setpoints = None
        return self._frame()

    def next_command(self, state: StateFrame, now: float) -> CommandFrame:
        """Return the command that follows `state`, at the monotonic time `now` [s]."""
        self._notice_outage(state.sequence, now)
        if self._answers_before_clearing(state.sequence):
            faulty = self._nothing
        else:
            fault = state.rows["fault"]
            healthy = fault.tobytes() == self._healthy
            faulty = self._nothing if healthy else fault != _NO_FAULT
        setpoints = self.arbiter.update(
            now,
            state.rows["length"],
            state.rows["tension"],
            faulty,
        )
        if setpoints is not self._setpoints:
            self._setpoints = setpoints
            self._rows["mode"] = setpoints.mode
            self._rows["setpoint"] = setpoints.value
        return self._frame()

    def _notice_outage(self, sequence: int, now: float) -> None:
        """After an outage the arm may be anywhere: hold it there, forget the commands."""
        if sequence == self._answered:
            return
        if self._answered is not None and now - self._answered_at > self._watchdog_timeout:
            self.arbiter.hold()
        self._answered = sequence
        self._answered_at = now

    def _answers_before_clearing(self, sequence: int) -> bool:
        """Whether a state is older than the request to clear faults, so still shows them."""
        if self._cleared_from is None:
            return False
        older = (sequence - self._cleared_from) % 2**32 >= 2**31
        if not older and not self._clear_frames:
            self._cleared_from = None
        return older or self._clear_frames > 0

    def _frame(self) -> CommandFrame:
        self._sequence = (self._sequence + 1) % 2**32
        clear = self._clear_frames > 0
        self._clear_frames = max(self._clear_frames - 1, 0)
        rows = np.frombuffer(self._rows.tobytes(), COMMAND_ROW)  # much faster than a copy
        return CommandFrame(
            self._sequence, rows, self._watchdog_action, self._watchdog_timeout, clear
        )
