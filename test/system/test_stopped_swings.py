"""A swing that is canceled, preempted or interrupted, in each of its phases, through all nodes."""

import signal
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import (
    ErrorCode,
    InhibitionStatus,
    LengthCommand,
    MuscleState,
    SwingOptions,
    TensionCommand,
)
from fastswing_planner.execution.settings import Phase

if TYPE_CHECKING:
    from test.system.suite import Suite


NODES: dict[str, dict[str, object]] = {
    "mock_driver": {},
    "bridge": {"watchdog_timeout": 1.0},
    "planner": {},
    "swing_executor": {
        "elongate_speed": 0.02,
        "rest_time": 0.5,
        "recover_time": 1.0,
        "state_timeout": 0.5,
    },
    "inhibitor": {"state_timeout": 0.5, "lease": 0.2},
}
"""So that every phase lasts long enough to be met, and for a shared machine that stalls."""
METHOD_1 = SwingOptions(method=SwingOptions.METHOD_INHIBIT)
ATTEMPTS = 4
STILL = 0.05
"""[rad] by which an arm that is held may move in half a second, once it came to rest."""


class Watched:
    """The suite's nodes, and what the inhibitor says."""

    def __init__(self, suite: "Suite") -> None:
        self.suite = suite
        self.inhibition = InhibitionStatus()
        suite.node.create_subscription(
            InhibitionStatus, "inhibition_status", self._on_inhibition, QoSProfile(depth=1)
        )

    def _on_inhibition(self, message: InhibitionStatus) -> None:
        self.inhibition = message

    def disarm(self) -> bool:
        """Disarm the inhibitor; return whether it was armed."""
        answer = self.suite.ask(Trigger, "disarm_inhibitor", Trigger.Request())
        return bool(answer.message != "was not armed")


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Watched]:
    """Start everything that a swing needs."""
    from test.system.suite import Suite

    suite = Suite(tmp_path_factory.mktemp("watched"))
    try:
        for name, parameters in NODES.items():
            suite.start(name, **parameters)
        for name in NODES:
            suite.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)
        suite.hold()
        suite.wait_until_swings_are_judged()
        yield Watched(suite)
    finally:
        suite.close()


class Running:
    """A swing by Method 1 that was sent."""

    def __init__(self, suite: "Suite", **changes: Any) -> None:
        self.suite = suite
        self.phases: list[Phase] = []
        goal = suite.goal(options=METHOD_1, **changes)
        self.handle = suite.send_goal(goal, self._on_feedback)
        self.ended = self.handle.get_result_async()

    def _on_feedback(self, message: Any) -> None:
        self.phases.append(Phase(message.feedback.phase))

    def reaches(self, phase: Phase) -> bool:
        self.suite.until(
            f"the phase {phase.name}", lambda: phase in self.phases or self.ended.done()
        )
        return phase in self.phases

    @property
    def ending(self) -> str:
        return str(self.ended.result().result.error_string)

    def result(self) -> Any:
        return self.suite.result_of(self.ended, "the result of the swing")

    def cancel(self) -> Any:
        self.handle.cancel_goal_async()
        return self.result()


@dataclass
class Outcome:
    """How a swing ended, and what followed."""

    status: int
    code: int
    text: str
    modes: set[int]
    """Of all muscles, in the first state after the result."""
    armed: bool
    moved: float
    """[rad] in half a second, a second after the result."""
    commanded: int
    """Length commands after the result."""


def later(message: MuscleState | LengthCommand, time: Time) -> bool:
    """Return whether a message was made after some time."""
    stamp = message.header.stamp
    return bool((stamp.sec, stamp.nanosec) > (time.sec, time.nanosec))


