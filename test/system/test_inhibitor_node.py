"""The inhibitor as a node: what arms it, what it reports."""

import os
from collections import deque
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from lifecycle_msgs.msg import State
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from fastswing_msgs.msg import CurrentOverride, ErrorCode, InhibitionStatus
from fastswing_msgs.srv import ArmInhibitor

if TYPE_CHECKING:
    from test.system.suite import Suite


THRESHOLD = 0.07
FRAME = "base"
CORE_SLEEP = Path("/dev/cpu_dma_latency")


class Lone:
    """An inhibitor alone; the joint states come from the test."""

    def __init__(self, suite: "Suite") -> None:
        self.suite = suite
        self.statuses: list[InhibitionStatus] = []
        self.overrides: list[CurrentOverride] = []
        self.sent: deque[Header] = deque(maxlen=1000)
        node = suite.node
        node.create_subscription(InhibitionStatus, "inhibition_status", self.statuses.append, 1000)
        node.create_subscription(CurrentOverride, "current_override", self.overrides.append, 1000)
        self._states = node.create_publisher(JointState, "joint_states", 10)
        self.place = suite.robot.postures["start"].copy()
        self.streaming: dict[str, Any] = {}
        self._timer = node.create_timer(0.005, self._publish)
        suite.until("the inhibitor", lambda: self._states.get_subscription_count() >= 2)

    def _publish(self) -> None:
        if self.streaming.get("silent"):
            return
        joints = list(self.suite.robot.model.joint_names)
        message = JointState(
            header=self.suite.now(),
            name=joints,
            position=self.place.tolist(),
            velocity=[0.0] * len(joints),
        )
        message.header.frame_id = FRAME
        message.header.stamp.sec -= self.streaming.get("late", 0)
        if self.streaming.get("broken"):
            message.position[0] = np.nan
        self.sent.append(message.header)
        # A cut message is none; a publisher sends bytes as they are.
        cut = self.streaming.get("cut")
        self._states.publish(serialize_message(message)[:cut] if cut else message)

    def ask(self, **changes: Any) -> ArmInhibitor.Response:
        """Ask once to arm for the robot's own swing, with some fields changed."""
        fields = {
            "stamp": self.suite.now().stamp,
            "goal_position": self.suite.robot.postures["end"].tolist(),
            "time_limit": Duration(sec=2),
            **changes,
        }
        return self.suite.ask(ArmInhibitor, "arm_inhibitor", ArmInhibitor.Request(**fields))

    def arm(self, **changes: Any) -> None:
        answer = self.ask(**changes)
        assert (answer.error_code, answer.error_string) == (ErrorCode.SUCCESS, "")

    def until_disarmed(self) -> InhibitionStatus:
        """Return the status that said why."""
        self.suite.until("the end", lambda: bool(self.statuses) and not self.statuses[-1].armed)
        return self.statuses[-1]


def holds(pid: int, file: Path) -> bool:
    """Whether a process has a file open."""
    links = Path(f"/proc/{pid}/fd").iterdir()
    return str(file) in [os.readlink(link) for link in links if link.is_symlink()]


@pytest.fixture(scope="module")
def inhibitor(tmp_path_factory: pytest.TempPathFactory) -> Any:
    from test.system.suite import Suite

    suite = Suite(tmp_path_factory.mktemp("inhibitor"))
    try:
        # A shared machine stalls for longer than a robot PC may.
        suite.start("inhibitor", threshold=THRESHOLD, state_timeout=0.3)
        suite.wait_for_state("inhibitor", State.PRIMARY_STATE_ACTIVE)
        yield Lone(suite)
    finally:
        suite.close()


@pytest.fixture
def lone(inhibitor: Lone) -> Lone:
    """Let good states come, and nothing be armed."""
    inhibitor.streaming = {}
    inhibitor.suite.ask(Trigger, "disarm_inhibitor", Trigger.Request())
    inhibitor.suite.let_states_pass(20)
    inhibitor.statuses.clear()
    inhibitor.overrides.clear()
    return inhibitor


def test_a_threshold_of_zero_is_the_papers(lone: Lone) -> None:
    lone.arm(threshold=0.0)
    lone.suite.until("a decision", lambda: len(lone.overrides) > 0)
    assert lone.statuses[-1].threshold == 0.0


def test_a_threshold_that_is_not_a_number_means_the_parameter(lone: Lone) -> None:
    lone.arm(threshold=float("nan"))
    lone.suite.until("a decision", lambda: len(lone.overrides) > 0)
    assert lone.statuses[-1].threshold == THRESHOLD


def test_a_negative_threshold_is_refused(lone: Lone) -> None:
    assert lone.ask(threshold=-0.1).error_code == ErrorCode.INVALID_LIMIT


def test_an_arming_request_that_was_long_on_its_way_is_refused(lone: Lone) -> None:
    stamp = lone.suite.now().stamp
    stamp.sec -= 8
    answer = lone.ask(stamp=stamp)
    assert answer.error_code == ErrorCode.STALE_REQUEST
    assert answer.error_string.startswith("the arming request is 8.")


def test_an_armed_inhibitor_is_not_armed_for_another_goal(lone: Lone) -> None:
    lone.arm()
    again = lone.ask(goal_position=lone.suite.robot.postures["start"].tolist())
    assert again.error_code == ErrorCode.BUSY


