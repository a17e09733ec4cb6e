"""Everything that one run of the analysis found: what text, record and page tell."""

from collections.abc import Sequence
from dataclasses import dataclass

from fastswing_planner.analysis.findings import BagFindings
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.motor_limits import MotorLimits
from fastswing_planner.analysis.verdicts.checks import CheckResult
from fastswing_planner.analysis.verdicts.comparison import Comparison


@dataclass(frozen=True)
class Results:
    """What was found in bags.

    findings    of each bag
    limits      the robot's; empty: not known
    check       against criteria; None: there were none
    comparison  of two groups of the swings; None: there are none
    """

    findings: Sequence[BagFindings]
    limits: MotorLimits
    check: CheckResult | None = None
    comparison: Comparison | None = None

    @property
    def swings(self) -> list[MeasuredSwing]:
        """The swings of all bags."""
        return [swing for one in self.findings for swing in one.swings]