def outcome(watched: Watched, ended: Any) -> Outcome:
    suite = watched.suite
    # By their stamps: some from before may still have been on their way to this process.
    ended_at = suite.now().stamp
    while not later(first := suite.fresh_muscles(), ended_at):
        pass
    armed = watched.disarm()
    suite.let_states_pass(300)
    commanded = sum(later(command, ended_at) for command in suite.length_commands)
    before = suite.fresh_posture()
    suite.let_states_pass(150)
    moved = float(np.abs(suite.fresh_posture() - before).max())
    result = ended.result
    return Outcome(
        ended.status,
        result.error_code,
        result.error_string,
        set(first.mode),
        armed,
        moved,
        commanded,
    )


def run_until(watched: Watched, phase: Phase) -> Running:
    """Send a swing and wait for its phase; for the plan phase the planner stands still.

    One that a stalling machine made end before is sent again.
    """
    for _ in range(ATTEMPTS):
        watched.suite.hold()
        if phase is Phase.PLAN:
            watched.suite.processes["planner"].send(signal.SIGSTOP)
        swing = Running(watched.suite)
        if swing.reaches(phase):
            return swing
    pytest.fail(f"{phase.name} was never reached: {swing.ending}")


def let_the_planner_go_on(watched: Watched) -> None:
    watched.suite.processes["planner"].send(signal.SIGCONT)


# Canceled.


@pytest.fixture(scope="module", params=list(Phase), ids=lambda phase: phase.name.lower())
def canceled(request: pytest.FixtureRequest, watched: Watched) -> Outcome:
    swing = run_until(watched, request.param)
    try:
        return outcome(watched, swing.cancel())
    finally:
        let_the_planner_go_on(watched)


def test_a_canceled_swing_says_so(canceled: Outcome) -> None:
    assert (canceled.status, canceled.code, canceled.text) == (
        GoalStatus.STATUS_CANCELED,
        ErrorCode.CANCELED,
        "canceled by the client; the arm holds where it is",
    )


def test_when_the_cancel_is_answered_every_muscle_holds_a_length(canceled: Outcome) -> None:
    assert canceled.modes == {MuscleState.MODE_LENGTH}


def test_when_the_cancel_is_answered_the_inhibitor_is_disarmed(canceled: Outcome) -> None:
    assert not canceled.armed


def test_after_a_cancel_nothing_is_commanded(canceled: Outcome) -> None:
    assert canceled.commanded == 0


def test_after_a_cancel_the_arm_comes_to_rest(canceled: Outcome) -> None:
    assert canceled.moved < STILL


# Preempted.


@dataclass
class Preemption:
    """A swing in whose place another one came."""

    first: Outcome
    second: list[Phase]
    """Phases of the other one until it raised the arm."""


@pytest.fixture(scope="module", params=list(Phase), ids=lambda phase: phase.name.lower())
def preempted(request: pytest.FixtureRequest, watched: Watched) -> Preemption:
    first = run_until(watched, request.param)
    second = Running(watched.suite, preempt=True)
    try:
        ended = first.result()
        modes = set(watched.suite.fresh_muscles().mode)
        result = ended.result
        armed = watched.disarm()
    finally:
        let_the_planner_go_on(watched)
    assert second.reaches(Phase.RAISE), second.ending
    phases = list(second.phases)
    second.cancel()
    return Preemption(
        Outcome(ended.status, result.error_code, result.error_string, modes, armed, np.nan, 0),
        phases,
    )


def test_a_preempted_swing_says_so(preempted: Preemption) -> None:
    first = preempted.first
    assert (first.status, first.code, first.text) == (
        GoalStatus.STATUS_ABORTED,
        ErrorCode.PREEMPTED,
        "another goal took its place; the arm was held",
    )


def test_when_a_swing_is_preempted_every_muscle_holds_a_length(preempted: Preemption) -> None:
    assert preempted.first.modes == {MuscleState.MODE_LENGTH}


def test_when_a_swing_is_preempted_the_inhibitor_is_disarmed(preempted: Preemption) -> None:
    assert not preempted.first.armed


def test_the_preempting_swing_is_planned_and_raised_from_the_beginning(
    preempted: Preemption,
) -> None:
    assert list(dict.fromkeys(preempted.second)) == [Phase.PLAN, Phase.RAISE]


