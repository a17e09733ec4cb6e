"""Decides, muscle by muscle, what the boards are told; without clock or I/O.

Highest wins: emergency stop or fault > zero-current override > current > tension > length.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import BoolVector, Vector, frozen
from musashi_muscle_bridge.errors import CommandRejected
from musashi_muscle_bridge.protocol import Mode

ModeVector = NDArray[np.uint8]


@dataclass(frozen=True)
class CommandLimits:
    """What commands are clamped to; vectors of shape (m,).

    length_min, length_max  [m]
    tension_max             [N] of a tension command
    current_max             [A] magnitude of a current command
    velocity                [m/s] of re-engaging
    stream_timeout          [s] without a tension or current command until the muscle holds
    max_lease               [s]
    """

    length_min: Vector
    length_max: Vector
    tension_max: Vector
    current_max: Vector
    velocity: Vector
    stream_timeout: float
    max_lease: float


@dataclass(frozen=True)
class Setpoints:
    """What the boards are told; shape (m,), [m], [N] or [A] by mode."""

    mode: ModeVector
    value: Vector


class CommandArbiter:
    """Holds the commands of all sources, and picks. Times are monotonic [s]."""

    def __init__(self, muscle_names: Sequence[str], limits: CommandLimits) -> None:
        """Start without commands: every muscle holds its measured length."""
        self.muscle_names = tuple(muscle_names)
        self._limits = limits
        count = len(self.muscle_names)
        self._target = np.full(count, np.nan)  # latched length; NaN: hold the measured one
        self._active = np.full(count, np.nan)  # length sent last; NaN: not in length mode
        self._engaging = np.zeros(count, dtype=bool)
        self._restarted = np.zeros(count, dtype=bool)  # holds what it measured, not a command
        self._stream = {
            Mode.TENSION: (np.zeros(count), np.full(count, -np.inf)),
            Mode.CURRENT: (np.zeros(count), np.full(count, -np.inf)),
        }
        self._override_until = np.full(count, -np.inf)
        self._faulty = np.zeros(count, dtype=bool)
        self._now = -np.inf
        self.emergency = False
        self.clamped = 0

    # Commands.

    def command(self, mode: Mode, index: Sequence[int], values: Vector, now: float) -> None:
        """Take a checked length [m], tension [N] or current [A] command for some muscles."""
        chosen = np.asarray(index, dtype=int)
        low, high = {
            Mode.LENGTH: (self._limits.length_min, self._limits.length_max),
            Mode.TENSION: (np.zeros_like(self._limits.tension_max), self._limits.tension_max),
            Mode.CURRENT: (-self._limits.current_max, self._limits.current_max),
        }[mode]
        clamped = np.clip(values, low[chosen], high[chosen])
        self.clamped += int((clamped != values).sum())
        if mode is Mode.LENGTH:
            self._target[chosen] = clamped
            self._engaging[chosen] |= self._restarted[chosen]
            self._restarted[chosen] = False
            for _, received in self._stream.values():
                ended = now - received[chosen] > self._limits.stream_timeout
                received[chosen[ended]] = -np.inf
        else:
            stream, received = self._stream[mode]
            stream[chosen] = clamped
            received[chosen] = now

    def override(self, index: Sequence[int], lease: float, now: float) -> None:
        """Force muscles to zero current until `now + lease` [s]; releases all others.

        Raises CommandRejected for a lease that is not positive or too long.
        """
        if index and not 0.0 < lease <= self._limits.max_lease:
            raise CommandRejected(
                "lease", f"lease is {lease:g} s, expected 0 < lease <= {self._limits.max_lease:g} s"
            )
        self._override_until[:] = -np.inf
        self._override_until[np.asarray(index, dtype=int)] = now + lease

    def emergency_stop(self) -> None:
        """Zero current on every muscle until the faults are cleared."""
        self.emergency = True

    def hold(self) -> None:
        """Forget all commands: every muscle holds its measured length."""
        self._target[:] = np.nan
        self._active[:] = np.nan
        for _, received in self._stream.values():
            received[:] = -np.inf

    def clear_faults(self) -> None:
        """End the emergency stop; afterwards every muscle holds its measured length."""
        self.emergency = False
        self._faulty[:] = False
        self.hold()

    @property
    def latched(self) -> BoolVector:
        """Muscles kept at zero current by a fault until it is cleared, shape (m,)."""
        return self._faulty.copy()

    # The decision.

    def overridden(self, now: float) -> BoolVector:
        """Return which muscles an override holds at zero current, shape (m,)."""
        return now < self._override_until

    def update(self, now: float, length: Vector, tension: Vector, faulty: BoolVector) -> Setpoints:
        """Return what to tell the boards at `now`, from measured lengths [m] and tensions [N].

        faulty  muscles whose boards report a fault; they stay at zero current until cleared
        """
        elapsed = 0.0 if np.isinf(self._now) else max(now - self._now, 0.0)
        self._now = max(now, self._now)
        self._faulty |= faulty
        mode = np.full(length.size, Mode.LENGTH, dtype=np.uint8)
        value = np.zeros(length.size)
        for stream_mode in (Mode.TENSION, Mode.CURRENT):
            stream, received = self._stream[stream_mode]
            fresh = self._now - received <= self._limits.stream_timeout
            mode[fresh] = stream_mode
            value[fresh] = stream[fresh]
            # A stream, even an ended one, replaces the latched length: the muscle then holds.
            self._target[np.isfinite(received)] = np.nan
            received[~fresh] = -np.inf
        off = self.overridden(self._now) | self._faulty | self.emergency
        mode[off] = Mode.ZERO_CURRENT
        value[off] = 0.0
        in_length = mode == Mode.LENGTH
        value[in_length] = self._lengths(in_length, length, tension, elapsed)[in_length]
        return Setpoints(mode, frozen(value))

    def _lengths(
        self, in_length: BoolVector, length: Vector, tension: Vector, elapsed: float
    ) -> Vector:
        entering = in_length & np.isnan(self._active)
        self._active[~in_length] = np.nan
        self._active[entering] = length[entering]
        self._engaging |= entering
        holding = in_length & np.isnan(self._target)
        self._target[holding] = np.clip(
            self._active[holding],
            self._limits.length_min[holding],
            self._limits.length_max[holding],
        )
        self._restarted |= holding
        # Bumpless: from the measured length to the commanded one within speed and tension limits.
        reach = self._limits.velocity * elapsed
        change = np.clip(self._target - self._active, -reach, reach)
        change[(tension > self._limits.tension_max) & (change < 0.0)] = 0.0
        moved = np.where(self._engaging, self._active + change, self._target)
        self._engaging &= in_length & (moved != self._target)
        self._active[in_length] = moved[in_length]
        return self._active
