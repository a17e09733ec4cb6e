"""What keeps the arm safe: stop, leases, rejected commands, watchdog, cancel, lifecycle."""

import signal
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.publisher import Publisher
from std_srvs.srv import Trigger

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import CurrentOverride, ErrorCode, LengthCommand, MuscleState

if TYPE_CHECKING:
    from test.system.suite import Suite


MUSCLES = [f"#{number}" for number in range(1, 11)]
FAR = 10.0
"""[m] far beyond any muscle: the bridge clamps it, and says so."""
STILL = 2e-3
"""[m] by which a muscle that holds may change."""


@pytest.fixture
def holding(bridge_and_mock: "Suite") -> Iterator["Suite"]:
    """Let the bridge hold the arm, without faults; remove a test's publishers afterwards."""
    before = list(bridge_and_mock.node.publishers)
    bridge_and_mock.hold()
    yield bridge_and_mock
    for publisher in list(bridge_and_mock.node.publishers):
        if publisher not in before:
            bridge_and_mock.node.destroy_publisher(publisher)


def commander(suite: "Suite", kind: Any, topic: str) -> Publisher:
    """Return a publisher that the bridge listens to."""
    publisher = suite.node.create_publisher(kind, topic, 10)
    suite.until(f"the bridge on {topic}", lambda: publisher.get_subscription_count() >= 1)
    return publisher


def mode_of(suite: "Suite", muscle: str) -> int:
    assert suite.muscles is not None
    return int(suite.muscles.mode[MUSCLES.index(muscle)])


def lengths(suite: "Suite") -> np.ndarray:
    return np.array(suite.fresh_muscles().length)


def count(suite: "Suite", key: str) -> int:
    return int(suite.reported("bridge", key) or 0)


# Emergency stop.


def test_an_emergency_stop_takes_the_current_from_every_muscle(holding: "Suite") -> None:
    holding.trigger("emergency_stop")
    holding.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)


def test_after_an_emergency_stop_the_muscles_stay_without_current(holding: "Suite") -> None:
    holding.trigger("emergency_stop")
    holding.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    holding.let_states_pass()
    assert set(holding.fresh_muscles().mode) == {MuscleState.MODE_ZERO_CURRENT}


def test_nothing_can_be_held_under_an_emergency_stop(holding: "Suite") -> None:
    holding.trigger("emergency_stop")
    answer = holding.ask(Trigger, "hold_posture", Trigger.Request())
    assert (answer.success, answer.message) == (
        False,
        "emergency stop: no muscle holds anything until clear_faults",
    )


def test_clear_faults_ends_an_emergency_stop(holding: "Suite") -> None:
    holding.trigger("emergency_stop")
    holding.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    holding.trigger("clear_faults")
    holding.wait_for_modes(MuscleState.MODE_LENGTH)


def test_after_clear_faults_the_measured_length_is_held_not_the_earlier_command(
    holding: "Suite",
) -> None:
    command = commander(holding, LengthCommand, "length_command")
    holding.trigger("emergency_stop")
    holding.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    holding.until("diagnostics", lambda: "bridge" in holding.diagnostics)
    clamped = count(holding, "clamped")
    holding.publish_until(
        command,
        lambda: LengthCommand(header=holding.now(), name=["#9"], length=[FAR]),
        "the bridge to take the command",
        lambda: count(holding, "clamped") > clamped,
    )
    before = lengths(holding)
    holding.trigger("clear_faults")
    holding.wait_for_modes(MuscleState.MODE_LENGTH)
    holding.let_states_pass()
    assert np.abs(lengths(holding) - before).max() < STILL


# Overrides.


def override_until_off(suite: "Suite") -> None:
    """Keep #9 at zero current with leases of 0.1 s until the board reports it."""
    lease = Duration(nanosec=100_000_000)
    suite.publish_until(
        commander(suite, CurrentOverride, "current_override"),
        lambda: CurrentOverride(header=suite.now(), name=["#9"], lease=lease),
        "#9 at zero current",
        lambda: mode_of(suite, "#9") == MuscleState.MODE_ZERO_CURRENT,
    )


def test_an_override_takes_the_current_from_its_muscle_alone(holding: "Suite") -> None:
    override_until_off(holding)
    assert holding.muscles is not None
    off = [
        name
        for name, mode in zip(holding.muscles.name, holding.muscles.mode, strict=True)
        if mode != MuscleState.MODE_LENGTH
    ]
    assert off == ["#9"]


def test_an_overridden_muscle_returns_to_its_length_by_silence(holding: "Suite") -> None:
    override_until_off(holding)
    holding.wait_for_modes(MuscleState.MODE_LENGTH)


# Rejected commands.

REJECTED = {
    "not_finite": lambda suite: LengthCommand(
        header=suite.now(), name=["#1", "#9"], length=[FAR, float("nan")]
    ),
    "unknown_name": lambda suite: LengthCommand(
        header=suite.now(), name=["#9", "#11"], length=[FAR, FAR]
    ),
    "zero_stamp": lambda _suite: LengthCommand(name=["#9"], length=[FAR]),
}


