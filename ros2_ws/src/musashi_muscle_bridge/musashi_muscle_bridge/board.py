"""Emulated board firmware on top of the plant; without clock or I/O."""

import numpy as np

from fastswing_planner.arrays import BoolVector, Vector
from fastswing_planner.robot import Robot
from musashi_muscle_bridge.plant import Drive, Plant
from musashi_muscle_bridge.protocol import (
    JOINT_ROW,
    STATE_ROW,
    CommandFrame,
    Fault,
    Mode,
    StateFrame,
    WatchdogAction,
)

_LENGTH_GAIN = 77.0  # [1/s] payout speed for each metre of length error
_TENSION_GAIN = 0.01  # [m/s/N]
_OVER_TENSION_FACTOR = 1.5  # of the tension limit, above which a board gives up


class Boards:
    """One board for each muscle: modes, limits, watchdog, latched faults."""

    def __init__(self, robot: Robot, plant: Plant | None = None) -> None:
        """Start at zero current; `plant` is the robot's own unless another is given."""
        self.plant = plant or Plant(robot)
        count = self.plant.length.size
        self._ids = np.arange(count)
        self._mode = np.full(count, Mode.ZERO_CURRENT, dtype=np.uint8)
        self._setpoint = np.zeros(count)
        self._held = np.zeros(count, dtype=bool)
        self._tension_limit = np.array(robot.tension_limit)
        self._current_limit = np.array(robot.current_limit)
        self.fault = np.full(count, Fault.NONE, dtype=np.uint8)
        self._velocity_limit = robot.limits.velocity
        self._watchdog_action = WatchdogAction.ZERO_CURRENT
        self._watchdog_timeout = np.inf
        self._since_command = 0.0
        self._ahead = 0.0

    def handle(self, command: CommandFrame) -> StateFrame:
        """Take a command and answer with what was measured."""
        rows = command.rows
        if len(rows) == self._ids.size and np.array_equal(rows["id"], self._ids):
            self._since_command = 0.0
            self._watchdog_action = command.watchdog_action
            self._watchdog_timeout = command.watchdog_timeout
            if command.clear_faults:
                self.fault[:] = Fault.NONE
            self._held &= self.fault == Fault.WATCHDOG
            # A faulty board stays in what its fault put it in, until it is cleared.
            obeys = self.fault == Fault.NONE
            stopped = np.where(self._held, Mode.LENGTH, Mode.ZERO_CURRENT)
            self._mode = np.where(obeys, rows["mode"], stopped)
            self._setpoint = np.where(obeys, rows["setpoint"].astype(float), self._setpoint)
            self._tension_limit = rows["tension_limit"].astype(float)
            self._current_limit = rows["current_limit"].astype(float)
        return self.state(command.sequence)

    def state(self, sequence: int) -> StateFrame:
        """Return what was measured; temperature is not."""
        plant = self.plant
        rows = np.zeros(self._ids.size, dtype=STATE_ROW)
        rows["id"] = self._ids
        rows["mode"] = self._mode
        rows["fault"] = self.fault
        rows["length"] = plant.length
        rows["velocity"] = plant.velocity
        rows["tension"] = plant.tension
        rows["current"] = plant.current
        rows["temperature"] = np.nan
        rows["boots"] = 0
        rows["refused"] = 0
        joints = np.zeros(plant.joint_position.size, dtype=JOINT_ROW)
        joints["position"] = plant.joint_position
        joints["velocity"] = plant.joint_velocity
        return StateFrame(sequence, rows, joints)

    def advance(self, elapsed: float) -> None:
        """Let `elapsed` [s] pass; the part below one time step is kept for the next call."""
        self._ahead += elapsed
        while self._ahead >= self.plant.time_step:
            self._ahead -= self.plant.time_step
            self._since_command += self.plant.time_step
            self._watch()
            self.plant.step(self._drive())

    def _watch(self) -> None:
        if self._since_command > self._watchdog_timeout:
            self.fail(self.fault == Fault.NONE, Fault.WATCHDOG)
        over = self.plant.tension > _OVER_TENSION_FACTOR * self._tension_limit
        self.fail(over & (self.fault == Fault.NONE), Fault.OVER_TENSION)

    def fail(self, which: BoolVector, fault: Fault) -> None:
        """Latch a fault on some boards, shape (m,)."""
        if not which.any():
            return
        self.fault[which] = fault
        hold = fault is Fault.WATCHDOG and self._watchdog_action is WatchdogAction.HOLD_LENGTH
        self._held[which] = hold
        self._mode[which] = Mode.LENGTH if hold else Mode.ZERO_CURRENT
        self._setpoint[which] = self.plant.length[which] if hold else 0.0

    def _drive(self) -> Drive:
        tension = self.plant.tension
        to_length = _LENGTH_GAIN * (self._setpoint - self.plant.length)
        to_tension = _TENSION_GAIN * (tension - self._setpoint)
        velocity: Vector = np.where(self._mode == Mode.TENSION, to_tension, to_length)
        # Tension above the limit pays out, whatever is asked for.
        velocity = np.where(tension > self._tension_limit, self._velocity_limit, velocity)
        current = np.clip(self._setpoint, -self._current_limit, self._current_limit)
        return Drive(
            driven=(self._mode == Mode.LENGTH) | (self._mode == Mode.TENSION),
            velocity=velocity,
            current=np.where(self._mode == Mode.CURRENT, current, 0.0),
        )
