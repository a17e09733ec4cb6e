"""Decides, muscle by muscle, what the boards are told; without clock or I/O.

Highest wins: emergency stop or fault > muscle kept at its length (its bus was lost) >
zero-current override > current > tension > length.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import BoolVector, Vector, frozen, read_only
from musashi_muscle_bridge.buses.protocol import Mode
from musashi_muscle_bridge.control.command_checks import check_lease
from musashi_muscle_bridge.control.command_limits import CommandLimits
from musashi_muscle_bridge.control.command_streams import CommandStreams

ModeVector = NDArray[np.uint8]

# Plain numbers: numpy takes them much faster than an enumeration's members.
_ZERO_CURRENT, _LENGTH = int(Mode.ZERO_CURRENT), np.uint8(Mode.LENGTH)

_ALL = slice(None)
_MAX_STEP_SEC = 0.05
"""[s] After a stall a setpoint that moves back into place goes on, it does not catch up."""


class Setpoints(NamedTuple):
    """What the boards are told; shape (m,), [m], [N] or [A] by mode."""

    mode: ModeVector
    value: Vector


class CommandArbiter:
    """Holds the commands of all sources, and picks. Times are monotonic [s]."""

    def __init__(self, muscle_names: Sequence[str], limits: CommandLimits) -> None:
        """Start without commands: every muscle holds its measured length."""
        self.muscle_names = tuple(muscle_names)
        self._limits = limits
        self._range = {
            Mode.LENGTH: (limits.length_min, limits.length_max),
            Mode.TENSION: (np.zeros_like(limits.tension_max), limits.tension_max),
            Mode.CURRENT: (np.zeros_like(limits.current_max), limits.current_max),
        }
        count = len(self.muscle_names)
        self._target = np.full(count, np.nan)  # latched length; NaN: hold the measured one
        self._active = np.full(count, np.nan)  # length sent last; NaN: not in length mode
        self._engaging = np.zeros(count, dtype=bool)
        self._restarted = np.zeros(count, dtype=bool)  # holds what it measured, not a command
        self._streams = CommandStreams(count, limits.stream_timeout)
        self._override_until = np.full(count, -np.inf)
        self._overriding = False  # somebody asked for an override that may not have ended yet
        self._faulty = np.zeros(count, dtype=bool)
        self._kept = np.zeros(count, dtype=bool)
        self._some_kept = False
        self._forgotten_until = np.full(count, -np.inf)  # [s] commands made before say nothing
        self._now = -np.inf
        self._at_target = False  # every muscle was sent its latched length, by the last update
        self._sent: Setpoints | None = None  # what stays valid until the next length command
        # Who was at zero current and what was sent, while no muscle moves and nobody commands.
        self._still: tuple[bytes, Setpoints] | None = None
        self._all_length = np.full(count, Mode.LENGTH, dtype=np.uint8)
        self._all_length.setflags(write=False)
        self.emergency = False
        self.clamped = 0
        self.outdated = 0

    # Commands.

    def command(self, mode: Mode, index: Sequence[int] | slice, values: Vector, now: float) -> None:
        """Take a checked length [m], tension [N] or current [A] command for some muscles.

        now  when it was made: one from before a hold, or before faults were cleared, may come after
             it, and is counted as outdated
        """
        self._still = None
        chosen = index if isinstance(index, slice) else np.asarray(index, dtype=int)
        outdated = now < self._forgotten_until[chosen]
        too_late = int(np.count_nonzero(outdated))
        self.outdated += too_late
        if too_late or self._some_kept:
            free = ~(outdated | self._kept[chosen])
            chosen, values = np.arange(self._kept.size)[chosen][free], values[free]
        if mode is not Mode.LENGTH:
            self._at_target = False
        low, high = self._range[mode]
        clamped = np.minimum(np.maximum(values, low[chosen]), high[chosen])
        self.clamped += int(np.count_nonzero(clamped != values))
        if mode is Mode.LENGTH:
            self._target[chosen] = clamped
            self._sent = None
            if self._at_target:
                return
            self._engaging[chosen] |= self._restarted[chosen]
            self._restarted[chosen] = False
            self._streams.forget_ended(chosen, now)
        else:
            self._streams.take(mode, chosen, clamped, now)

    def override(self, index: Sequence[int], lease: float, now: float) -> None:
        """Force muscles to zero current until `now + lease` [s]; releases all others.

        Raises CommandRejected for a lease that is not positive or too long.
        """
        if index:
            check_lease(lease, self._limits.max_lease)
        if not index and not self._overriding:
            return
        self._overriding = len(index) > 0
        self._at_target = False
        self._override_until.fill(-np.inf)
        if index:
            self._override_until[np.asarray(index, dtype=int)] = now + lease

    def emergency_stop(self) -> None:
        """Zero current on every muscle until the faults are cleared."""
        self.emergency = True
        self._at_target = False

    def keep(self, which: BoolVector) -> None:
        """Hold the measured lengths of some muscles, shape (m,), whatever is commanded.

        Latched like a fault, until the faults are cleared; only a fault or a stop is stronger.
        """
        new = which & ~self._kept
        if not np.count_nonzero(new):
            return
        self._kept |= new
        self._some_kept = True
        self.hold(np.flatnonzero(new))

    def hold(self, index: NDArray[np.intp] | slice = _ALL, now: float | None = None) -> None:
        """Forget the commands of some muscles: they hold their measured length.

        now  what was commanded before it is forgotten even if it comes later; None: the last update
        """
        now = self._now if now is None else now
        self._at_target = False
        self._still = None
        self._forgotten_until[index] = np.maximum(self._forgotten_until[index], now)
        self._target[index] = np.nan
        self._active[index] = np.nan
        self._streams.forget(index)

    def clear_faults(self, now: float | None = None) -> None:
        """End the emergency stop; afterwards every muscle holds its measured length; see `hold`."""
        self.emergency = False
        self._faulty[:] = False
        self._kept[:] = False
        self._some_kept = False
        self.hold(now=now)

    @property
    def latched(self) -> BoolVector:
        """Muscles that no command moves until faults are cleared, shape (m,)."""
        return self._faulty | self._kept

    # The decision.

    def overridden(self, now: float) -> BoolVector:
        """Return which muscles an override holds at zero current, shape (m,)."""
        return now < self._override_until

    def update(self, now: float, length: Vector, tension: Vector, faulty: BoolVector) -> Setpoints:
        """Return what to tell the boards at `now`, from measured lengths [m] and tensions [N].

        faulty  muscles whose boards report a fault; they stay at zero current until cleared, and
                so does a muscle whose measurement is not finite
        """
        elapsed = 0.0 if self._now == -np.inf else min(max(now - self._now, 0.0), _MAX_STEP_SEC)
        self._now = max(now, self._now)
        if self._at_target and not np.count_nonzero(faulty):
            # Nothing but new length commands since every muscle followed them: it still does.
            if self._sent is None:
                self._active[...] = self._target
                self._sent = Setpoints(self._all_length, frozen(self._target))
            return self._sent
        self._sent = None
        self._faulty |= faulty | ~np.isfinite(length + tension)
        off = self._off()
        if self._still is not None and self._still[0] == off.tobytes():
            self._at_target = not np.count_nonzero(off)
            return self._still[1]
        mode, value = self._all_length.copy(), np.zeros(length.size)
        if self._streams.running:
            # A stream, even an ended one, replaces the latched length: the muscle then holds.
            self._target[self._streams.write(self._now, mode, value)] = np.nan
        mode[off] = _ZERO_CURRENT
        value[off] = 0.0
        in_length = mode == _LENGTH
        np.copyto(value, self._lengths(in_length, length, tension, elapsed), where=in_length)
        mode.setflags(write=False)
        setpoints = Setpoints(mode, read_only(value))
        moving = self._streams.running or np.count_nonzero(self._engaging | self._restarted) > 0
        self._still = None if moving else (off.tobytes(), setpoints)
        self._at_target = not moving and np.count_nonzero(in_length) == in_length.size
        return setpoints

    def _off(self) -> BoolVector:
        """Return which muscles are at zero current now, whatever else is commanded."""
        off = self.overridden(self._now)
        if self._some_kept:
            off &= ~self._kept
        off |= self._faulty
        if self.emergency:
            off[:] = True
        return off

    def _lengths(
        self, in_length: BoolVector, length: Vector, tension: Vector, elapsed: float
    ) -> Vector:
        entering = in_length & np.isnan(self._active)
        self._active[~in_length] = np.nan
        if np.count_nonzero(entering):
            self._active[entering] = length[entering]
            self._engaging |= entering
        holding = in_length & np.isnan(self._target)
        if np.count_nonzero(holding):
            self._hold_active(holding)
        moved = self._target
        if np.count_nonzero(self._engaging):
            moved = self._engaged(tension, elapsed)
            self._engaging &= in_length & (moved != self._target)
        np.copyto(self._active, moved, where=in_length)
        return self._active

    def _engaged(self, tension: Vector, elapsed: float) -> Vector:
        """Bumpless: from the measured length to the commanded one within speed and tension limits.

        Return the next lengths [m], shape (m,).
        """
        reach = self._limits.velocity * elapsed
        change = np.minimum(np.maximum(self._target - self._active, -reach), reach)
        change[(tension > self._limits.tension_max) & (change < 0.0)] = 0.0
        moved = self._target.copy()
        np.add(self._active, change, out=moved, where=self._engaging)
        return moved

    def _hold_active(self, holding: BoolVector) -> None:
        low, high = self._range[Mode.LENGTH]
        self._target[holding] = np.clip(self._active, low, high)[holding]
        self._restarted |= holding
