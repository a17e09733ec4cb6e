"""What a running swing knows of the inhibitor."""

import math

from fastswing_planner.errors import SwingNotReady
from fastswing_planner.execution.measurements import InhibitionReport


class InhibitorWatch:
    """Whether the inhibitor is asked, armed, heard, and done.

    armed  it confirmed that it is armed
    over   it reached the goal
    """

    def __init__(self) -> None:
        """Begin with an inhibitor that was not asked."""
        self.armed = False
        self.over = False
        self._asked_at = math.inf
        self._heard = -math.inf
        self._lost = ""

    @property
    def asked(self) -> bool:
        """Whether it was asked to arm, so that muscles may be at zero current."""
        return self._asked_at < math.inf

    def ask(self, now: float) -> None:
        """Take note that it is asked to arm at time `now` [s]."""
        self._asked_at = now

    def add(self, report: InhibitionReport, needed: bool) -> None:
        """Take a report.

        needed  whether the swing has to stop if it disarmed itself before the goal
        """
        # The middleware repeats what was lost: the end of an earlier swing may arrive in this one.
        if report.time < self._asked_at:
            return
        if report.armed:
            self._heard = max(self._heard, report.time)
        elif report.reached:
            self.over = self.armed
        elif self.armed and needed:
            self._lost = report.reason

    def refuse_lost(self) -> None:
        """Raise SwingNotReady if it disarmed itself while it was needed."""
        if self._lost:
            raise SwingNotReady(f"the inhibitor disarmed itself: {self._lost}")

    def refuse_silent(self, since: float, until: float, timeout: float) -> None:
        """Raise SwingNotReady if it told nothing for longer than `timeout` [s].

        since  [s] when the swing began
        until  [s] of the last joint state: it decides when one comes, so it may be silent as long
               as none does
        """
        silence = until - max(self._heard, since)
        if silence > timeout:
            raise SwingNotReady(f"the inhibitor has been silent for {silence:.2f} s")
