"""What breaks on a real arm, on the emulated one, to be switched at any time; no clock, no I/O."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fastswing_planner.arrays import BoolVector, Vector, frozen, unique_known
from fastswing_planner.errors import InvalidParameter, InvalidRequest
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import Fault, StateFrame
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.emulation.plant import Plant

_HOT = 120.0  # [deg C] of a motor that is made hot
_SLIP = 0.02  # [m/s] between motor and encoder that is implausible
_SLIP_SEC = 0.05  # when it lasts this long


@dataclass(frozen=True)
class ArmFaults:
    """Which muscles suffer from what, each shape (m,).

    stuck_encoder  the encoder shows what it showed last
    dead_board     without power: no current, and its last measurement is repeated
    hot_motor      beyond its limit
    broken_wire    pulls nothing; the winch turns freely
    """

    stuck_encoder: BoolVector
    dead_board: BoolVector
    hot_motor: BoolVector
    broken_wire: BoolVector


ARM_FAULTS = tuple(ArmFaults.__dataclass_fields__)


def chosen_muscles(fault: str, names: Sequence[str], muscle_names: Sequence[str]) -> BoolVector:
    """Return which muscles are named, shape (m,); raises InvalidParameter naming the fault."""
    chosen = np.zeros(len(muscle_names), dtype=bool)
    try:
        chosen[unique_known("muscle", names, muscle_names)] = True
    except InvalidRequest as error:
        raise InvalidParameter(f"{fault}: {error}") from error
    return chosen


class FaultyPlant(Plant):
    """An arm whose encoders can stick and whose wires can break."""

    def __init__(self, robot: Robot) -> None:
        """Nothing is broken."""
        super().__init__(robot)
        self.stuck = np.zeros(len(robot.model.muscle_names), dtype=bool)
        self._some_stuck = False
        self._shown = np.array(super().length)

    def stick(self, stuck: BoolVector) -> None:
        """Let the encoders of some muscles stick from now on, and no others."""
        self._shown = np.array(self.length)
        self.stuck = stuck
        self._some_stuck = bool(stuck.any())

    @property
    def length(self) -> Vector:
        """What the encoders read [m], shape (m,)."""
        true = super().length
        return frozen(np.where(self.stuck, self._shown, true)) if self._some_stuck else true

    @property
    def velocity(self) -> Vector:
        """Rate of `length` [m/s], shape (m,)."""
        true = super().velocity
        return frozen(np.where(self.stuck, 0.0, true)) if self._some_stuck else true

    @property
    def motor_velocity(self) -> Vector:
        """What the motors turn [m/s], shape (m,), known without the encoder from their voltage."""
        return super().velocity


class FaultyBoards(Boards):
    """Boards on an arm that can break, with the firmware that finds it."""

    def __init__(self, robot: Robot) -> None:
        """Nothing is broken."""
        self._arm = FaultyPlant(robot)
        super().__init__(robot, self._arm)
        nothing = np.zeros(len(robot.model.muscle_names), dtype=bool)
        self._faults = ArmFaults(nothing, nothing, nothing, nothing)
        self._sound = True
        self._slipping = np.zeros(nothing.size)
        self._boots = np.zeros(nothing.size, dtype=np.uint16)
        self._last = super().state(0).rows

    def inject(self, faults: ArmFaults) -> None:
        """Let these faults be there from now on, and no others."""
        self._last = self.state(0).rows
        revived = self._faults.dead_board & ~faults.dead_board
        self._boots[revived] += 1
        self._faults = faults
        self._sound = not any(getattr(faults, name).any() for name in ARM_FAULTS)
        if not np.array_equal(faults.stuck_encoder, self._arm.stuck):
            self._arm.stick(faults.stuck_encoder)
            self._slipping[:] = 0.0
        self._arm.wire_broken = faults.broken_wire.copy()
        self._supervise()

    def advance(self, elapsed: float) -> None:
        """Let `elapsed` [s] pass."""
        super().advance(elapsed)
        if self._sound:
            return
        slip = np.abs(self._arm.motor_velocity - self._arm.velocity) > _SLIP
        self._slipping = np.where(slip, self._slipping + elapsed, 0.0)
        self._supervise()

    def _supervise(self) -> None:
        # A dead board holds nothing either, whatever its fault was.
        self.fail(self._faults.dead_board & (self.fault != Fault.BUS), Fault.BUS)
        for which, fault in (
            (self._faults.hot_motor, Fault.OVER_TEMPERATURE),
            (self._slipping > _SLIP_SEC, Fault.ENCODER),
        ):
            self.fail(which & (self.fault == Fault.NONE), fault)

    def state(self, sequence: int) -> StateFrame:
        """Return what was measured, as far as the boards can."""
        if not self._sound:
            self._supervise()
        state = super().state(sequence)
        rows = state.rows
        rows["boots"] = self._boots
        if self._sound:
            return state
        rows["temperature"][self._faults.hot_motor] = _HOT
        dead = self._faults.dead_board
        for field in ("length", "velocity", "tension", "temperature"):
            rows[field][dead] = self._last[field][dead]
        return state
