"""From a joint state to its override, and from there to zero current."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fastswing_planner.analysis.latency import InhibitionLatency, inhibition_latency
from fastswing_planner.analysis.recording import MuscleSeries, OverrideSeries, Recording

Recorded = Callable[..., Recording]
PERIOD = 1.0 / 200.0


def measured(recording: Recording) -> InhibitionLatency:
    return inhibition_latency(recording.overrides, recording.muscles, 3.0, 6.0)


def parts(recording: Recording) -> tuple[OverrideSeries, MuscleSeries]:
    assert recording.overrides is not None
    assert recording.muscles is not None
    return recording.overrides, recording.muscles


def test_a_state_becomes_an_override_after_what_the_recorder_saw(recorded: Recorded) -> None:
    latency = measured(recorded()).state_to_override
    assert latency.values.size == 60
    assert latency.median == pytest.approx(0.002)


def test_the_slowest_of_all_overrides_counts(recorded: Recorded) -> None:
    overrides, _ = parts(recorded())
    received = overrides.received.copy()
    received[17] += 0.004
    latency = measured(recorded(overrides=replace(overrides, received=received))).state_to_override
    assert latency.longest == pytest.approx(0.006)
    assert latency.median == pytest.approx(0.002)


def test_an_override_before_its_state_is_counted_apart(recorded: Recorded) -> None:
    overrides, _ = parts(recorded())
    stamp = overrides.stamp.copy()
    stamp[0] += 5.0
    latency = measured(recorded(overrides=replace(overrides, stamp=stamp))).state_to_override
    assert (latency.values.size, latency.unusable) == (59, 1)


def test_zero_current_is_the_first_muscle_state_that_shows_it(recorded: Recorded) -> None:
    latency = measured(recorded())
    # Both muscles, once each: first named at 4.0 s, heard of at 4.002 s, at zero from 4.01 s on.
    assert latency.override_to_zero.values == pytest.approx([0.008, 0.008], abs=1e-9)
    assert latency.state_to_zero.values == pytest.approx([0.01, 0.01], abs=1e-9)


def test_boards_that_never_let_go_are_counted(recorded: Recorded) -> None:
    _, muscles = parts(recorded())
    driven = replace(muscles, mode=np.full_like(muscles.mode, 3))
    latency = measured(recorded(muscles=driven)).override_to_zero
    assert (latency.values.size, latency.missing) == (0, 2)


def test_how_long_it_took_at_the_longest_is_unknown_if_one_muscle_never_let_go(
    recorded: Recorded,
) -> None:
    _, muscles = parts(recorded())
    mode = muscles.mode.copy()
    mode[:, muscles.names.index("#10")] = 3
    latency = measured(recorded(muscles=replace(muscles, mode=mode)))
    for one in (latency.override_to_zero, latency.state_to_zero):
        assert (one.values.size, one.missing) == (1, 1)
        assert np.isnan([one.longest, one.p99]).all()


def test_how_long_it_took_at_the_longest_is_unknown_if_a_clock_jumped(recorded: Recorded) -> None:
    overrides, _ = parts(recorded())
    stamp = overrides.stamp.copy()
    stamp[0] += 5.0
    latency = measured(recorded(overrides=replace(overrides, stamp=stamp)))
    assert np.isnan(latency.state_to_override.p99)
    assert np.isnan(latency.state_to_zero.longest)


def test_a_muscle_without_states_never_let_go(recorded: Recorded) -> None:
    overrides, _ = parts(recorded())
    named = replace(overrides, muscles=(("#9", "#77"),) * len(overrides.muscles))
    latency = measured(recorded(overrides=named)).override_to_zero
    assert (latency.values.size, latency.missing) == (1, 1)


def test_boards_that_were_faster_than_the_recorder_took_no_time(recorded: Recorded) -> None:
    overrides, _ = parts(recorded())
    late = replace(overrides, received=overrides.received + 0.02)
    latency = measured(recorded(overrides=late))
    assert latency.override_to_zero.values == pytest.approx([0.0, 0.0])
    assert latency.state_to_zero.values == pytest.approx([0.01, 0.01], abs=1e-9)


def test_a_muscle_that_is_named_again_after_its_lease_counts_again(recorded: Recorded) -> None:
    overrides, _ = parts(recorded())
    rows = [0, 1, 40, 41]
    twice = OverrideSeries(
        overrides.stamp[rows],
        overrides.received[rows],
        overrides.lease[rows],
        tuple(overrides.muscles[row] for row in rows),
    )
    assert measured(recorded(overrides=twice)).override_to_zero.values.size == 4


def test_without_overrides_there_is_no_latency(recorded: Recorded) -> None:
    latency = measured(recorded(overrides=None)).state_to_override
    assert latency.values.size == 0
    assert np.isnan(latency.median)


def test_without_muscle_states_the_way_to_the_override_is_still_known(recorded: Recorded) -> None:
    latency = measured(recorded(muscles=None))
    assert latency.state_to_override.values.size == 60
    assert latency.override_to_zero.values.size == 0
