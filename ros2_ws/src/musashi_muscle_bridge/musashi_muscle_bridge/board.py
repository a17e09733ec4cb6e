"""Emulated board firmware on top of the plant; without clock or I/O."""

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import BoolVector, Vector
from fastswing_planner.robot import Robot
from musashi_muscle_bridge.plant import Drive, Plant
from musashi_muscle_bridge.plant_constants import plant_constants
from musashi_muscle_bridge.protocol import (
    JOINT_ROW,
    STATE_ROW,
    CommandFrame,
    Fault,
    Mode,
    Rows,
    StateFrame,
    WatchdogAction,
)

_TENSION_GAIN = 0.01  # [m/s/N]
_OVER_TENSION_FACTOR = 1.5  # of the tension limit, above which a board gives up
# Plain numbers: numpy compares with them much faster than with an enumeration's members.
_NO_FAULT = int(Fault.NONE)
_CURRENT, _TENSION, _LENGTH = int(Mode.CURRENT), int(Mode.TENSION), int(Mode.LENGTH)


class Boards:
    """One board for each muscle: modes, limits, watchdog, latched faults."""

    def __init__(self, robot: Robot, plant: Plant | None = None) -> None:
        """Start at zero current; `plant` is the robot's own unless another is given."""
        self.plant = plant or Plant(robot)
        count = self.plant.length.size
        self._length_gain = plant_constants(robot.plant).length_gain
        self._ids = np.arange(count, dtype="<u2")
        self._id_bytes = self._ids.tobytes()
        self._mode = np.full(count, Mode.ZERO_CURRENT, dtype=np.uint8)
        self._setpoint = np.zeros(count)
        self._held = np.zeros(count, dtype=bool)
        self._tension_limit = np.array(robot.tension_limit)
        self._current_limit = np.array(robot.current_limit)
        self.fault = np.full(count, Fault.NONE, dtype=np.uint8)
        self.silence_at_fault = np.zeros(count)  # [s] since the last command, when it latched
        self._velocity_limit = robot.limits.velocity
        self._watchdog_action = WatchdogAction.ZERO_CURRENT
        self._watchdog_timeout = np.inf
        self._since_command = 0.0
        self._ahead = 0.0
        self._obeyed = b""  # the command rows that all boards follow; empty: take the next ones
        self._answer = np.zeros(count, dtype=STATE_ROW)  # what never changes in an answer
        self._answer["id"] = self._ids
        self._joint_answer = np.zeros(self.plant.joint_position.size, dtype=JOINT_ROW)
        self._sort_modes()

    @property
    def mode(self) -> NDArray[np.uint8]:
        """What each board does with its motor, shape (m,); see `protocol.Mode`."""
        return self._mode

    def handle(self, command: CommandFrame) -> StateFrame:
        """Take a command and answer with what was measured."""
        rows = command.rows
        if rows["id"].tobytes() == self._id_bytes:
            self._since_command = 0.0
            self._watchdog_action = command.watchdog_action
            self._watchdog_timeout = command.watchdog_timeout
            if command.clear_faults:
                self.fault[:] = Fault.NONE
            content, healthy = rows.tobytes(), not np.count_nonzero(self.fault)
            if not healthy or content != self._obeyed:
                self._obey(rows)
                self._obeyed = content if healthy else b""
        return self.state(command.sequence)

    def _obey(self, rows: Rows) -> None:
        if np.count_nonzero(self._held):
            self._held &= self.fault == Fault.WATCHDOG
        mode, setpoint = rows["mode"].copy(), rows["setpoint"].astype(float)
        if np.count_nonzero(self.fault):
            # A faulty board stays in what its fault put it in, until it is cleared.
            obeys = self.fault == _NO_FAULT
            mode = np.where(obeys, mode, self._held * np.uint8(_LENGTH))
            setpoint = np.where(obeys, setpoint, self._setpoint)
        self._mode, self._setpoint = mode, setpoint
        self._tension_limit = rows["tension_limit"].astype(float)
        self._current_limit = rows["current_limit"].astype(float)
        modes = mode.tobytes()
        if modes != self._sorted or _CURRENT in modes:
            self._sort_modes()

    def state(self, sequence: int) -> StateFrame:
        """Return what was measured."""
        plant = self.plant
        rows = self._answer.copy()
        rows["mode"] = self._mode
        rows["fault"] = self.fault
        rows["length"] = plant.length
        rows["velocity"] = plant.velocity
        rows["tension"] = plant.tension
        rows["current"] = plant.current
        rows["temperature"] = plant.housing_temperature
        joints = self._joint_answer.copy()
        joints["position"] = plant.joint_position
        joints["velocity"] = plant.joint_velocity
        return StateFrame(sequence, rows, joints)

    def advance(self, elapsed: float) -> None:
        """Let `elapsed` [s] pass; the part below one time step is kept for the next call."""
        self._ahead += elapsed
        while self._ahead >= self.plant.time_step:
            self._ahead -= self.plant.time_step
            self._since_command += self.plant.time_step
            over = self.plant.tension > self._tension_limit
            tense = np.count_nonzero(over) > 0
            if tense or self._since_command > self._watchdog_timeout:
                self._watch()
            self.plant.step(self._drive(over if tense else None))

    def _watch(self) -> None:
        if self._since_command > self._watchdog_timeout:
            self.fail(self.fault == _NO_FAULT, Fault.WATCHDOG)
        over = self.plant.tension > _OVER_TENSION_FACTOR * self._tension_limit
        self.fail(over & (self.fault == _NO_FAULT), Fault.OVER_TENSION)

    def fail(self, which: BoolVector, fault: Fault) -> None:
        """Latch a fault on some boards, shape (m,)."""
        if not which.any():
            return
        self._obeyed = b""
        self.fault[which] = fault
        self.silence_at_fault[which] = self._since_command
        hold = fault is Fault.WATCHDOG and self._watchdog_action is WatchdogAction.HOLD_LENGTH
        self._held[which] = hold
        self._mode[which] = Mode.LENGTH if hold else Mode.ZERO_CURRENT
        self._setpoint[which] = self.plant.length[which] if hold else 0.0
        self._sort_modes()

    def _sort_modes(self) -> None:
        """Work out, once for each change of mode or current, what every time step needs."""
        self._sorted = self._mode.tobytes()
        self._in_tension = self._mode == _TENSION
        self._driven = (self._mode == _LENGTH) | self._in_tension
        self._some_in_tension = np.count_nonzero(self._in_tension) > 0
        self._current = np.zeros(self._mode.size)
        in_current = self._mode == _CURRENT
        if np.count_nonzero(in_current):
            current = np.clip(self._setpoint, -self._current_limit, self._current_limit)
            self._current[in_current] = current[in_current]

    def _drive(self, over: BoolVector | None) -> Drive:
        """Return what the motors do; `over`: whose tension is above the limit, None for nobody."""
        velocity: Vector = (self._setpoint - self.plant.length) * self._length_gain
        if self._some_in_tension:
            to_tension = _TENSION_GAIN * (self.plant.tension - self._setpoint)
            velocity = np.where(self._in_tension, to_tension, velocity)
        if over is not None:
            # Tension above the limit pays out, whatever is asked for.
            velocity = np.where(over, self._velocity_limit, velocity)
        return Drive(self._driven, velocity, self._current)
