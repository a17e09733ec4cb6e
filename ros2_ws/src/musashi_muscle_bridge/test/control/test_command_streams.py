"""Tension and current commands hold until their time-out, muscle by muscle."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from musashi_muscle_bridge.buses.protocol import Mode
from musashi_muscle_bridge.control.command_streams import CommandStreams

TIMEOUT = 0.1
COUNT = 3
STREAM_MODES = (Mode.TENSION, Mode.CURRENT)


@pytest.fixture
def streams() -> CommandStreams:
    return CommandStreams(COUNT, TIMEOUT)


def written(streams: CommandStreams, now: float) -> tuple[list[int], list[float], list[bool]]:
    """Modes, values and who had a stream, over muscles that else follow lengths of 0 m."""
    mode, value = np.full(COUNT, Mode.LENGTH, dtype=np.uint8), np.zeros(COUNT)
    streamed = streams.write(now, mode, value)
    return mode.tolist(), value.tolist(), streamed.tolist()


def test_without_commands_nothing_runs(streams: CommandStreams) -> None:
    assert not streams.running


def test_without_commands_nothing_is_written(streams: CommandStreams) -> None:
    assert written(streams, 0.0) == ([Mode.LENGTH] * COUNT, [0.0] * COUNT, [False] * COUNT)


@pytest.mark.parametrize("mode", STREAM_MODES)
def test_a_command_is_written_for_its_muscle_alone(streams: CommandStreams, mode: Mode) -> None:
    streams.take(mode, [1], np.array([4.0]), 0.0)
    assert written(streams, TIMEOUT) == (
        [Mode.LENGTH, mode, Mode.LENGTH],
        [0.0, 4.0, 0.0],
        [False, True, False],
    )


def test_a_current_wins_over_a_tension(streams: CommandStreams) -> None:
    streams.take(Mode.CURRENT, [0], np.array([1.0]), 0.0)
    streams.take(Mode.TENSION, [0], np.array([20.0]), 0.0)
    mode, value, _ = written(streams, 0.0)
    assert (mode[0], value[0]) == (Mode.CURRENT, 1.0)


def test_a_stream_that_ends_is_told_once(streams: CommandStreams) -> None:
    streams.take(Mode.TENSION, [0], np.array([20.0]), 0.0)
    assert [written(streams, 2.0 * TIMEOUT)[2][0] for _ in range(2)] == [True, False]


def test_a_stream_that_ended_runs_no_more(streams: CommandStreams) -> None:
    streams.take(Mode.TENSION, [0], np.array([20.0]), 0.0)
    written(streams, 2.0 * TIMEOUT)
    assert not streams.running


def test_a_forgotten_stream_is_not_written(streams: CommandStreams) -> None:
    streams.take(Mode.CURRENT, slice(None), np.ones(COUNT), 0.0)
    streams.forget([0, 2])
    assert written(streams, 0.0)[2] == [False, True, False]


@pytest.mark.parametrize(("now", "stays"), [(TIMEOUT, True), (1.01 * TIMEOUT, False)])
def test_only_what_has_ended_is_forgotten_as_such(
    streams: CommandStreams, now: float, stays: bool
) -> None:
    streams.take(Mode.TENSION, [0], np.array([20.0]), 0.0)
    streams.forget_ended([0], now)
    assert written(streams, 0.0)[2][0] is stays


@given(
    commands=st.lists(
        st.tuples(st.sampled_from(STREAM_MODES), st.integers(0, COUNT - 1), st.floats(0.0, 1.0)),
        max_size=20,
    ),
    wait=st.floats(0.0, 1.0),
)
def test_nothing_outlives_its_timeout(commands: list[tuple[Mode, int, float]], wait: float) -> None:
    streams = CommandStreams(COUNT, TIMEOUT)
    made = sorted(one[2] for one in commands)
    newest = {}
    for (mode, muscle, _), now in zip(commands, made, strict=True):
        streams.take(mode, [muscle], np.array([now]), now)
        newest[mode, muscle] = now
    end = max(made, default=0.0) + wait
    valid = {muscle for (_, muscle), now in newest.items() if end - now <= TIMEOUT}
    modes, _, _ = written(streams, end)
    assert {n for n, mode in enumerate(modes) if mode != Mode.LENGTH} == valid
