"""A stop is done when bridge and inhibitor have confirmed it, and no muscle is limp."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from fastswing_planner.execution.measurements import MuscleMeasurement
from fastswing_planner.nodes.executor_links import ExecutorLinks
from fastswing_planner.nodes.stopping import Stopping, not_held

NOW = 10.0


class Call:
    """A service call that is answered when the test says so."""

    def __init__(self) -> None:
        self.answer: Any = None
        self._then: list[Callable[[Any], None]] = []

    def done(self) -> bool:
        return self.answer is not None

    def result(self) -> Any:
        return self.answer

    def add_done_callback(self, then: Callable[[Any], None]) -> None:
        self._then.append(then)

    def succeed(self, success: bool = True, message: str = "") -> None:
        self.answer = SimpleNamespace(success=success, message=message)
        for then in self._then:
            then(self)


class Service:
    """A client that notes its calls."""

    def __init__(self) -> None:
        self.there = True
        self.calls: list[Call] = []

    def service_is_ready(self) -> bool:
        return self.there

    def call_async(self, _request: Any) -> Call:
        self.calls.append(Call())
        return self.calls[-1]


class Links:
    """The two services that a stop needs."""

    def __init__(self) -> None:
        self.hold, self.disarm = Service(), Service()


@pytest.fixture
def links() -> Links:
    return Links()


def stopping(links: Links, moved: bool = True, arming: Call | None = None) -> Stopping:
    """Begin to stop, as a running swing does."""
    begun = Stopping(cast("ExecutorLinks", links))
    begun.begin(NOW, moved, cast("Any", arming))
    if moved:
        begun.hold()
        begun.disarm()
    return begun


def test_a_stop_that_could_not_ask_the_bridge_says_so(links: Links) -> None:
    begun = Stopping(cast("ExecutorLinks", links))
    begun.begin(NOW, True, None)
    assert begun.unconfirmed(None, False) == "; hold_posture is missing: is the bridge active?"


def muscles(time: float, **states: Any) -> MuscleMeasurement:
    return MuscleMeasurement(time, np.zeros(2), np.zeros(2), np.zeros(2), **states)


def test_what_moved_nothing_is_stopped_at_once(links: Links) -> None:
    assert stopping(links, moved=False).done(NOW, None)
    assert links.hold.calls == []


def test_it_waits_for_the_bridge_and_for_the_inhibitor(links: Links) -> None:
    stop = stopping(links)
    assert not stop.done(NOW + 0.1, muscles(NOW + 0.1))
    links.hold.calls[0].succeed()
    assert not stop.done(NOW + 0.2, muscles(NOW + 0.2))
    links.disarm.calls[0].succeed()
    stop.done(NOW + 0.3, muscles(NOW + 0.25))
    assert stop.done(NOW + 0.31, muscles(NOW + 0.305))


def confirmed(links: Links) -> Stopping:
    stop = stopping(links)
    links.hold.calls[0].succeed()
    links.disarm.calls[0].succeed()
    assert not stop.done(NOW + 0.1, muscles(NOW))
    return stop


def test_a_state_from_before_the_confirmation_says_nothing(links: Links) -> None:
    assert not confirmed(links).done(NOW + 0.2, muscles(NOW + 0.05))


@pytest.mark.parametrize("state", ["limp", "driven"])
def test_it_waits_for_a_muscle_that_does_not_hold_yet(links: Links, state: str) -> None:
    stop = confirmed(links)
    assert not stop.done(NOW + 0.2, muscles(NOW + 0.2, **{state: ("#9",)}))
    assert stop.done(NOW + 0.3, muscles(NOW + 0.3))


def test_it_does_not_wait_for_a_muscle_with_a_fault(links: Links) -> None:
    faulty = muscles(NOW + 0.2, limp=("#9",), faulty=("#9",))
    assert not_held(faulty) == ()
    assert confirmed(links).done(NOW + 0.2, faulty)


def test_it_waits_no_longer_than_the_longest_lease_for_muscles(links: Links) -> None:
    stop = confirmed(links)
    limp = muscles(NOW + 0.34, limp=("#9",))
    assert [stop.done(NOW + 0.1 + wait, limp) for wait in (0.24, 0.26)] == [False, True]


def test_it_waits_at_most_a_second_for_answers(links: Links) -> None:
    stop = stopping(links)
    assert [stop.done(NOW + wait, None) for wait in (0.99, 1.01)] == [False, True]


def test_an_arming_that_comes_late_is_taken_back(links: Links) -> None:
    arming = Call()
    stop = stopping(links, arming=arming)
    links.hold.calls[0].succeed()
    links.disarm.calls[0].succeed()
    assert not stop.done(NOW + 0.1, muscles(NOW + 0.1))
    arming.succeed()
    assert len(links.disarm.calls) == 2
    assert not stop.done(NOW + 0.2, muscles(NOW + 0.2))
    links.disarm.calls[1].succeed()
    stop.done(NOW + 0.3, muscles(NOW + 0.3))
    assert stop.done(NOW + 0.4, muscles(NOW + 0.35))


def told(links: Links, states: MuscleMeasurement | None = None, faults_told: bool = False) -> str:
    return stopping(links).unconfirmed(states, faults_told)


def test_a_missing_bridge_is_told(links: Links) -> None:
    links.hold.there = False
    assert told(links) == "; hold_posture is missing: is the bridge active?"


def test_a_bridge_that_does_not_answer_is_told(links: Links) -> None:
    assert told(links) == "; the bridge did not confirm that it holds the arm"


def test_a_bridge_that_refuses_is_told_with_its_reason(links: Links) -> None:
    stop = stopping(links)
    links.hold.calls[0].succeed(False, "emergency stop")
    text = "; the bridge does not hold the arm: emergency stop"
    assert stop.unconfirmed(None, False) == text


def test_an_inhibitor_that_does_not_answer_is_told(links: Links) -> None:
    stop = stopping(links)
    links.hold.calls[0].succeed()
    text = "; the inhibitor did not confirm that it is disarmed"
    assert stop.unconfirmed(None, False) == text


def test_muscles_that_do_not_hold_are_told_unless_the_error_does(links: Links) -> None:
    stop = confirmed(links)
    limp = muscles(NOW, limp=("#9",))
    assert stop.unconfirmed(limp, False) == "; muscles that do not hold a length: #9"
    assert stop.unconfirmed(limp, True) == ""


def test_a_stop_that_moved_nothing_has_nothing_to_confirm(links: Links) -> None:
    assert stopping(links, moved=False).unconfirmed(None, False) == ""
