"""How a swing is stopped: the bridge holds the arm, the inhibitor is disarmed, both confirm it."""

from rclpy.task import Future
from std_srvs.srv import Trigger

from fastswing_planner.execution.measurements import MuscleMeasurement
from fastswing_planner.nodes.executor_links import ExecutorLinks

_CONFIRM_SEC = 1.0
"""Longest wait for bridge and inhibitor when a swing is stopped."""
_RELEASE_SEC = 0.25
"""Then as long for muscles that the inhibitor let go: the longest lease, and some way."""


class Stopping:
    """What is asked of bridge and inhibitor when a swing ends, and what they answered.

    Call `begin` when the swing has to stop, then `hold`, and `done` until it is.
    """

    def __init__(self, links: ExecutorLinks) -> None:
        """Ask nothing yet."""
        self._links = links
        self._deadline = 0.0
        self._moved = False
        self._holding: Future | None = None
        self._arming: Future | None = None
        self._disarming: list[Future] = []
        self._confirmed: float | None = None  # [s] when both had confirmed it

    def begin(self, now: float, moved: bool, arming: Future | None) -> None:
        """Begin to stop at time `now` [s].

        moved   whether the arm may have been moved; a plan alone has moved nothing
        arming  a call that arms the inhibitor and was not answered yet
        """
        self._deadline = now + _CONFIRM_SEC
        self._moved = moved
        self._arming = arming
        if arming is not None:
            # An arming that is still on its way must not outlive the swing.
            arming.add_done_callback(self._on_late_arming)

    def hold(self) -> bool:
        """Have the bridge hold the measured lengths; False if there is none to ask.

        The bridge knows best where the arm is: our states may be old.
        """
        if not self._links.hold.service_is_ready():
            return False
        self._holding = self._links.hold.call_async(Trigger.Request())
        return True

    def disarm(self) -> None:
        """Disarm the inhibitor, if there is one; also at the end of a swing that went well."""
        if self._links.disarm.service_is_ready():
            self._disarming.append(self._links.disarm.call_async(Trigger.Request()))

    def _on_late_arming(self, _arming: Future) -> None:
        self._arming = None
        self.disarm()

    def done(self, now: float, muscles: MuscleMeasurement | None) -> bool:
        """Return whether the arm is held: both say so, and no muscle is limp. Or it is too late.

        muscles  the newest measurement
        """
        calls = [*self._disarming, *filter(None, (self._holding, self._arming))]
        confirmed = all(call.done() for call in calls)
        if now > self._deadline or not self._moved:
            return now > self._deadline or confirmed
        if not confirmed:
            self._confirmed = None  # an arming that came late is taken back by one more call
            return False
        self._confirmed = now if self._confirmed is None else self._confirmed
        # The inhibitor's last override may still be on its way to the bridge when both answer.
        seen = muscles is not None and muscles.time > self._confirmed and not not_held(muscles)
        return seen or now > self._confirmed + _RELEASE_SEC

    def unconfirmed(self, muscles: MuscleMeasurement | None, faults_told: bool) -> str:
        """Return what was not confirmed, as the end of an error's text; empty if all was.

        faults_told  the error itself tells of muscles that do not hold
        """
        if not self._moved:
            return ""
        if self._holding is None:
            return "; hold_posture is missing: is the bridge active?"
        if not self._holding.done():
            return "; the bridge did not confirm that it holds the arm"
        answer = self._holding.result()
        if not answer.success:
            return f"; the bridge does not hold the arm: {answer.message}"
        if not all(call.done() for call in self._disarming):
            return "; the inhibitor did not confirm that it is disarmed"
        loose = () if muscles is None else not_held(muscles)
        if loose and not faults_told:
            return f"; muscles that do not hold a length: {', '.join(loose)}"
        return ""


def not_held(muscles: MuscleMeasurement) -> tuple[str, ...]:
    """Return the muscles that somebody let go or drives, without those that have a fault."""
    return tuple(name for name in muscles.limp + muscles.driven if name not in muscles.faulty)
