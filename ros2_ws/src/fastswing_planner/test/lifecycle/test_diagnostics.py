"""Diagnostics say what the robot needs first, and never hide what is wrong with the node."""

from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.lifecycle.diagnostics import Health

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
levels = st.sampled_from((OK, WARN, ERROR))


@given(levels, st.text(), st.booleans())
def test_a_healthy_node_reports_what_it_says_itself(
    level: bytes, summary: str, active: bool
) -> None:
    assert Health().within((level, summary, {"rate": 5}), active) == (
        level,
        summary,
        {"active": active, "callback_errors": 0, "not_granted": "", "rate": 5},
    )


@given(levels, st.integers(1, 1000))
def test_a_defect_is_always_an_error(level: bytes, errors: int) -> None:
    health = Health()
    health.callback_errors = errors
    assert health.within((level, "ok", {}), True)[0] == ERROR


def test_what_the_node_says_of_the_robot_comes_before_its_defect() -> None:
    health = Health()
    health.callback_errors = 1
    _, summary, _ = health.within((WARN, "muscle #3 is hot", {}), True)
    assert summary == "muscle #3 is hot; defect in a callback, see the log"


def test_a_refusal_that_was_asked_for_is_a_warning() -> None:
    health = Health()
    health.refused("realtime_priority 50 refused")
    level, summary, values = health.within((OK, "ok", {}), True)
    assert (level, summary) == (WARN, "realtime_priority 50 refused")
    assert values["not_granted"] == "realtime_priority 50 refused"


def test_a_refusal_that_nobody_asked_for_is_only_named() -> None:
    health = Health()
    health.refused("cores may sleep", asked=False)
    level, summary, values = health.within((OK, "ok", {}), True)
    assert (level, summary, values["not_granted"]) == (OK, "ok", "cores may sleep")


def test_a_refusal_does_not_hide_what_is_worse() -> None:
    health = Health()
    health.refused("realtime_priority 50 refused")
    assert health.within((ERROR, "bus lost", {}), True)[:2] == (ERROR, "bus lost")


def test_a_refusal_is_new_once() -> None:
    health = Health()
    assert [health.refused("no"), health.refused("no")] == [True, False]


def test_a_forgotten_refusal_is_told_no_more() -> None:
    health = Health()
    health.refused("no")
    health.forget_refusals()
    assert health.within((OK, "ok", {}), True)[:2] == (OK, "ok")