@pytest.fixture(params=REJECTED)
def reason(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def send_until_counted(suite: "Suite", reason: str) -> None:
    suite.until("diagnostics", lambda: "bridge" in suite.diagnostics)
    key = f"rejected_length_command_{reason}"
    before = count(suite, key)
    suite.publish_until(
        commander(suite, LengthCommand, "length_command"),
        lambda: REJECTED[reason](suite),
        f"a count of {key}",
        lambda: count(suite, key) > before,
    )


def test_a_rejected_command_is_counted_in_the_diagnostics(holding: "Suite", reason: str) -> None:
    send_until_counted(holding, reason)


def test_a_rejected_command_moves_no_muscle(holding: "Suite", reason: str) -> None:
    before = lengths(holding)
    send_until_counted(holding, reason)
    holding.let_states_pass()
    assert np.abs(lengths(holding) - before).max() < STILL


def test_a_rejected_command_changes_no_mode(holding: "Suite", reason: str) -> None:
    send_until_counted(holding, reason)
    holding.let_states_pass()
    assert set(holding.fresh_muscles().mode) == {MuscleState.MODE_LENGTH}


# A bridge that dies.


@pytest.fixture
def restarted(world: "Suite") -> "Suite":
    """Put a bridge in the place of one that was killed while it held the arm."""
    world.start_active("mock_driver", "bridge")
    world.hold()
    world.processes["bridge"].send(signal.SIGKILL)
    world.processes["bridge"].wait(60.0)
    world.until("the watchdogs", lambda: world.reported("mock_driver", "faulty_boards") == "10")
    world.muscles = None
    world.start("bridge")
    return world


def test_when_the_bridge_is_killed_every_board_reports_its_watchdog(restarted: "Suite") -> None:
    assert set(restarted.fresh_muscles().fault) == {MuscleState.FAULT_WATCHDOG}


def test_a_restarted_bridge_energises_nothing_by_itself(restarted: "Suite") -> None:
    restarted.let_states_pass()
    assert set(restarted.fresh_muscles().mode) == {MuscleState.MODE_ZERO_CURRENT}


def test_a_restarted_bridge_holds_the_arm_after_clear_faults(restarted: "Suite") -> None:
    restarted.fresh_muscles()
    restarted.trigger("clear_faults")
    restarted.wait_for_modes(MuscleState.MODE_LENGTH)


@pytest.fixture
def held_by_the_boards(world: "Suite") -> "Suite":
    """Start a bridge where the boards hold the arm by themselves: an earlier one was killed."""
    world.start("bridge", watchdog_action="hold_length")
    world.start_active("mock_driver")
    world.hold()
    world.processes["bridge"].send(signal.SIGKILL)
    world.processes["bridge"].wait(60.0)
    world.until("the watchdogs", lambda: world.reported("mock_driver", "faulty_boards") == "10")
    world.muscles = None
    world.start("bridge", watchdog_action="hold_length")
    return world


def test_an_arm_that_its_boards_hold_is_held_when_the_bridge_is_back(
    held_by_the_boards: "Suite",
) -> None:
    held_by_the_boards.let_states_pass()
    assert set(held_by_the_boards.fresh_muscles().mode) == {MuscleState.MODE_LENGTH}


def test_an_emergency_stop_takes_the_current_from_an_arm_that_its_boards_hold(
    held_by_the_boards: "Suite",
) -> None:
    held_by_the_boards.fresh_muscles()
    held_by_the_boards.trigger("emergency_stop")
    held_by_the_boards.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)


# Swings that are stopped.


class Raising:
    """A swing on its way to the start posture, with the arm already moving."""

    def __init__(self, suite: "Suite") -> None:
        self.suite = suite
        self._phases: list[int] = []
        before = suite.fresh_posture()
        self.handle = suite.send_goal(
            suite.goal(), lambda message: self._phases.append(message.feedback.phase)
        )
        suite.until("the raise", lambda: ExecuteSwing.Feedback.PHASE_RAISE in self._phases)
        suite.until(
            "the arm to move", lambda: bool(np.abs(suite.fresh_posture() - before).max() > 0.05)
        )

    @property
    def phase(self) -> int:
        return self._phases[-1]

    def cancel(self) -> Any:
        """Cancel the swing; return its status and result."""
        self.handle.cancel_goal_async()
        return self.suite.swing_result(self.handle)


@pytest.fixture
def raising(all_nodes: "Suite") -> Iterator[Raising]:
    swing = Raising(all_nodes)
    yield swing
    swing.cancel()


def test_a_canceled_swing_has_the_status_canceled(raising: Raising) -> None:
    assert raising.cancel().status == GoalStatus.STATUS_CANCELED


def test_a_canceled_swing_has_the_error_code_canceled(raising: Raising) -> None:
    assert raising.cancel().result.error_code == ErrorCode.CANCELED


