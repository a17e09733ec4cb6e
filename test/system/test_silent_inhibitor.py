"""Reports of the inhibitor are as old as their stamps say, whenever they arrive."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest
from lifecycle_msgs.msg import State
from std_srvs.srv import Trigger

from fastswing_msgs.msg import ErrorCode, InhibitionStatus, SwingOptions
from fastswing_msgs.srv import ArmInhibitor

if TYPE_CHECKING:
    from test.system.suite import Suite


SILENT = "the inhibitor has been silent for"
ATTEMPTS = 4


class FeignedInhibitor:
    """Arms whenever it is asked to, inhibits nothing, and reports with stamps that are late."""

    def __init__(self, suite: "Suite") -> None:
        self.suite = suite
        self.late_sec = 0
        node = suite.node
        self._reports = node.create_publisher(InhibitionStatus, "inhibition_status", 10)
        node.create_service(ArmInhibitor, "arm_inhibitor", lambda _request, answer: answer)
        node.create_service(Trigger, "disarm_inhibitor", self._disarm)
        node.create_timer(0.02, self._report)

    @staticmethod
    def _disarm(_request: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:
        answer.success = True
        return answer

    def _report(self) -> None:
        header = self.suite.now()
        header.stamp.sec -= self.late_sec
        self._reports.publish(InhibitionStatus(header=header, armed=True))

    def end_of_swing(self, late_sec: int) -> tuple[int, str]:
        """Return how a swing ends that the machine did not spoil by a stall."""
        self.late_sec = late_sec
        goal = self.suite.goal(options=SwingOptions(method=SwingOptions.METHOD_INHIBIT))
        for _ in range(ATTEMPTS):
            self.suite.hold()
            result = self.suite.execute(goal)
            if result.error_code in (ErrorCode.SUCCESS, ErrorCode.NOT_READY):
                break
            goal.stamp = type(goal.stamp)()
        return result.error_code, result.error_string


@pytest.fixture(scope="module")
def feigned(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FeignedInhibitor]:
    from test.system.suite import Suite

    suite = Suite(tmp_path_factory.mktemp("feigned"))
    try:
        suite.start("bridge", watchdog_timeout=1.0)
        suite.start("swing_executor", state_timeout=0.5)
        suite.start("mock_driver")
        suite.start("planner")
        for name in ("mock_driver", "bridge", "planner", "swing_executor"):
            suite.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)
        inhibitor = FeignedInhibitor(suite)
        suite.hold()
        suite.wait_until_swings_are_judged()
        yield inhibitor
    finally:
        suite.close()


def test_reports_in_time_let_a_swing_go_on(feigned: FeignedInhibitor) -> None:
    assert feigned.end_of_swing(late_sec=0) == (ErrorCode.SUCCESS, "")


def test_a_backlog_of_old_reports_is_no_news(feigned: FeignedInhibitor) -> None:
    code, text = feigned.end_of_swing(late_sec=60)
    assert (code, text[: len(SILENT)]) == (ErrorCode.NOT_READY, SILENT)
