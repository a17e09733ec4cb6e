"""A request that came too late is sent again, and no other."""

import pytest
from whole_loop import in_time

from fastswing_msgs.msg import ErrorCode
from fastswing_msgs.srv import ArmInhibitor


class Inhibitor:
    """Answers with the given codes, the last of them for ever."""

    def __init__(self, *codes: int) -> None:
        self.asked = 0
        self._codes = codes

    def __call__(self) -> ArmInhibitor.Response:
        code = self._codes[min(self.asked, len(self._codes) - 1)]
        self.asked += 1
        return ArmInhibitor.Response(error_code=code)


def test_a_request_that_came_too_late_is_sent_again() -> None:
    inhibitor = Inhibitor(ErrorCode.STALE_REQUEST, ErrorCode.STALE_REQUEST, ErrorCode.SUCCESS)
    assert in_time(inhibitor).error_code == ErrorCode.SUCCESS


@pytest.mark.parametrize("code", [ErrorCode.SUCCESS, ErrorCode.BUSY, ErrorCode.STALE_STATE])
def test_each_other_answer_counts(code: int) -> None:
    inhibitor = Inhibitor(code)
    assert (in_time(inhibitor).error_code, inhibitor.asked) == (code, 1)


def test_who_is_always_too_late_is_told_so() -> None:
    inhibitor = Inhibitor(ErrorCode.STALE_REQUEST)
    assert (in_time(inhibitor).error_code, inhibitor.asked) == (ErrorCode.STALE_REQUEST, 5)
