"""Is a muscle wired the right way round? One small pull tells; time comes in with each reading."""

from dataclasses import dataclass
from enum import Enum

from fastswing_planner.arrays import Vector


class Verdict(Enum):
    """What a pull showed; the value tells a person what to do."""

    SOUND = "sound: the tension rose and the wire shortened"
    LENGTH_SIGN = "the tension rose and the length grew: the encoder counts backwards"
    TENSION_SIGN = "the wire shortened and the tension fell: the tension sensor is reversed"
    MOTOR_SIGN = "the length grew and the tension fell: the motor turns backwards"
    NO_TENSION = "the wire shortened without tension: it is slack or broken"
    UNCLEAR = "too little changed to tell: a larger current, or a blocked spool"
    NOT_FOLLOWED = "the board did not follow the current: is the bridge read-only?"
    INTERRUPTED = "somebody ended the pull: an emergency stop, a hold, an override?"
    FAULT = "a board reported a fault: see muscle_state"


@dataclass(frozen=True)
class PullSettings:
    """How hard a muscle is pulled, and what counts; all positive.

    current_step      [A] on top of the current that the muscle had
    ramp_time         [s] until the whole step is reached
    hold_time         [s] of the whole step
    least_rise        [N] change of tension that counts
    least_shortening  [m] change of length that counts
    most_travel       [m] change of length that ends the pull at once, either way
    """

    current_step: float = 0.3
    ramp_time: float = 1.0
    hold_time: float = 0.3
    least_rise: float = 3.0
    least_shortening: float = 2e-4
    most_travel: float = 0.02


@dataclass(frozen=True)
class MuscleReading:
    """One muscle at one time: [s], [m], [N], [A].

    follows  its board is in current mode
    """

    time: float
    length: float
    tension: float
    current: float
    follows: bool
    fault: bool


class Pull:
    """One muscle's pull, from the reading before it.

    verdict     None until it is over
    rise        [N] change of tension so far
    shortening  [m] change of length so far, shorter is positive
    """

    def __init__(self, settings: PullSettings, before: MuscleReading, current_limit: float) -> None:
        """`current_limit` [A] is never exceeded."""
        self._settings = settings
        self._before = before
        self._current_limit = current_limit
        self._followed = False
        self.verdict: Verdict | None = None
        self.rise = 0.0
        self.shortening = 0.0

    def step(self, reading: MuscleReading) -> float | None:
        """Return the current to command now [A], or None when the pull is over."""
        settings, before = self._settings, self._before
        elapsed = reading.time - before.time
        self._followed |= reading.follows
        self.rise = reading.tension - before.tension
        self.shortening = before.length - reading.length
        too_far = abs(self.shortening) > settings.most_travel
        if reading.fault:
            self.verdict = Verdict.FAULT
        elif self._followed and not reading.follows:
            self.verdict = Verdict.INTERRUPTED
        elif too_far or elapsed > settings.ramp_time + settings.hold_time:
            self.verdict = self._judged()
        if self.verdict is not None:
            return None
        share = min(max(elapsed / settings.ramp_time, 0.0), 1.0)
        return min(max(before.current, 0.0) + share * settings.current_step, self._current_limit)

    def _judged(self) -> Verdict:
        if not self._followed:
            return Verdict.NOT_FOLLOWED
        return judge(self.rise, self.shortening, self._settings)


def judge(rise: float, shortening: float, settings: PullSettings) -> Verdict:
    """Return what a change of tension [N] and of length [m] under a larger current means."""
    shorter = shortening >= settings.least_shortening
    longer = shortening <= -settings.least_shortening
    if rise >= settings.least_rise:
        return Verdict.LENGTH_SIGN if longer else Verdict.SOUND if shorter else Verdict.UNCLEAR
    if rise <= -settings.least_rise:
        return Verdict.MOTOR_SIGN if longer else Verdict.TENSION_SIGN
    if longer:
        return Verdict.MOTOR_SIGN
    return Verdict.NO_TENSION if shorter else Verdict.UNCLEAR


def length_offsets(path: Vector, length: Vector, tension: Vector, stiffness: Vector) -> Vector:
    """Return what is to be added to the measured lengths [m], shape (m,).

    path       [m] wire lengths of the model in the measured posture, taut
    length     [m] measured at the encoders
    tension    [N] that stretches the wires
    stiffness  [N/m] of the wires
    """
    return path - tension / stiffness - length
