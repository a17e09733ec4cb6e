"""Serialised decisions are bit for bit the ordinary messages."""

from types import SimpleNamespace
from typing import Any

from builtin_interfaces.msg import Duration, Time
from hypothesis import given, settings
from hypothesis import strategies as st
from std_msgs.msg import Header

from fastswing_inhibitor.decision_messages import (
    KEPT_TEMPLATES,
    DecisionMessages,
    RawDecisionMessages,
)
from fastswing_inhibitor.inhibition import Decision, Reason
from fastswing_inhibitor.latency_histogram import LatencyHistogram
from fastswing_msgs.msg import CurrentOverride
from fastswing_planner.conversion.message_template import MessageTemplate

LEASE = Duration(nanosec=50_000_000)

headers = st.builds(
    lambda sec, nanosec, frame: Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=frame),
    st.integers(0, 2**31 - 1),
    st.integers(0, 999_999_999),
    st.sampled_from(["", "base"]),
)


@st.composite
def decisions(draw: st.DrawFn, muscles: int = 6) -> Decision:
    some = st.lists(st.booleans(), min_size=muscles, max_size=muscles)
    arms = st.lists(st.floats(), min_size=muscles, max_size=muscles)
    return Decision(tuple(draw(some)), draw(arms), draw(st.booleans()), Reason.NONE)


class Both:
    """Both kinds of messages, of one inhibitor."""

    def __init__(self, muscles: int = 6) -> None:
        self.inhibition = SimpleNamespace(
            armed=True,
            threshold=0.5,
            decisions=0,
            rejected=0,
            speed_index=lambda decision: tuple(decision.moment_arm),
        )
        self.latency = LatencyHistogram()
        state: Any = self.inhibition
        names = [f"#{number}" for number in range(muscles)]
        self.ordinary = DecisionMessages(names, LEASE, state, self.latency)
        self.raw = RawDecisionMessages(self.ordinary, state, self.latency)

    def agree(self, header: Header, decision: Decision) -> bool:
        """Whether both make the same of a decision, the first time and from then on."""
        override = bits(self.ordinary.override(header, decision))
        first = bits(self.raw.override(header, decision))
        status = self.raw.status(header, decision)
        return (
            first == override
            and self.raw.override(header, decision) == override
            and status == bits(self.ordinary.status(header, decision))
        )


def bits(message: Any) -> bytes:
    return message if isinstance(message, bytes) else MessageTemplate(message, ()).filled()


@settings(deadline=None, derandomize=True)
@given(st.lists(st.tuples(headers, decisions()), min_size=1, max_size=6), st.data())
def test_serialised_messages_are_the_ordinary_ones(
    given_decisions: list[tuple[Header, Decision]], data: st.DataObject
) -> None:
    both = Both()
    for header, decision in given_decisions:
        both.inhibition.threshold = data.draw(st.floats())
        both.inhibition.decisions += 1
        both.inhibition.rejected = data.draw(st.integers(0, 2**64 - 1))
        both.latency.add(data.draw(st.floats(0.0, 1.0)))
        assert both.agree(header, decision)


def test_more_sets_of_muscles_than_are_kept_are_served_too() -> None:
    both = Both(muscles=8)
    for number in range(2 * KEPT_TEMPLATES):
        inhibited = tuple(bool(number >> bit & 1) for bit in range(8))
        decision = Decision(inhibited, (0.0,) * 8, False, Reason.NONE)
        assert both.agree(Header(), decision)


def test_the_first_override_of_a_set_of_muscles_waits_for_no_template() -> None:
    both, decision = Both(), Decision((True,) * 6, (0.0,) * 6, False, Reason.NONE)
    assert isinstance(both.raw.override(Header(), decision), CurrentOverride)
    both.raw.status(Header(), decision)
    assert isinstance(both.raw.override(Header(), decision), bytes)


def test_a_plain_header_is_that_of_the_joint_state() -> None:
    both, decision = Both(), Decision((True,) * 6, (0.0,) * 6, False, Reason.NONE)
    plain: Any = SimpleNamespace(stamp=SimpleNamespace(sec=7, nanosec=9), frame_id="base")
    header = Header(stamp=Time(sec=7, nanosec=9), frame_id="base")
    assert both.ordinary.override(plain, decision) == both.ordinary.override(header, decision)
    assert both.raw.status(plain, decision) == both.raw.status(header, decision)
    assert both.raw.override(plain, decision) == both.raw.override(header, decision)
