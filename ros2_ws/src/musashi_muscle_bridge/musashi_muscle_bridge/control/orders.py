"""What is asked of the control process: data on its way there, done between two frames.

Check before what an order does: one that raises ends the control process.
"""

from dataclasses import dataclass
from typing import Protocol

from fastswing_planner.arrays import Vector
from musashi_muscle_bridge.buses.protocol import Mode
from musashi_muscle_bridge.control.period import ControlPeriod


class Order(Protocol):
    """Anything that can be done to a ControlPeriod."""

    def carry_out(self, control: ControlPeriod) -> None:
        """Do it."""


@dataclass(frozen=True)
class Command:
    """A checked length [m], tension [N] or current [A] command, made at `made` [s], monotonic.

    index   of the muscles
    values  shape (len(index),)
    """

    mode: Mode
    index: list[int]
    values: Vector
    made: float

    def carry_out(self, control: ControlPeriod) -> None:
        """Give it to the arbiter."""
        control.arbiter.command(self.mode, self.index, self.values, self.made)


@dataclass(frozen=True)
class Override:
    """A zero-current override with its lease [s], which counts from `made` [s], monotonic."""

    index: list[int]
    lease: float
    made: float

    def carry_out(self, control: ControlPeriod) -> None:
        """Give it to the arbiter."""
        control.arbiter.override(self.index, self.lease, self.made)


@dataclass(frozen=True)
class EmergencyStop:
    """Zero current everywhere; whatever was ordered before it is forgotten."""

    def carry_out(self, control: ControlPeriod) -> None:
        """Stop."""
        control.arbiter.emergency_stop()


@dataclass(frozen=True)
class ClearFaults:
    """Clear the boards' faults and the emergency stop; commands from before `made` [s] are over."""

    made: float

    def carry_out(self, control: ControlPeriod) -> None:
        """Clear."""
        control.clear_faults(self.made)


@dataclass(frozen=True)
class Hold:
    """Hold the measured lengths; commands from before `made` [s], monotonic, are over."""

    made: float

    def carry_out(self, control: ControlPeriod) -> None:
        """Hold."""
        control.arbiter.hold(now=self.made)


@dataclass(frozen=True)
class Heartbeat:
    """Nothing but a sign that the node lives, and would hear an emergency stop."""

    def carry_out(self, control: ControlPeriod) -> None:
        """Do nothing."""


def after_the_last_stop(orders: list[Order]) -> list[Order]:
    """Return the last emergency stop and what came later: a clearing before it must not follow."""
    stops = [place for place, order in enumerate(orders) if isinstance(order, EmergencyStop)]
    return orders[stops[-1] :] if stops else orders