def test_a_preempting_swing_arrives(watched: Watched) -> None:
    wanted = ((ErrorCode.PREEMPTED, "another goal took its place; the arm was held"), (0, ""))
    endings: list[tuple[tuple[int, str], ...]] = []
    while wanted not in endings and len(endings) < ATTEMPTS:  # a stalling machine may stop a swing
        swings = run_until(watched, Phase.SWING), Running(watched.suite, preempt=True)
        results = [swing.result().result for swing in swings]
        endings.append(tuple((result.error_code, result.error_string) for result in results))
    assert endings[-1] == wanted, endings


def test_the_newest_of_two_preempting_goals_remains(watched: Watched) -> None:
    first = run_until(watched, Phase.PLAN)
    watched.suite.processes["swing_executor"].send(signal.SIGSTOP)
    try:
        suite = watched.suite
        clients = [
            suite.send_goal_later(suite.goal(options=METHOD_1, preempt=True)) for _ in range(2)
        ]
    finally:
        watched.suite.processes["swing_executor"].send(signal.SIGCONT)
    second, third = (suite.result_of(sent, "acceptance") for sent in clients)
    codes = [first.result().result.error_code, suite.swing_result(second).result.error_code]
    third.cancel_goal_async()
    codes.append(suite.swing_result(third).result.error_code)
    let_the_planner_go_on(watched)
    assert codes == [ErrorCode.PREEMPTED, ErrorCode.PREEMPTED, ErrorCode.CANCELED]


# Interrupted by others.


MOVING = [Phase.RAISE, Phase.ELONGATE, Phase.SETTLE, Phase.SWING, Phase.RECOVER]


@pytest.fixture(scope="module", params=MOVING, ids=lambda phase: phase.name.lower())
def held(request: pytest.FixtureRequest, watched: Watched) -> Outcome:
    swing = run_until(watched, request.param)
    client = watched.suite.node.create_client(Trigger, "hold_posture")
    watched.suite.until("hold_posture", client.service_is_ready)
    client.call_async(Trigger.Request())
    ended = outcome(watched, swing.result())
    watched.suite.node.destroy_client(client)
    return ended


def test_who_holds_the_arm_ends_the_swing(held: Outcome) -> None:
    assert (held.code, held.text) == (
        ErrorCode.INTERRUPTED,
        "somebody held the arm, by hold_posture or clear_faults",
    )


def test_an_arm_that_somebody_held_stays_held(held: Outcome) -> None:
    assert (held.modes, held.commanded) == ({MuscleState.MODE_LENGTH}, 0)


def test_an_arm_that_somebody_held_comes_to_rest(held: Outcome) -> None:
    assert held.moved < STILL


def interrupt(watched: Watched, kind: Any, topic: str, field: str) -> tuple[int, str]:
    """Publish a command for #1 while the arm is raised; return how the swing ends."""
    suite = watched.suite
    publisher = suite.node.create_publisher(kind, topic, 10)
    suite.until(f"the bridge on {topic}", lambda: publisher.get_subscription_count() >= 1)
    if topic == "length_command":
        suite.until("the executor too", lambda: publisher.get_subscription_count() >= 3)
    swing = run_until(watched, Phase.RAISE)
    assert suite.muscles is not None
    value = suite.muscles.length[0] if field == "length" else 20.0
    suite.publish_until(
        publisher,
        lambda: kind(header=suite.now(), name=["#1"], **{field: [value]}),
        "the end of the swing",
        swing.ended.done,
    )
    suite.node.destroy_publisher(publisher)
    ended = swing.result().result
    return ended.error_code, ended.error_string


def test_another_writer_of_lengths_ends_the_swing(watched: Watched) -> None:
    assert interrupt(watched, LengthCommand, "length_command", "length") == (
        ErrorCode.INTERRUPTED,
        "somebody else publishes length_command",
    )


def test_somebody_elses_tension_ends_the_swing(watched: Watched) -> None:
    assert interrupt(watched, TensionCommand, "tension_command", "tension") == (
        ErrorCode.INTERRUPTED,
        "muscles that follow somebody's tension or current: #1",
    )


