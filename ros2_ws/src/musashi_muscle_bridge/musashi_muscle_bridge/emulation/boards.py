"""Emulated board firmware on top of the plant; without clock or I/O."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import BoolVector, Vector, constant
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import (
    JOINT_ROW,
    STATE_ROW,
    CommandFrame,
    Fault,
    Mode,
    Rows,
    StateFrame,
    WatchdogAction,
    copied,
)
from musashi_muscle_bridge.emulation.plant import Drive, Plant
from musashi_muscle_bridge.emulation.plant_constants import plant_constants

_TENSION_GAIN = 0.01  # [m/s/N]
_OVER_TENSION_FACTOR = 1.5  # of the tension limit, above which a board gives up
# Plain numbers: numpy compares with them much faster than with an enumeration's members.
_NO_FAULT = int(Fault.NONE)
_HOLD_LENGTH = int(WatchdogAction.HOLD_LENGTH)
_CURRENT, _TENSION, _LENGTH = int(Mode.CURRENT), int(Mode.TENSION), int(Mode.LENGTH)


@dataclass
class _Group:
    """The boards on one bus: they hear the same frames, and miss the same.

    muscles, joints  index into those of the arm, in the order of the frames; slice: all of them
    id_bytes         the ids of a frame that is for this group
    obeyed           the command rows that all its boards follow; empty: take the next ones
    """

    muscles: slice | NDArray[np.intp]
    joints: slice | NDArray[np.intp]
    id_bytes: bytes
    watchdog_timeout: float = np.inf
    since_command: float = 0.0
    obeyed: bytes = b""


def _index(chosen: Sequence[int], count: int) -> slice | NDArray[np.intp]:
    return slice(None) if list(chosen) == list(range(count)) else np.array(chosen, dtype=np.intp)


class Boards:
    """One board for each muscle: modes, limits, watchdog, latched faults."""

    def __init__(self, robot: Robot, plant: Plant | None = None) -> None:
        """Start at zero current; `plant` is the robot's own unless another is given."""
        self.plant = plant or Plant(robot)
        count = self.plant.length.size
        self._length_gain = constant(plant_constants(robot.plant).length_gain)
        self._ids = np.arange(count, dtype="<u2")
        joints = self.plant.joint_position.size
        self._groups = tuple(
            _Group(
                _index(group.muscles, count),
                _index(group.joints, joints),
                self._ids[: len(group.muscles)].tobytes(),
            )
            for group in robot.board_groups
        )
        self._mode = np.full(count, Mode.ZERO_CURRENT, dtype=np.uint8)
        self._setpoint = np.zeros(count)
        self._held = np.zeros(count, dtype=bool)
        self._tension_limit = np.array(robot.tension_limit)
        self._current_limit = np.array(robot.current_limit)
        self.fault = np.full(count, Fault.NONE, dtype=np.uint8)
        self.silence_at_fault = np.zeros(count)  # [s] since the last command, when it latched
        self._velocity_limit = robot.limits.velocity
        self._holds_in_silence = np.zeros(count, dtype=bool)  # the watchdog action
        self._ahead = 0.0
        # The answer, and views of its columns: looked up once, written in every answer.
        self._rows = np.zeros(count, dtype=STATE_ROW)
        self._rows["id"] = self._ids
        self._columns = {name: self._rows[name] for name in STATE_ROW.names or ()}
        self._joint_rows = np.zeros(joints, dtype=JOINT_ROW)
        self._joint_columns = {name: self._joint_rows[name] for name in JOINT_ROW.names or ()}
        self._sort_modes()

    @property
    def mode(self) -> NDArray[np.uint8]:
        """What each board does with its motor, shape (m,); see `protocol.Mode`."""
        return self._mode

    def handle(self, command: CommandFrame, group: int = 0) -> StateFrame:
        """Take a command on one group's bus, and answer with what this group measured."""
        line, rows = self._groups[group], command.rows
        if rows["id"].tobytes() == line.id_bytes:
            muscles = line.muscles
            line.since_command = 0.0
            line.watchdog_timeout = command.watchdog_timeout
            self._holds_in_silence[muscles] = command.watchdog_action == _HOLD_LENGTH
            if command.clear_faults:
                self.fault[muscles] = Fault.NONE
            content, healthy = rows.tobytes(), not np.count_nonzero(self.fault[muscles])
            if not healthy or content != line.obeyed:
                self._obey(rows, muscles)
                line.obeyed = content if healthy else b""
        return self._part(self.state(command.sequence), line)

    def _obey(self, rows: Rows, muscles: slice | NDArray[np.intp]) -> None:
        if np.count_nonzero(self._held):
            self._held &= self.fault == Fault.WATCHDOG
        mode, setpoint = rows["mode"], rows["setpoint"].astype(float)
        if np.count_nonzero(self.fault):
            # A faulty board stays in what its fault put it in, until it is cleared.
            obeys = self.fault[muscles] == _NO_FAULT
            mode = np.where(obeys, mode, self._held[muscles] * np.uint8(_LENGTH))
            setpoint = np.where(obeys, setpoint, self._setpoint[muscles])
        self._mode[muscles], self._setpoint[muscles] = mode, setpoint
        self._tension_limit[muscles] = rows["tension_limit"]
        self._current_limit[muscles] = rows["current_limit"]
        modes = self._mode.tobytes()
        if modes != self._sorted or _CURRENT in modes:
            self._sort_modes()

    def _part(self, state: StateFrame, line: _Group) -> StateFrame:
        """Return one group's share of the arm's state, numbered as on its bus."""
        if isinstance(line.muscles, slice) and isinstance(line.joints, slice):
            return state
        rows = state.rows[line.muscles].copy()
        rows["id"] = np.arange(len(rows))
        return StateFrame(state.sequence, rows, state.joints[line.joints].copy())

    def state(self, sequence: int) -> StateFrame:
        """Return what was measured on the whole arm."""
        plant, columns, joint_columns = self.plant, self._columns, self._joint_columns
        columns["mode"][...] = self._mode
        columns["fault"][...] = self.fault
        columns["length"][...] = plant.length
        columns["velocity"][...] = plant.velocity
        columns["tension"][...] = plant.tension
        columns["current"][...] = plant.current
        columns["temperature"][...] = plant.housing_temperature
        joint_columns["position"][...] = plant.joint_position
        joint_columns["velocity"][...] = plant.joint_velocity
        return StateFrame(sequence, copied(self._rows), copied(self._joint_rows))

    def advance(self, elapsed: float) -> None:
        """Let `elapsed` [s] pass; the part below one time step is kept for the next call."""
        self._ahead += elapsed
        while self._ahead >= self.plant.time_step:
            self._ahead -= self.plant.time_step
            silent = False
            for line in self._groups:
                line.since_command += self.plant.time_step
                silent |= line.since_command > line.watchdog_timeout
            over = self.plant.tension > self._tension_limit
            tense = np.count_nonzero(over) > 0
            if tense or silent:
                self._watch()
            self.plant.step(self._drive(over if tense else None))

    def _watch(self) -> None:
        for line in self._groups:
            if line.since_command > line.watchdog_timeout:
                deaf = np.zeros(self.fault.size, dtype=bool)
                deaf[line.muscles] = True
                self.fail(deaf & (self.fault == _NO_FAULT), Fault.WATCHDOG)
        over = self.plant.tension > _OVER_TENSION_FACTOR * self._tension_limit
        self.fail(over & (self.fault == _NO_FAULT), Fault.OVER_TENSION)

    def fail(self, which: BoolVector, fault: Fault) -> None:
        """Latch a fault on some boards, shape (m,)."""
        if not which.any():
            return
        for line in self._groups:
            line.obeyed = b""
            failed = np.arange(which.size)[line.muscles][which[line.muscles]]
            self.silence_at_fault[failed] = line.since_command
        self.fault[which] = fault
        # A motor that was told to be without current, by an emergency stop say, stays without.
        driven = self._mode != Mode.ZERO_CURRENT
        hold = which & driven & self._holds_in_silence & (fault is Fault.WATCHDOG)
        self._held[which] = hold[which]
        self._mode[which] = hold[which] * np.uint8(_LENGTH)
        self._setpoint[which] = np.where(hold, self.plant.length, 0.0)[which]
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
            current = np.clip(self._setpoint, 0.0, self._current_limit)
            self._current[in_current] = current[in_current]

    def _drive(self, over: BoolVector | None) -> Drive:
        """Return what the motors do; `over`: whose tension is above the limit, None for nobody."""
        velocity: Vector = (self._setpoint - self.plant.length) * self._length_gain
        if self._some_in_tension:
            to_tension = _TENSION_GAIN * (self.plant.tension - self._setpoint)
            velocity = np.where(self._in_tension, to_tension, velocity)
        if over is None:
            return Drive(self._driven, velocity, self._current)
        # Tension above the limit pays out, whatever is asked for.
        velocity = np.where(over, self._velocity_limit, velocity)
        return Drive(self._driven | (over & (self._mode == _CURRENT)), velocity, self._current)