def test_a_swing_canceled_during_the_raise_never_swung(raising: Raising) -> None:
    assert list(raising.cancel().result.measured.peak_joint_velocity) == []


def test_after_a_cancel_the_arm_holds_where_it_is(raising: Raising) -> None:
    raising.cancel()
    canceled_at = raising.suite.fresh_posture()
    raising.suite.let_states_pass(500)
    assert np.abs(raising.suite.fresh_posture() - canceled_at).max() < 0.15


def test_after_a_cancel_every_muscle_is_in_length_mode(raising: Raising) -> None:
    raising.cancel()
    assert set(raising.suite.fresh_muscles().mode) == {MuscleState.MODE_LENGTH}


def test_a_second_swing_while_one_runs_is_told_busy(raising: Raising) -> None:
    result = raising.suite.execute(raising.suite.goal())
    assert result.error_code == ErrorCode.BUSY


def test_a_busy_answer_does_not_disturb_the_running_swing(raising: Raising) -> None:
    raising.suite.execute(raising.suite.goal())
    assert raising.handle.status == GoalStatus.STATUS_EXECUTING


def test_an_emergency_stop_during_the_raise_ends_without_current(raising: Raising) -> None:
    raising.suite.trigger("emergency_stop")
    raising.suite.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    raising.cancel()
    raising.suite.let_states_pass()
    modes = set(raising.suite.fresh_muscles().mode)
    raising.suite.trigger("clear_faults")
    raising.suite.wait_for_modes(MuscleState.MODE_LENGTH)
    assert modes == {MuscleState.MODE_ZERO_CURRENT}


def test_a_swing_that_an_emergency_stop_ends_does_not_say_that_the_arm_is_held(
    raising: Raising,
) -> None:
    raising.suite.trigger("emergency_stop")
    text = raising.cancel().result.error_string
    raising.suite.trigger("clear_faults")
    raising.suite.wait_for_modes(MuscleState.MODE_LENGTH)
    assert text.endswith(
        "the bridge does not hold the arm: "
        "emergency stop: no muscle holds anything until clear_faults"
    )


# Lifecycle at run time.


def change(suite: "Suite", transition: int, node: str = "bridge") -> bool:
    """Ask a node for a transition; return whether it took place."""
    request = ChangeState.Request(transition=Transition(id=transition))
    return bool(suite.ask(ChangeState, f"{node}/change_state", request).success)


def test_a_swing_whose_executor_is_deactivated_still_gets_its_result(raising: Raising) -> None:
    change(raising.suite, Transition.TRANSITION_DEACTIVATE, "swing_executor")
    result = raising.suite.swing_result(raising.handle).result
    change(raising.suite, Transition.TRANSITION_ACTIVATE, "swing_executor")
    # It cannot wait for the bridge to confirm the hold; it says so then.
    assert result.error_code == ErrorCode.CANCELED
    assert result.error_string.startswith("the node was deactivated")


@pytest.fixture
def inactive(world: "Suite") -> "Suite":
    """Deactivate an active bridge."""
    world.start_active("mock_driver", "bridge")
    world.hold()
    change(world, Transition.TRANSITION_DEACTIVATE)
    world.wait_for_state("bridge", State.PRIMARY_STATE_INACTIVE)
    return world


def test_a_deactivated_bridge_leaves_the_boards_to_their_watchdog(inactive: "Suite") -> None:
    inactive.until(
        "the watchdogs", lambda: inactive.reported("mock_driver", "faulty_boards") == "10"
    )


def test_a_deactivated_bridge_publishes_no_state(inactive: "Suite") -> None:
    inactive.until(
        "the publishers' end", lambda: inactive.node.count_publishers("muscle_state") == 0
    )


def test_a_bridge_that_is_activated_again_holds_after_clear_faults(inactive: "Suite") -> None:
    change(inactive, Transition.TRANSITION_ACTIVATE)
    inactive.wait_for_state("bridge", State.PRIMARY_STATE_ACTIVE)
    inactive.fresh_muscles()
    inactive.trigger("clear_faults")
    inactive.wait_for_modes(MuscleState.MODE_LENGTH)


@pytest.fixture
def active(world: "Suite") -> "Suite":
    """Start a bridge and a mock for one test alone."""
    world.start_active("mock_driver", "bridge")
    return world


def test_an_illegal_transition_is_refused(active: "Suite") -> None:
    assert not change(active, Transition.TRANSITION_CONFIGURE)


def test_an_illegal_transition_leaves_the_bridge_active(active: "Suite") -> None:
    change(active, Transition.TRANSITION_CONFIGURE)
    assert active.state_of("bridge") == State.PRIMARY_STATE_ACTIVE


def test_an_illegal_transition_does_not_stop_the_states(active: "Suite") -> None:
    change(active, Transition.TRANSITION_CONFIGURE)
    active.let_states_pass()