# Deactivated.


def test_a_method_1_swing_whose_executor_is_deactivated_leaves_the_inhibitor_disarmed(
    watched: Watched,
) -> None:
    suite = watched.suite
    swing = run_until(watched, Phase.SWING)
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
        request = ChangeState.Request(transition=Transition(id=transition))
        assert suite.ask(ChangeState, "swing_executor/change_state", request).success
        if transition == Transition.TRANSITION_DEACTIVATE:
            assert swing.result().result.error_code == ErrorCode.CANCELED
    suite.until("the disarming", lambda: not watched.inhibition.armed)
    assert watched.inhibition.reason == InhibitionStatus.REASON_DISARMED


# Late.


def test_a_goal_that_was_long_on_its_way_is_refused(watched: Watched) -> None:
    stamp = watched.suite.now().stamp
    stamp.sec -= 8
    result = watched.suite.execute(watched.suite.goal(stamp=stamp))
    assert result.error_code == ErrorCode.STALE_REQUEST
    assert result.error_string.startswith("the goal is 8.")
    assert result.error_string.endswith(" s old, at most 1 s: send it again")


def test_a_late_goal_preempts_nothing(watched: Watched) -> None:
    swing = run_until(watched, Phase.RAISE)
    stamp = watched.suite.now().stamp
    stamp.sec -= 8
    late = watched.suite.execute(watched.suite.goal(stamp=stamp, preempt=True))
    status = swing.handle.status
    swing.cancel()
    assert (late.error_code, status) == (ErrorCode.STALE_REQUEST, GoalStatus.STATUS_EXECUTING)


def test_a_goal_without_stamp_is_refused(watched: Watched) -> None:
    result = watched.suite.swing_result(
        watched.suite.result_of(
            watched.suite.send_goal_later(watched.suite.goal(), stamped=False), "acceptance"
        )
    ).result
    assert (result.error_code, result.error_string) == (
        ErrorCode.STALE_REQUEST,
        "the goal's stamp is zero: fill in when it was made, late ones are not carried out",
    )


# Not started.


def test_after_an_emergency_stop_no_swing_is_started(watched: Watched) -> None:
    watched.suite.trigger("emergency_stop")
    watched.suite.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    result = watched.suite.execute(watched.suite.goal())
    watched.suite.hold()
    assert (result.error_code, result.error_string) == (
        ErrorCode.FAULT_LATCHED,
        "muscles at zero current: #1, #2, #3, #4, #5, #6, #7, #8, #9, #10; an emergency stop or "
        "somebody's current_override holds them",
    )


def test_method_1_is_not_started_without_the_inhibitor(watched: Watched) -> None:
    suite = watched.suite
    suite.hold()
    change = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE))
    assert suite.ask(ChangeState, "inhibitor/change_state", change).success
    suite.until(
        "the end of its service",
        lambda: "arm_inhibitor" not in dict(suite.node.get_service_names_and_types()),
    )
    commands = len(suite.length_commands)
    result = suite.execute(suite.goal(options=METHOD_1))
    moved = len(suite.length_commands) - commands
    change.transition.id = Transition.TRANSITION_ACTIVATE
    assert suite.ask(ChangeState, "inhibitor/change_state", change).success
    assert (result.error_code, result.error_string, moved) == (
        ErrorCode.NOT_READY,
        "arm_inhibitor is missing: is the inhibitor active?",
        0,
    )


def test_a_swing_without_states_is_not_started(watched: Watched) -> None:
    suite = watched.suite
    bridge = suite.processes["bridge"]
    bridge.send(signal.SIGSTOP)
    try:
        result = suite.execute(suite.goal())
    finally:
        bridge.send(signal.SIGCONT)
    suite.hold()
    assert result.error_code == ErrorCode.STALE_STATE
    assert result.error_string.startswith("the last measurements are ")
    assert isinstance(result, ExecuteSwing.Result)
