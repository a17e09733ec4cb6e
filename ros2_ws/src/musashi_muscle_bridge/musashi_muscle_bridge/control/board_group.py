"""What the bridge knows of one group of boards, and tells it; without clock or I/O."""

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import BoolVector
from fastswing_planner.robot.board_groups import BoardGroup
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import (
    COMMAND_ROW,
    STATE_ROW,
    CommandFrame,
    Fault,
    Mode,
    Rows,
    StateFrame,
    WatchdogAction,
)
from musashi_muscle_bridge.control.arbiter import Setpoints
from musashi_muscle_bridge.errors import FrameError

_CLEAR_FRAMES = 3
_CLEAR_SEC = 0.5  # of asking again while no answer shows that the boards heard it
_STALE_FRAMES = 5  # sent since the one that the newest answer belongs to
_LOST_TIMEOUTS = 3  # of the watchdog: a hiccup of the answers alone is no lost bus
_WATCHDOG, _ZERO_CURRENT = int(Fault.WATCHDOG), int(Mode.ZERO_CURRENT)
_NO_FAULT = int(Fault.NONE)  # numpy compares with it faster than with the enumeration's member
_NO_ROWS = np.zeros(0, dtype=COMMAND_ROW)


class GroupControl:
    """Frames to one group of boards, and what its answers mean. Vectors have shape (k,).

    muscles  index of the group's k muscles in the robot's order
    joints   index of the joints that it measures
    silent   its newest answer came longer ago than the watchdog timeout
    back     the newest answer is the first one after such a silence
    lost     it was silent for three times the watchdog timeout; latched until cleared

    An answer is stale when too many frames were sent since: nothing pulls by it.
    """

    def __init__(
        self,
        robot: Robot,
        group: BoardGroup,
        watchdog_action: WatchdogAction,
        watchdog_timeout: float,
        session: int,
    ) -> None:
        """watchdog_timeout [s] and action are what the boards do when frames stop."""
        self.muscles = np.array(group.muscles, dtype=np.intp)
        self.joints = np.array(group.joints, dtype=np.intp)
        self.session = session
        self.lost = False
        self.silent = False
        self.back = False
        self._watchdog_action = watchdog_action
        self._watchdog_timeout = watchdog_timeout
        count = self.muscles.size
        self._ids = range(count)
        self._nothing = np.zeros(count, dtype=bool)
        self._healthy = bytes([_NO_FAULT] * count)
        self._rows = np.zeros(count, dtype=COMMAND_ROW)
        self._rows["id"] = self._ids
        self._id_bytes = np.array(self._ids, STATE_ROW["id"]).tobytes()
        self._rows["tension_limit"] = robot.tension_limit[self.muscles]
        self._rows["current_limit"] = robot.current_limit[self.muscles]
        self._setpoints: Setpoints | None = None  # those that stand in the rows
        self._frozen_rows: Rows | None = None  # a copy of the rows as they are now
        self._sequence = 0
        self._clear_frames = 0
        self._cleared_from: int | None = None  # the first frame that asked to clear
        self._clear_until: float | None = None  # [s]
        self._answered: int | None = None
        self._answered_at = -np.inf
        self._boots = b""
        self._rebooted = np.zeros(count, dtype=bool)

    @property
    def rebooted(self) -> BoolVector:
        """Boards that started again since faults were last cleared."""
        return self._rebooted.copy()

    def clear_faults(self) -> None:
        """Ask the boards to clear their faults, until they answer it."""
        self._clear_frames = _CLEAR_FRAMES
        self._cleared_from = (self._sequence + 1) % 2**32
        self._clear_until = None
        self._rebooted[:] = False
        self.lost = False

    # Answers.

    def stale(self, state: StateFrame) -> bool:
        """Return whether the newest answer is too old to pull by."""
        return (self._sequence - state.sequence) % 2**32 > _STALE_FRAMES

    def may_hold(self, state: StateFrame | None, now: float) -> bool:
        """Return whether boards may hold on by their watchdog, whatever they are told.

        state  the newest answer; None: there was none yet
        now    monotonic [s]
        """
        if self._answered_at == -np.inf:
            self._answered_at = now  # nothing was asked before
        if now - self._answered_at > 0.5 * self._watchdog_timeout:
            return True
        if state is None:
            return False
        holding = (state.rows["fault"] == _WATCHDOG) & (state.rows["mode"] != _ZERO_CURRENT)
        return bool(np.count_nonzero(holding))

    def check(self, state: StateFrame) -> None:
        """Raise FrameError unless `state` is one of this group."""
        if state.rows["id"].tobytes() != self._id_bytes:
            raise FrameError(
                f"the boards answer for muscles {state.rows['id'].tolist()}, expected 0 to "
                f"{len(self._ids) - 1}: do robot_description and boards belong together?"
            )
        for field in ("length", "velocity", "tension"):
            # In each period: numpy counts ten times as fast as it asks for `all`.
            if np.count_nonzero(np.isfinite(state.rows[field])) < len(self._ids):
                raise FrameError(f"the boards report a {field} that is not finite")
        joints = self.joints.size
        if len(state.joints) != joints:
            raise FrameError(f"the boards measure {len(state.joints)} joints, expected {joints}")

    def faulty(self, state: StateFrame, now: float) -> BoolVector:
        """Return whose boards report a fault or started again; `now` [s] is monotonic."""
        self._notice_silence(state.sequence, now)
        if self._answers_before_clearing(state.sequence, now):
            faulty = self._nothing
        else:
            fault = state.rows["fault"]
            healthy = fault.tobytes() == self._healthy
            faulty = self._nothing if healthy else fault != _NO_FAULT
        return self._with_reboots(faulty, state.rows["boots"])

    def _notice_silence(self, sequence: int, now: float) -> None:
        """Boards that hear nothing act by themselves; this is about those that are not heard."""
        silence = 0.0 if self._answered is None else now - self._answered_at
        self.lost |= silence > _LOST_TIMEOUTS * self._watchdog_timeout
        self.back = silence > self._watchdog_timeout and sequence != self._answered
        if sequence != self._answered:
            self._answered = sequence
            self._answered_at = now
        self.silent = now - self._answered_at > self._watchdog_timeout

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

    # Frames.

    def question(self, lasting: bool = False) -> CommandFrame:
        """Return a frame that asks for the state and commands no board.

        It has no rows, so the boards neither change anything nor feed their watchdog.

        lasting  other bridges are kept off the boards for the watchdog timeout; else one that
                 commands takes them over at once
        """
        self._clear_frames = 0  # a clearing that was not heard in time is over
        timeout = self._watchdog_timeout if lasting else 0.0
        return CommandFrame(
            self._next_sequence(), _NO_ROWS, self._watchdog_action, timeout, False, self.session
        )

    def first_command(self, release: bool = False) -> CommandFrame:
        """Return a command that moves nothing and asks for the state; see `command`."""
        self._rows["mode"] = Mode.ZERO_CURRENT
        self._rows["setpoint"] = 0.0
        self._setpoints = self._frozen_rows = None
        return self._frame(release)

    def command(self, setpoints: Setpoints, release: bool = False) -> CommandFrame:
        """Return this group's share of the robot's setpoints.

        release  also from boards that their watchdog holds: they obey nothing before a reset
        """
        if setpoints is not self._setpoints:
            self._setpoints = setpoints
            self._frozen_rows = None
            self._rows["mode"] = setpoints.mode[self.muscles]
            self._rows["setpoint"] = setpoints.value[self.muscles]
        return self._frame(release)

    def _next_sequence(self) -> int:
        self._sequence = (self._sequence + 1) % 2**32
        return self._sequence

    def _frame(self, release: bool) -> CommandFrame:
        clear = release or self._clear_frames > 0
        self._clear_frames = max(self._clear_frames - 1, 0)
        if self._frozen_rows is None:
            self._frozen_rows = np.frombuffer(self._rows.tobytes(), COMMAND_ROW)
        return CommandFrame(
            self._next_sequence(),
            self._frozen_rows,
            self._watchdog_action,
            self._watchdog_timeout,
            clear,
            self.session,
        )
