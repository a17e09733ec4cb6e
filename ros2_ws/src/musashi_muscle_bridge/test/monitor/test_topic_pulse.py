"""A topic's rate and age, from some of its messages."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from musashi_muscle_bridge.monitor.topic_pulse import TopicPulse


@given(
    rate=st.floats(5.0, 2000.0),
    pauses=st.lists(st.floats(0.05, 0.3), min_size=15, max_size=60),
)
def test_the_rate_of_an_even_topic_is_found_from_the_messages_looked_at(
    rate: float, pauses: list[float]
) -> None:
    pulse = TopicPulse()
    looked = 0.0
    for pause in pauses:
        looked += pause
        newest = int(looked * rate)
        if newest:
            pulse.heard(newest, newest / rate)
    assert pulse.rate(looked) == pytest.approx(rate, rel=0.02)


def test_a_message_that_is_looked_at_twice_starts_nothing_anew() -> None:
    pulse = TopicPulse()
    for sequence, received in ((1, 0.0), (2, 0.1), (2, 0.1)):
        pulse.heard(sequence, received)
    assert pulse.rate(0.2) == pytest.approx(10.0)


def test_a_topic_that_nobody_published_is_infinitely_old() -> None:
    assert TopicPulse().age(1.0) == math.inf


def test_a_silent_topic_has_rate_0() -> None:
    pulse = TopicPulse()
    pulse.heard(1, 0.0)
    pulse.heard(2, 0.1)
    assert pulse.rate(10.0) == 0.0


def test_a_topic_without_sequence_numbers_has_an_unknown_rate_and_an_age() -> None:
    pulse = TopicPulse()
    pulse.heard(0, 1.0)
    pulse.heard(0, 1.1)
    assert math.isnan(pulse.rate(1.2))
    assert pulse.age(1.2) == pytest.approx(0.1)


def test_a_publisher_that_started_again_does_not_go_backwards() -> None:
    pulse = TopicPulse()
    for sequence, received in ((1000, 0.0), (1010, 0.1), (1, 0.2), (11, 0.3)):
        pulse.heard(sequence, received)
    assert pulse.rate(0.3) == pytest.approx(100.0)
