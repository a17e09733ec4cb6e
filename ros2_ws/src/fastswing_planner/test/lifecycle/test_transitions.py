"""A refusal keeps the node where it is, a defect is an error; both are logged."""

from typing import cast

import pytest
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.lifecycle import TransitionCallbackReturn

from fastswing_planner.errors import InvalidParameter
from fastswing_planner.lifecycle.transitions import attempt


class Log:
    def __init__(self) -> None:
        self.lines: list[str] = []

    def error(self, text: str) -> None:
        self.lines.append(text)


def outcome(error: Exception | None) -> tuple[TransitionCallbackReturn, list[str]]:
    def action() -> None:
        if error is not None:
            raise error

    log = Log()
    return attempt("configure", action, cast(RcutilsLogger, log)), log.lines


def test_what_raises_nothing_succeeds() -> None:
    assert outcome(None) == (TransitionCallbackReturn.SUCCESS, [])


def test_a_refusal_fails_with_its_text() -> None:
    refused = outcome(InvalidParameter("rate is 0"))
    assert refused == (TransitionCallbackReturn.FAILURE, ["cannot configure: rate is 0"])


def test_a_defect_is_logged_with_its_place() -> None:
    result, (line,) = outcome(ZeroDivisionError("oops"))
    assert result is TransitionCallbackReturn.ERROR
    assert "in action" in line


def test_an_interruption_is_not_caught() -> None:
    with pytest.raises(KeyboardInterrupt):
        attempt("configure", interrupt, cast(RcutilsLogger, Log()))


def interrupt() -> None:
    raise KeyboardInterrupt