def test_an_arming_request_without_stamp_is_refused(lone: Lone) -> None:
    answer = lone.ask(stamp=type(lone.suite.now().stamp)())
    assert (answer.error_code, answer.error_string) == (
        ErrorCode.STALE_REQUEST,
        "the arming request's stamp is zero: fill in when it was made, late ones are not carried "
        "out",
    )


def test_without_fresh_joint_states_nothing_is_armed(lone: Lone) -> None:
    lone.streaming = {"silent": True}
    lone.suite.until(
        "an answer that names the age",
        lambda: lone.ask().error_code == ErrorCode.STALE_STATE,
    )
    assert not any(status.armed for status in lone.statuses[-1:])


def test_joint_states_that_stop_disarm(lone: Lone) -> None:
    lone.arm()
    lone.streaming = {"silent": True}
    ended = lone.until_disarmed()
    assert (ended.reason, ended.reason_text) == (
        InhibitionStatus.REASON_STALE_STATE,
        "joint states stopped",
    )


def test_joint_states_that_cannot_be_used_disarm_and_are_counted(lone: Lone) -> None:
    lone.arm()
    lone.streaming = {"broken": True}
    ended = lone.until_disarmed()
    assert ended.reason == InhibitionStatus.REASON_STALE_STATE
    assert ended.rejected > 0
    assert ended.reason_text == (
        f"joint states stopped, {ended.rejected} rejected: position of S-p is nan"
    )


def test_the_header_of_an_answer_is_that_of_its_joint_state(lone: Lone) -> None:
    lone.arm()
    lone.suite.until("answers", lambda: min(len(lone.overrides), len(lone.statuses) - 1) > 50)
    answers = [*lone.overrides[:50], *lone.statuses[1:50]]
    assert all(answer.header in lone.sent for answer in answers)
    assert lone.overrides[0].header.frame_id == FRAME


@pytest.mark.parametrize("inhibitor", [True], indirect=True, ids=["raw"])
def test_joint_states_that_cannot_be_decoded_are_counted_and_survived(lone: Lone) -> None:
    lone.arm()
    lone.streaming = {"cut": 50}
    assert "undecodable message" in lone.until_disarmed().reason_text
    lone.suite.until(
        "the count",
        lambda: int(lone.suite.reported("inhibitor", "rejected_invalid_request") or 0) > 0,
    )
    lone.streaming = {}
    lone.suite.let_states_pass(20)
    lone.arm()


def test_joint_states_that_are_old_disarm(lone: Lone) -> None:
    lone.arm()
    lone.streaming = {"late": 10}
    ended = lone.until_disarmed()
    assert ended.reason == InhibitionStatus.REASON_STALE_STATE
    assert "a joint state is 10." in ended.reason_text


def test_an_end_releases_every_muscle(lone: Lone) -> None:
    lone.arm()
    lone.suite.until("an override", lambda: any(message.name for message in lone.overrides))
    lone.streaming = {"silent": True}
    lone.until_disarmed()
    lone.suite.until("the release", lambda: list(lone.overrides[-1].name) == [])


def test_every_override_is_in_the_latency_histogram(lone: Lone) -> None:
    lone.arm(kept_muscle=list(lone.suite.robot.model.muscle_names))
    lone.suite.until("decisions", lambda: len(lone.statuses) > 100)
    first, last = lone.statuses[10], lone.statuses[90]
    assert sum(last.latency_count) - sum(first.latency_count) == last.decisions - first.decisions


def test_the_latency_has_one_bucket_more_than_bounds(lone: Lone) -> None:
    lone.arm()
    lone.suite.until("a status", lambda: len(lone.statuses) > 1)
    assert len(lone.statuses[-1].latency_count) == len(lone.statuses[-1].latency_bound) + 1


@pytest.mark.skipif(not os.access(CORE_SLEEP, os.W_OK), reason=f"no access to {CORE_SLEEP}")
@pytest.mark.parametrize("end", ["silence", "disarmed"])
def test_no_core_sleeps_while_armed(lone: Lone, end: str) -> None:
    held = partial(holds, lone.suite.processes["inhibitor"].pid, CORE_SLEEP)
    assert not held()
    lone.arm()
    assert held()
    if end == "silence":
        lone.streaming = {"silent": True}
    else:
        lone.suite.ask(Trigger, "disarm_inhibitor", Trigger.Request())
    lone.until_disarmed()
    lone.suite.until("cores may sleep", lambda: not held())


@pytest.mark.skipif(os.access(CORE_SLEEP, os.W_OK), reason=f"{CORE_SLEEP} is granted")
def test_cores_that_must_be_allowed_to_sleep_are_named_without_a_warning(lone: Lone) -> None:
    lone.arm()
    lone.suite.until(
        "the refusal",
        lambda: f"{CORE_SLEEP} refused: " in lone.suite.reported("inhibitor", "not_granted"),
    )
    assert CORE_SLEEP.name not in lone.suite.diagnostics["inhibitor"].message


def test_the_diagnostics_name_the_longest_latency(lone: Lone) -> None:
    lone.suite.until(
        "diagnostics", lambda: bool(lone.suite.reported("inhibitor", "latency_max_ms"))
    )
