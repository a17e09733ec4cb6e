"""One control period of the bridge: state in, command out; without clock or I/O.

The bridge node runs it against a bus, the headless closed loop against emulated boards.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import BoolVector, Vector, frozen
from fastswing_planner.muscle_model import MuscleModel
from fastswing_planner.robot import Robot
from musashi_muscle_bridge.arbiter import CommandArbiter, CommandLimits, Setpoints
from musashi_muscle_bridge.errors import FrameError
from musashi_muscle_bridge.protocol import (
    COMMAND_ROW,
    CommandFrame,
    Fault,
    Mode,
    Rows,
    StateFrame,
    WatchdogAction,
)

_CLEAR_FRAMES = 3
_CLEAR_SEC = 0.5  # of asking again while no answer shows that the boards heard it
_MAX_CORNER_JOINTS = 8  # all corners of the travel up to here, as many drawn ones beyond
_NO_FAULT = int(Fault.NONE)  # numpy compares with it faster than with the enumeration's member


def length_range(model: MuscleModel, count: int = 400) -> tuple[Vector, Vector]:
    """Return the shortest and longest path [m] of each muscle, both shape (m,), over the travel.

    count  number of postures sampled, the same ones each time
    """
    low = np.maximum(model.joint_lower, -np.pi)
    high = np.minimum(model.joint_upper, np.pi)
    random = np.random.default_rng(0)
    fractions = random.uniform(size=(count, low.size))
    if low.size <= _MAX_CORNER_JOINTS:
        corners = np.array(np.meshgrid(*[[0.0, 1.0]] * low.size)).T.reshape(-1, low.size)
    else:
        corners = random.integers(0, 2, size=(2**_MAX_CORNER_JOINTS, low.size)).astype(float)
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
        session: int = 0,
    ) -> None:
        """watchdog_timeout [s] and action are what the boards do when frames stop.

        session  0 to 2**32 - 1; boards tell one bridge from another by it
        """
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
        self.session = session
        self._setpoints: Setpoints | None = None  # those that stand in the rows
        self._frozen_rows: Rows | None = None  # a copy of the rows as they are now
        self._sequence = 0
        self._clear_frames = 0
        self._cleared_from: int | None = None  # the first frame that asked to clear
        self._clear_until: float | None = None  # [s]
        self._answered: int | None = None
        self._answered_at = -np.inf
        self._boots = b""
        self._rebooted = np.zeros(len(self._ids), dtype=bool)

    @property
    def rebooted(self) -> BoolVector:
        """Muscles whose boards started again since faults were last cleared, shape (m,)."""
        return self._rebooted.copy()

    def clear_faults(self) -> None:
        """Clear the boards' faults and the emergency stop; the muscles then hold."""
        self._clear_frames = _CLEAR_FRAMES
        self._cleared_from = (self._sequence + 1) % 2**32
        self._clear_until = None
        self._rebooted[:] = False
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
        self._setpoints = self._frozen_rows = None
        return self._frame()

    def next_command(self, state: StateFrame, now: float) -> CommandFrame:
        """Return the command that follows `state`, at the monotonic time `now` [s]."""
        self._notice_outage(state.sequence, now)
        if self._answers_before_clearing(state.sequence, now):
            faulty = self._nothing
        else:
            fault = state.rows["fault"]
            healthy = fault.tobytes() == self._healthy
            faulty = self._nothing if healthy else fault != _NO_FAULT
        faulty = self._with_reboots(faulty, state.rows["boots"])
        setpoints = self.arbiter.update(
            now,
            state.rows["length"],
            state.rows["tension"],
            faulty,
        )
        if setpoints is not self._setpoints:
            self._setpoints = setpoints
            self._frozen_rows = None
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

    def _with_reboots(self, faulty: BoolVector, boots: NDArray[np.uint16]) -> BoolVector:
        """Add boards that started again: they forgot their faults, and perhaps their length."""
        before, self._boots = self._boots, boots.tobytes()
        if self._boots == before or not before:
            return faulty
        rebooted = boots != np.frombuffer(before, boots.dtype)
        self._rebooted |= rebooted
        return faulty | rebooted

    def _answers_before_clearing(self, sequence: int, now: float) -> bool:
        """Whether a state is older than the request to clear faults, so still shows them."""
        if self._cleared_from is None:
            return False
        older = (sequence - self._cleared_from) % 2**32 >= 2**31
        if self._clear_until is None:
            self._clear_until = now + _CLEAR_SEC
        if older and now < self._clear_until:
            self._clear_frames = max(self._clear_frames, 1)
        if not older and not self._clear_frames:
            self._cleared_from = None
        return older or self._clear_frames > 0

    def _frame(self) -> CommandFrame:
        self._sequence = (self._sequence + 1) % 2**32
        clear = self._clear_frames > 0
        self._clear_frames = max(self._clear_frames - 1, 0)
        if self._frozen_rows is None:
            self._frozen_rows = np.frombuffer(self._rows.tobytes(), COMMAND_ROW)
        return CommandFrame(
            self._sequence,
            self._frozen_rows,
            self._watchdog_action,
            self._watchdog_timeout,
            clear,
            self.session,
        )
