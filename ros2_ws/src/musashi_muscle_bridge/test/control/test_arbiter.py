"""Who commands a muscle, for how long, and how it comes back; on three muscles of equal limits."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from fastswing_planner.arrays import Vector, frozen
from musashi_muscle_bridge.buses.protocol import Mode
from musashi_muscle_bridge.control.arbiter import CommandArbiter, Setpoints
from musashi_muscle_bridge.control.command_limits import CommandLimits
from musashi_muscle_bridge.errors import CommandRejected

NAMES = ("a", "b", "c")
A, B, C = range(3)
PERIOD = 0.01
LENGTH_MIN, LENGTH_MAX = 0.1, 0.5
TENSION_MAX, CURRENT_MAX = 200.0, 8.0
VELOCITY = 0.3
STREAM_TIMEOUT, MAX_LEASE = 0.1, 0.2


def limits() -> CommandLimits:
    def same(value: float) -> Vector:
        return frozen(np.full(len(NAMES), value))

    return CommandLimits(
        length_min=same(LENGTH_MIN),
        length_max=same(LENGTH_MAX),
        tension_max=same(TENSION_MAX),
        tension_limit=same(2.0 * TENSION_MAX),
        current_max=same(CURRENT_MAX),
        velocity=same(VELOCITY),
        stream_timeout=STREAM_TIMEOUT,
        max_lease=MAX_LEASE,
    )


@dataclass
class Bench:
    """An arbiter, its clock, and what it measures."""

    arbiter: CommandArbiter = field(default_factory=lambda: CommandArbiter(NAMES, limits()))
    now: float = 100.0
    length: list[float] = field(default_factory=lambda: [0.3, 0.3, 0.3])
    tension: list[float] = field(default_factory=lambda: [20.0, 20.0, 20.0])

    def command(
        self, mode: Mode, *values: float, index: list[int] | None = None, age: float = 0.0
    ) -> None:
        chosen = list(range(len(values))) if index is None else index
        self.arbiter.command(mode, chosen, frozen(values), self.now - age)

    def override(self, *index: int, lease: float = 0.05) -> None:
        self.arbiter.override(index, lease, self.now)

    def update(self, elapsed: float = PERIOD, faulty: tuple[int, ...] = ()) -> Setpoints:
        self.now += elapsed
        faults = np.isin(np.arange(len(NAMES)), faulty)
        return self.arbiter.update(self.now, frozen(self.length), frozen(self.tension), faults)

    def settle(self, duration: float = 1.0) -> Setpoints:
        """Update until a re-engaging muscle is where it was told to be."""
        for _ in range(round(duration / PERIOD)):
            setpoints = self.update()
        return setpoints


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.update()
    return bench


@pytest.fixture
def posed() -> Bench:
    """Every muscle holds a latched length of 0.4 m, and is there."""
    bench = Bench(length=[0.4, 0.4, 0.4])
    bench.command(Mode.LENGTH, 0.4, 0.4, 0.4)
    bench.update()
    return bench


def test_without_commands_every_muscle_holds_its_measured_length() -> None:
    setpoints = Bench(length=[0.2, 0.3, 0.4]).update()
    assert setpoints.mode.tolist() == [Mode.LENGTH] * 3
    assert setpoints.value.tolist() == [0.2, 0.3, 0.4]


def test_a_hold_does_not_follow_the_arm(bench: Bench) -> None:
    bench.length = [0.35, 0.35, 0.35]
    assert bench.update().value.tolist() == [0.3, 0.3, 0.3]


def test_setpoints_cannot_be_changed(bench: Bench) -> None:
    with pytest.raises(ValueError, match="read-only"):
        bench.update().value[A] = 1.0


# Priorities.


def test_the_first_command_after_a_hold_is_approached_and_not_jumped_to(bench: Bench) -> None:
    bench.command(Mode.LENGTH, 0.45, index=[A])
    assert bench.update().value[A] == pytest.approx(0.3 + limits().velocity[A] * PERIOD)


def test_a_posture_that_was_reached_is_followed_by_steps(bench: Bench) -> None:
    bench.command(Mode.LENGTH, 0.31, index=[A])
    bench.settle()
    bench.command(Mode.LENGTH, 0.45, index=[A])
    assert bench.update().value[A] == 0.45


def test_a_command_after_clearing_an_emergency_stop_is_not_jumped_to(posed: Bench) -> None:
    posed.arbiter.emergency_stop()
    posed.update()
    posed.length[A] = 0.35
    posed.arbiter.clear_faults()
    posed.update()
    posed.command(Mode.LENGTH, 0.4, index=[A])
    assert posed.update().value[A] == pytest.approx(0.35 + limits().velocity[A] * PERIOD)


def test_a_command_moves_only_the_muscles_it_names(bench: Bench) -> None:
    bench.command(Mode.LENGTH, 0.45, index=[B])
    assert bench.settle().value.tolist() == [0.3, 0.45, 0.3]


def test_tension_beats_length(bench: Bench) -> None:
    bench.command(Mode.TENSION, 50.0)
    bench.command(Mode.LENGTH, 0.4)
    setpoints = bench.update()
    assert (setpoints.mode[A], setpoints.value[A]) == (Mode.TENSION, 50.0)


def test_current_beats_tension(bench: Bench) -> None:
    bench.command(Mode.CURRENT, 2.0)
    bench.command(Mode.TENSION, 50.0)
    setpoints = bench.update()
    assert (setpoints.mode[A], setpoints.value[A]) == (Mode.CURRENT, 2.0)


def test_tension_returns_when_only_the_current_stream_ended(bench: Bench) -> None:
    bench.command(Mode.CURRENT, 2.0)
    bench.update(0.08)
    bench.command(Mode.TENSION, 50.0)
    setpoints = bench.update(0.08)
    assert (setpoints.mode[A], setpoints.value[A]) == (Mode.TENSION, 50.0)


@pytest.mark.parametrize("mode", [Mode.LENGTH, Mode.TENSION, Mode.CURRENT])
def test_an_override_beats_every_command(bench: Bench, mode: Mode) -> None:
    bench.override(A)
    bench.command(mode, 0.4, 0.4)
    setpoints = bench.update()
    assert (setpoints.mode[A], setpoints.value[A]) == (Mode.ZERO_CURRENT, 0.0)
    assert setpoints.mode[B] == mode


def test_an_emergency_stop_beats_every_command_on_every_muscle(bench: Bench) -> None:
    bench.arbiter.emergency_stop()
    bench.command(Mode.CURRENT, 2.0, 2.0)
    setpoints = bench.update()
    assert setpoints.mode.tolist() == [Mode.ZERO_CURRENT] * 3
    assert setpoints.value.tolist() == [0.0] * 3


def test_a_fault_beats_every_command_on_its_muscle_only(bench: Bench) -> None:
    bench.command(Mode.CURRENT, 2.0, 2.0, 2.0)
    setpoints = bench.update(faulty=(B,))
    assert setpoints.mode.tolist() == [Mode.CURRENT, Mode.ZERO_CURRENT, Mode.CURRENT]
    assert setpoints.value.tolist() == [2.0, 0.0, 2.0]


# Leases.


def test_a_lease_lives_until_its_end(bench: Bench) -> None:
    bench.override(A, lease=0.05)
    assert bench.update(0.049).mode[A] == Mode.ZERO_CURRENT


def test_a_lease_ends_by_time_alone(bench: Bench) -> None:
    bench.override(A, lease=0.05)
    assert bench.update(0.051).mode[A] == Mode.LENGTH


def test_a_renewed_lease_counts_from_its_renewal(bench: Bench) -> None:
    bench.override(A, lease=0.05)
    bench.update(0.04)
    bench.override(A, lease=0.05)
    assert bench.update(0.04).mode[A] == Mode.ZERO_CURRENT


def test_a_shorter_lease_replaces_a_longer_one(bench: Bench) -> None:
    bench.override(A, lease=0.2)
    bench.override(A, lease=0.02)
    assert bench.update(0.03).mode[A] == Mode.LENGTH


def test_an_override_releases_all_muscles_it_does_not_name(bench: Bench) -> None:
    bench.override(A, B)
    bench.override(B, C)
    assert bench.update().mode.tolist() == [Mode.LENGTH, Mode.ZERO_CURRENT, Mode.ZERO_CURRENT]


def test_a_command_during_a_lasting_override_reaches_the_other_muscles(posed: Bench) -> None:
    posed.override(A)
    posed.settle(3 * PERIOD)
    posed.command(Mode.LENGTH, 0.41, index=[B])
    assert posed.update().value.tolist() == [0.0, 0.41, 0.4]


def test_a_measurement_that_is_none_is_noticed_during_a_lasting_override(posed: Bench) -> None:
    posed.override(A)
    posed.settle(3 * PERIOD)
    posed.length[B] = np.nan
    assert posed.update().mode.tolist() == [Mode.ZERO_CURRENT, Mode.ZERO_CURRENT, Mode.LENGTH]


def test_an_override_of_no_muscle_releases_everything(bench: Bench) -> None:
    bench.override(A, B, C)
    bench.override(lease=0.0)
    assert bench.update().mode.tolist() == [Mode.LENGTH] * 3


@pytest.mark.parametrize("lease", [0.0, -0.1, 0.25, np.inf])
def test_a_lease_out_of_range_is_rejected(bench: Bench, lease: float) -> None:
    with pytest.raises(CommandRejected) as caught:
        bench.override(A, lease=lease)
    assert str(caught.value) == f"lease is {lease:g} s, expected 0 < lease <= 0.2 s"
    assert caught.value.reason == "lease"


def test_a_lease_that_is_not_a_number_is_rejected(bench: Bench) -> None:
    with pytest.raises(CommandRejected, match=r"^lease is nan s, expected 0 < lease <= 0\.2 s$"):
        bench.override(A, lease=np.nan)


def test_a_rejected_override_leaves_the_living_one(bench: Bench) -> None:
    bench.override(A, lease=0.05)
    with pytest.raises(CommandRejected):
        bench.override(B, lease=1.0)
    assert bench.update().mode.tolist() == [Mode.ZERO_CURRENT, Mode.LENGTH, Mode.LENGTH]


def test_the_arbiter_tells_which_muscles_are_overridden(bench: Bench) -> None:
    bench.override(B, lease=0.05)
    assert bench.arbiter.overridden(bench.now).tolist() == [False, True, False]
    assert not bench.arbiter.overridden(bench.now + 0.06).any()


# Coming back.


def test_after_a_lease_the_setpoint_restarts_at_the_measured_length(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A] = 0.45
    posed.override()
    assert posed.update().value[A] == pytest.approx(0.45, abs=VELOCITY * PERIOD + 1e-12)


def test_after_a_lease_the_setpoint_moves_with_the_velocity_limit(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A] = 0.45
    posed.override()
    values = np.array([posed.update().value[A] for _ in range(10)])
    np.testing.assert_allclose(np.diff(values), -VELOCITY * PERIOD, rtol=1e-9)


def test_after_a_lease_the_setpoint_ends_at_the_latched_length(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A] = 0.45
    posed.override()
    assert [posed.update().value[A] for _ in range(20)][-1] == 0.4


def test_a_muscle_without_a_lease_does_not_notice_anothers(posed: Bench) -> None:
    posed.override(A)
    assert posed.update().value[B] == 0.4


def test_a_length_command_in_a_lease_is_where_the_muscle_goes_afterwards(posed: Bench) -> None:
    posed.override(A)
    posed.command(Mode.LENGTH, 0.42)
    posed.update()
    posed.override()
    assert [posed.update().value[A] for _ in range(20)][-1] == 0.42


def test_after_coming_back_a_length_command_counts_at_once(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.override()
    posed.update()
    posed.command(Mode.LENGTH, 0.2)
    assert posed.update().value[A] == 0.2


def test_a_length_command_does_not_hasten_a_muscle_that_is_coming_back(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A] = 0.5
    posed.override()
    before = posed.update().value[A]
    posed.command(Mode.LENGTH, 0.2)
    assert before - posed.update().value[A] == pytest.approx(VELOCITY * PERIOD)


def test_tension_above_the_limit_stops_shortening(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A] = 0.45
    posed.override()
    before = posed.update().value[A]
    posed.tension[A] = TENSION_MAX + 1.0
    assert posed.update().value[A] == before


def test_shortening_goes_on_when_the_tension_is_gone(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A], posed.tension[A] = 0.45, TENSION_MAX + 1.0
    posed.override()
    before = posed.update().value[A]
    posed.tension[A] = TENSION_MAX
    assert posed.update().value[A] == pytest.approx(before - VELOCITY * PERIOD)


def test_tension_above_the_limit_does_not_stop_paying_out(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A], posed.tension[A] = 0.35, TENSION_MAX + 1.0
    posed.override()
    before = posed.update().value[A]
    assert posed.update().value[A] == pytest.approx(before + VELOCITY * PERIOD)


def test_a_hold_outside_the_limits_moves_into_them(bench: Bench) -> None:
    bench.override(A)
    bench.update()
    bench.length[A] = 0.52
    bench.arbiter.hold()
    bench.override()
    values = [bench.update().value[A] for _ in range(20)]
    assert values[0] > LENGTH_MAX
    assert values[-1] == LENGTH_MAX


# Clamps.


@pytest.mark.parametrize(
    ("mode", "asked", "given"),
    [
        (Mode.LENGTH, 0.05, LENGTH_MIN),
        (Mode.LENGTH, 0.9, LENGTH_MAX),
        (Mode.TENSION, -5.0, 0.0),
        (Mode.TENSION, 250.0, TENSION_MAX),
        (Mode.CURRENT, -1.0, 0.0),
        (Mode.CURRENT, 9.0, CURRENT_MAX),
    ],
)
def test_a_command_beyond_the_limits_is_clamped(
    bench: Bench, mode: Mode, asked: float, given: float
) -> None:
    bench.command(mode, asked)
    assert bench.settle(1.0 if mode is Mode.LENGTH else PERIOD).value[A] == given
    assert bench.arbiter.clamped == 1


def test_every_clamped_value_is_counted(bench: Bench) -> None:
    bench.command(Mode.LENGTH, 0.05, 0.3, 0.9)
    bench.command(Mode.TENSION, 250.0, index=[C])
    assert bench.arbiter.clamped == 3


@pytest.mark.parametrize("mode", [Mode.LENGTH, Mode.TENSION, Mode.CURRENT])
def test_a_value_within_the_limits_is_not_counted(bench: Bench, mode: Mode) -> None:
    bench.command(mode, 0.4, 0.2)
    assert bench.arbiter.clamped == 0


# Streams.


@pytest.mark.parametrize("mode", [Mode.TENSION, Mode.CURRENT])
def test_a_stream_lives_until_its_timeout(bench: Bench, mode: Mode) -> None:
    bench.command(mode, 5.0)
    assert bench.update(STREAM_TIMEOUT - 0.001).mode[A] == mode


@pytest.mark.parametrize("mode", [Mode.TENSION, Mode.CURRENT])
def test_after_a_stream_the_measured_length_is_held_not_the_latched_one(
    posed: Bench, mode: Mode
) -> None:
    posed.command(mode, 5.0)
    posed.update()
    posed.length[A] = 0.25
    setpoints = [posed.update(STREAM_TIMEOUT + 0.001), posed.update(1.0)]
    assert [setpoint.mode[A] for setpoint in setpoints] == [Mode.LENGTH] * 2
    assert [setpoint.value[A] for setpoint in setpoints] == [0.25] * 2


def test_a_stream_that_ended_before_it_was_used_forgets_the_latched_length(posed: Bench) -> None:
    posed.command(Mode.TENSION, 5.0)
    posed.override(A, lease=0.2)
    posed.update(STREAM_TIMEOUT + 0.001)
    posed.length[A] = 0.25
    posed.override()
    assert posed.update().value[A] == 0.25


def test_a_length_command_after_a_stream_counts(posed: Bench) -> None:
    posed.command(Mode.TENSION, 5.0)
    posed.update(STREAM_TIMEOUT + 0.001)
    posed.command(Mode.LENGTH, 0.45)
    assert posed.settle().value[A] == 0.45


def test_a_length_command_counts_that_came_just_after_the_stream_ended(posed: Bench) -> None:
    posed.command(Mode.TENSION, 5.0)
    posed.update()
    posed.now += STREAM_TIMEOUT + 0.001
    posed.command(Mode.LENGTH, 0.45)
    assert [posed.update().value[A] for _ in range(50)][-1] == 0.45


# Stop, faults, hold.


def test_an_emergency_stop_lasts(bench: Bench) -> None:
    bench.arbiter.emergency_stop()
    assert all((bench.update(1.0).mode == Mode.ZERO_CURRENT).all() for _ in range(5))


def test_a_fault_lasts_though_the_board_forgot_it(bench: Bench) -> None:
    bench.update(faulty=(B,))
    assert bench.update(1.0).mode.tolist() == [Mode.LENGTH, Mode.ZERO_CURRENT, Mode.LENGTH]


def test_after_a_stop_the_measured_length_is_held_not_the_old_setpoint(posed: Bench) -> None:
    posed.arbiter.emergency_stop()
    posed.update()
    posed.length = [0.2, 0.25, 0.3]
    posed.arbiter.clear_faults()
    assert posed.update().value.tolist() == [0.2, 0.25, 0.3]
    assert posed.update(1.0).value.tolist() == [0.2, 0.25, 0.3]


def test_after_a_fault_the_measured_length_is_held_not_the_old_setpoint(posed: Bench) -> None:
    posed.update(faulty=(A,))
    posed.length = [0.2, 0.41, 0.42]
    posed.arbiter.clear_faults()
    assert posed.update().value.tolist() == [0.2, 0.41, 0.42]
    assert posed.update(1.0).value.tolist() == [0.2, 0.41, 0.42]


@pytest.mark.parametrize("mode", [Mode.LENGTH, Mode.TENSION, Mode.CURRENT])
def test_a_command_given_during_a_stop_is_forgotten_by_clearing(bench: Bench, mode: Mode) -> None:
    bench.arbiter.emergency_stop()
    bench.update()
    bench.command(mode, 0.45)
    bench.arbiter.clear_faults()
    setpoints = bench.update()
    assert (setpoints.mode[A], setpoints.value[A]) == (Mode.LENGTH, 0.3)


def test_clearing_does_not_end_a_living_lease(bench: Bench) -> None:
    bench.override(A, lease=0.2)
    bench.arbiter.emergency_stop()
    bench.arbiter.clear_faults()
    assert bench.update().mode.tolist() == [Mode.ZERO_CURRENT, Mode.LENGTH, Mode.LENGTH]


def test_a_fault_that_is_still_there_returns_after_clearing(bench: Bench) -> None:
    bench.update(faulty=(A,))
    bench.arbiter.clear_faults()
    assert bench.update(faulty=(A,)).mode[A] == Mode.ZERO_CURRENT


def test_hold_forgets_streams_and_latched_lengths(posed: Bench) -> None:
    posed.command(Mode.TENSION, 50.0, index=[B])
    posed.update()
    posed.length = [0.3, 0.31, 0.32]
    posed.arbiter.hold()
    setpoints = posed.update()
    assert setpoints.mode.tolist() == [Mode.LENGTH] * 3
    assert setpoints.value.tolist() == [0.3, 0.31, 0.32]


# Time.


def test_a_clock_that_jumps_back_does_not_revive_a_lease(bench: Bench) -> None:
    bench.override(A, lease=0.05)
    bench.update(0.06)
    assert bench.update(-0.05).mode[A] == Mode.LENGTH


def test_a_clock_that_jumps_back_does_not_revive_a_stream(bench: Bench) -> None:
    bench.command(Mode.TENSION, 50.0)
    bench.update(0.11)
    assert bench.update(-0.1).mode[A] == Mode.LENGTH


def test_a_clock_that_jumps_back_moves_no_setpoint(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A] = 0.5
    posed.override()
    before = posed.update().value[A]
    assert posed.update(-0.05).value[A] == before


def test_the_time_that_was_jumped_back_is_not_counted_twice(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A] = 0.5
    posed.override()
    before = posed.update().value[A]
    posed.update(-0.05)
    assert posed.update(0.05).value[A] == before


# Stalls, kept muscles, measurements that are none.


def test_after_a_stall_a_muscle_that_comes_back_does_not_catch_up(posed: Bench) -> None:
    posed.override(A)
    posed.update()
    posed.length[A] = 0.5
    posed.override()
    before = posed.update().value[A]
    assert before - posed.update(10.0).value[A] == pytest.approx(VELOCITY * 0.05)


def keep(bench: Bench, *index: int) -> None:
    bench.arbiter.keep(np.isin(np.arange(len(NAMES)), index))


def test_a_kept_muscle_holds_its_measured_length(posed: Bench) -> None:
    posed.length[A] = 0.35
    keep(posed, A)
    assert posed.update().value.tolist() == [0.35, 0.4, 0.4]


@pytest.mark.parametrize("mode", [Mode.LENGTH, Mode.TENSION, Mode.CURRENT])
def test_no_command_moves_a_kept_muscle(posed: Bench, mode: Mode) -> None:
    keep(posed, A)
    posed.update()
    posed.command(mode, 0.2, 0.2)
    setpoints = posed.update()
    assert (setpoints.mode[A], setpoints.value[A]) == (Mode.LENGTH, 0.4)
    assert (setpoints.mode[B], setpoints.value[B]) == (mode, 0.2)


def test_no_override_takes_the_current_from_a_kept_muscle(posed: Bench) -> None:
    keep(posed, A)
    posed.override(A, B)
    assert posed.update().mode.tolist() == [Mode.LENGTH, Mode.ZERO_CURRENT, Mode.LENGTH]


def test_an_emergency_stop_takes_the_current_from_a_kept_muscle(posed: Bench) -> None:
    keep(posed, A)
    posed.arbiter.emergency_stop()
    assert posed.update().mode.tolist() == [Mode.ZERO_CURRENT] * 3


def test_a_kept_muscle_is_reported_as_latched(posed: Bench) -> None:
    keep(posed, A)
    assert posed.arbiter.latched.tolist() == [True, False, False]


def test_a_kept_muscle_follows_commands_after_clearing(posed: Bench) -> None:
    keep(posed, A)
    posed.update()
    posed.arbiter.clear_faults()
    posed.command(Mode.LENGTH, 0.45)
    assert posed.settle().value[A] == 0.45


@pytest.mark.parametrize("what", ["length", "tension"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_measurement_that_is_not_finite_latches_its_muscle_alone(
    bench: Bench, what: str, value: float
) -> None:
    getattr(bench, what)[A] = value
    bench.update()
    getattr(bench, what)[A] = 0.3
    assert bench.update().mode.tolist() == [Mode.ZERO_CURRENT, Mode.LENGTH, Mode.LENGTH]


@pytest.mark.parametrize("mode", [Mode.LENGTH, Mode.TENSION, Mode.CURRENT])
@pytest.mark.parametrize("forget", ["hold", "clear_faults"])
def test_a_command_from_before_that_comes_after_moves_nothing(
    posed: Bench, mode: Mode, forget: str
) -> None:
    getattr(posed.arbiter, forget)(now=posed.now)
    held = posed.update().value.tolist()
    posed.command(mode, 0.2, 0.2, 0.2, age=0.05)
    told = posed.settle()
    assert told.mode.tolist() == [Mode.LENGTH] * 3
    assert told.value.tolist() == held
    assert posed.arbiter.outdated == 3


# Any order of events.

muscles = st.lists(st.integers(0, 2), unique=True, max_size=3)
# Now and then beyond the limits: a wire that broke, an encoder that lost its zero.
place = st.one_of(*[st.floats(LENGTH_MIN, LENGTH_MAX)] * 4, st.sampled_from([0.0, 0.05, 0.6, 5.0]))
measured = st.lists(place, min_size=3, max_size=3)
forces = st.lists(st.floats(0.0, 400.0), min_size=3, max_size=3)
asked = st.lists(st.floats(-1000.0, 1000.0), min_size=3, max_size=3)
ages = st.sampled_from([0.0, 0.0, 0.001, 0.02, 0.5])
steps = st.sampled_from([0.0, 0.002, PERIOD, 0.05, 0.3, 3600.0, -0.002, -0.3, -3600.0])
seldom: st.SearchStrategy[list[int]] = st.one_of(st.just([]), st.just([]), st.just([]), muscles)


def beyond(length: float) -> float:
    """How far outside the limits a length is [m]."""
    return max(LENGTH_MIN - length, length - LENGTH_MAX, 0.0)


class AnyOrderOfEvents(RuleBasedStateMachine):
    """An arbiter beside the simplest possible model of what may command a muscle.

    until       end of each muscle's lease, streams: of the last command in each mode
    forgotten   lengths commanded before the last stop, fault, hold or end of a stream
    since       when each muscle's commands were forgotten; older ones that come later do not count
    latest      the latest time the arbiter saw; a clock that jumps back does not exist for it
    """

    def __init__(self) -> None:
        super().__init__()
        self.bench = Bench()
        self.latest = self.bench.now
        self.until = [-np.inf] * 3
        self.streams: dict[Mode, list[float]] = {
            Mode.TENSION: [-np.inf] * 3,
            Mode.CURRENT: [-np.inf] * 3,
        }
        self.stopped = False
        self.faulty: set[int] = set()
        self.kept: set[int] = set()
        self.forgotten: list[set[float]] = [set(), set(), set()]
        self.commanded: list[float | None] = [None] * 3
        self.since = [-np.inf] * 3
        self.updated = False
        self.setpoints = self._tell(PERIOD)
        self.previous = self.setpoints

    @rule(
        mode=st.sampled_from([Mode.LENGTH, Mode.TENSION, Mode.CURRENT]),
        index=muscles,
        values=asked,
        age=ages,
    )
    def command(self, mode: Mode, index: list[int], values: list[float], age: float) -> None:
        self.updated = False
        self.bench.command(mode, *values[: len(index)], index=index, age=age)
        for muscle, value in zip(index, values, strict=False):
            if muscle in self.kept or self.bench.now - age < self.since[muscle]:
                continue
            if mode is Mode.LENGTH:
                self.commanded[muscle] = min(max(value, LENGTH_MIN), LENGTH_MAX)
                self.forgotten[muscle].discard(self.commanded[muscle] or 0.0)
            else:
                self.streams[mode][muscle] = self.bench.now - age

    @rule(index=muscles, lease=st.floats(0.001, MAX_LEASE), age=ages)
    def override(self, index: list[int], lease: float, age: float) -> None:
        self.updated = False
        made = self.bench.now - age
        self.bench.arbiter.override(index, lease, made)
        self.until = [made + lease if i in index else -np.inf for i in range(3)]

    @rule(lease=st.sampled_from([0.0, -1.0, 0.3, np.inf, np.nan]))
    def override_with_a_wrong_lease(self, lease: float) -> None:
        with pytest.raises(CommandRejected):
            self.bench.override(A, lease=lease)

    @rule()
    def emergency_stop(self) -> None:
        self.updated = False
        self.bench.arbiter.emergency_stop()
        self.stopped = True

    @rule(index=muscles)
    def lose_the_bus(self, index: list[int]) -> None:
        self.updated = False
        keep(self.bench, *index)
        self._forget(set(index) - self.kept, self.latest)
        self.kept |= set(index)

    @rule()
    def hold(self) -> None:
        self.updated = False
        self.bench.arbiter.hold(now=self.bench.now)
        self._forget({A, B, C}, self.bench.now)

    def _forget(self, index: set[int], now: float) -> None:
        for muscle in index:
            self.since[muscle] = max(self.since[muscle], now)
            commanded = self.commanded[muscle]
            if commanded is not None:
                self.forgotten[muscle].add(commanded)
            self.commanded[muscle] = None
            for received in self.streams.values():
                received[muscle] = -np.inf

    @precondition(lambda self: self.stopped or self.faulty or self.kept)
    @rule(length=measured)
    def clear_and_update(self, length: list[float]) -> None:
        self.bench.arbiter.clear_faults(self.bench.now)
        self.stopped = False
        self.faulty, self.kept = set(), set()
        self._forget({A, B, C}, self.bench.now)
        self.update(PERIOD, length, [20.0] * 3, [])
        living = np.array(self.until) > self.latest
        within = np.clip(length, LENGTH_MIN, LENGTH_MAX) == length
        here = ~living & within
        np.testing.assert_array_equal(self.setpoints.value[here], np.array(length)[here])

    @rule(elapsed=steps, length=measured, tension=forces, faulty=seldom)
    def update(
        self, elapsed: float, length: list[float], tension: list[float], faulty: list[int]
    ) -> None:
        self.faulty |= set(faulty)
        self.bench.length, self.bench.tension = list(length), list(tension)
        self.previous = self.setpoints
        self.setpoints = self._tell(elapsed, tuple(faulty))

    @rule(index=muscles, value=st.sampled_from([np.nan, np.inf, -np.inf]), what=st.booleans())
    def update_with_a_measurement_that_is_none(
        self, index: list[int], value: float, what: bool
    ) -> None:
        measurement = self.bench.length if what else self.bench.tension
        before = list(measurement)
        for muscle in index:
            measurement[muscle] = value
        # One that follows its commands needs no measurement, and goes on.
        if not self.bench.arbiter._at_target:
            self.faulty |= set(index)
        self.previous = self.setpoints
        self.setpoints = self._tell(PERIOD)
        measurement[:] = before

    def _tell(self, elapsed: float, faulty: tuple[int, ...] = ()) -> Setpoints:
        setpoints = self.bench.update(elapsed, faulty)
        self.elapsed = max(self.bench.now - self.latest, 0.0)
        self.latest = max(self.bench.now, self.latest)
        # Commands are stamped with a monotonic clock: it does not really go back.
        self.bench.now = self.latest
        self.updated = True
        return setpoints

    def _streams(self, mode: Mode, muscle: int) -> bool:
        return self.latest - self.streams[mode][muscle] <= STREAM_TIMEOUT

    def _free(self, muscle: int) -> bool:
        return not (self.stopped or muscle in self.faulty)

    @invariant()
    def no_setpoint_is_beyond_its_limits(self) -> None:
        value, mode = self.setpoints.value, self.setpoints.mode
        high = {Mode.CURRENT: CURRENT_MAX, Mode.TENSION: TENSION_MAX}
        for muscle in np.flatnonzero(mode != Mode.LENGTH):
            assert 0.0 <= value[muscle] <= high.get(mode[muscle], 0.0)

    @precondition(lambda self: self.updated)
    @invariant()
    def no_length_is_beyond_its_limits_but_that_of_a_muscle_which_comes_from_there(self) -> None:
        for muscle in np.flatnonzero(self.setpoints.mode == Mode.LENGTH):
            held = self.previous.mode[muscle] == Mode.LENGTH
            last = self.previous.value[muscle] if held else LENGTH_MIN
            allowed = max(beyond(last), beyond(self.bench.length[muscle]))
            assert beyond(self.setpoints.value[muscle]) <= allowed

    @precondition(lambda self: self.updated)
    @invariant()
    def no_muscle_pulls_while_a_lease_lives(self) -> None:
        for muscle in {A, B, C} - self.kept:
            if self.latest < self.until[muscle]:
                assert self.setpoints.mode[muscle] == Mode.ZERO_CURRENT

    @precondition(lambda self: self.updated)
    @invariant()
    def no_muscle_is_inhibited_without_lease_stop_or_fault(self) -> None:
        for muscle in range(3):
            if self._free(muscle) and (self.latest >= self.until[muscle] or muscle in self.kept):
                assert self.setpoints.mode[muscle] != Mode.ZERO_CURRENT

    @precondition(lambda self: self.updated)
    @invariant()
    def no_muscle_pulls_under_a_stop_or_with_a_fault(self) -> None:
        for muscle in range(3):
            if not self._free(muscle):
                assert self.setpoints.mode[muscle] == Mode.ZERO_CURRENT

    @precondition(lambda self: self.updated)
    @invariant()
    def a_muscle_whose_bus_was_lost_is_held(self) -> None:
        for muscle in self.kept:
            if self._free(muscle):
                assert self.setpoints.mode[muscle] == Mode.LENGTH

    @precondition(lambda self: self.updated)
    @invariant()
    def a_muscle_is_in_the_mode_of_its_highest_living_command(self) -> None:
        for muscle in {A, B, C} - self.kept:
            if not self._free(muscle) or self.latest < self.until[muscle]:
                continue
            current = self._streams(Mode.CURRENT, muscle)
            tension = self._streams(Mode.TENSION, muscle)
            lower = Mode.TENSION if tension else Mode.LENGTH
            assert self.setpoints.mode[muscle] == (Mode.CURRENT if current else lower)

    @precondition(lambda self: self.updated)
    @invariant()
    def a_muscle_comes_back_from_zero_current_without_a_bump(self) -> None:
        entering = (self.previous.mode != Mode.LENGTH) & (self.setpoints.mode == Mode.LENGTH)
        jump = np.abs(self.setpoints.value - self.bench.length)[entering]
        assert (jump <= VELOCITY * min(self.elapsed, 0.05) + 1e-12).all()

    @precondition(lambda self: self.updated)
    @invariant()
    def no_muscle_goes_to_a_length_from_before(self) -> None:
        for muscle in range(3):
            if self.setpoints.mode[muscle] == Mode.LENGTH and self.commanded[muscle] is None:
                measured_now = self.bench.length[muscle]
                value = self.setpoints.value[muscle]
                held = self.previous.mode[muscle] == Mode.LENGTH
                assert value not in self.forgotten[muscle] or held or value == measured_now


TestAnyOrderOfEvents = AnyOrderOfEvents.TestCase
TestAnyOrderOfEvents.settings = settings(max_examples=200, stateful_step_count=40, deadline=None)
