"""Method 1 as a node: joint state in, current override out."""

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from fastswing_inhibitor.decision_messages import DecisionMessages, RawDecisionMessages
from fastswing_inhibitor.inhibition import (
    Arming,
    Inhibition,
    JointNumbers,
    Reason,
)
from fastswing_inhibitor.inhibitor_parameters import TABLE, settings_from
from fastswing_inhibitor.latency_histogram import LatencyHistogram
from fastswing_msgs.msg import CurrentOverride, ErrorCode, InhibitionStatus
from fastswing_msgs.srv import ArmInhibitor
from fastswing_planner.arrays import unique_known
from fastswing_planner.cdr.stamps import from_seconds, to_ns, to_seconds
from fastswing_planner.conversion.error_codes import error_code
from fastswing_planner.conversion.raw_reader import RawReader
from fastswing_planner.conversion.states import JointStateReader, RejectionCounter
from fastswing_planner.errors import InvalidLimit, PlannerError
from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.real_time import CoreSleep
from fastswing_planner.lifecycle.request_age import check_request_stamp
from fastswing_planner.lifecycle.running import run
from fastswing_planner.planning.task import checked_threshold, posture
from fastswing_planner.robot.description import load_robot

_MORE_RELEASES = 2
_WATCHES = 5  # in the time after which silence ends a swing

_REASON_TEXTS = {
    Reason.NONE: "",
    Reason.NEVER_ARMED: "never armed",
    Reason.DISARMED: "disarmed by the service",
    Reason.GOAL_REACHED: "the goal was reached or passed",
    Reason.TIME_LIMIT: "the time limit of the arming request passed",
    Reason.STALE_STATE: "joint states stopped",
    Reason.STATE_JUMP: "a joint moved farther between two states than it can",
    Reason.REVERSED: "the arm moved away from the goal",
    Reason.DEACTIVATED: "the node was deactivated",
}


class InhibitorNode(ManagedNode):
    """Publishes `current_override` for each joint state while armed."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("inhibitor", TABLE)
        self._rejected = RejectionCounter()
        self._states = 0
        self._last_end = ""
        self._release: CurrentOverride | None = None
        self._releases = 0

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Load the robot."""
        self._robot = load_robot(parameters["robot_description"])
        self._max_time_limit: float = parameters["max_time_limit"]
        self._lease = _duration(parameters["lease"])
        self._request_max_age: float = parameters["request_max_age"]
        self._threshold: float = parameters["threshold"]
        self._watch_period: float = parameters["state_timeout"] / _WATCHES
        model = self._robot.model
        self._inhibition = Inhibition(
            model,
            self._robot.limits.velocity,
            settings_from(parameters),
        )
        self._reader = JointStateReader(model.joint_names)
        self._raw_states = RawReader(JointState, JointStateReader.NUMBERS)
        self._core_sleep = CoreSleep(parameters["prevent_core_sleep"])

    def activate(self) -> None:
        """Listen to joint states and offer the services."""
        self._latency = LatencyHistogram()
        self._messages = DecisionMessages(
            self._robot.model.muscle_names, self._lease, self._inhibition, self._latency
        )
        self._at_rate = RawDecisionMessages(self._messages, self._inhibition, self._latency)
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
        self._override = self.create_publisher(CurrentOverride, "current_override", newest)
        self._status = self.create_publisher(InhibitionStatus, "inhibition_status", 10)
        self._subscription = self.create_subscription(
            JointState,
            "joint_states",
            self.guarded(self._on_joint_state),
            qos_profile_sensor_data,
            raw=True,
        )
        self._arm_service = self.create_service(
            ArmInhibitor, "arm_inhibitor", self.guarded(self._on_arm)
        )
        self._disarm_service = self.create_service(
            Trigger, "disarm_inhibitor", self.guarded(self._on_disarm)
        )
        self._watch_timer = self.create_steady_timer(self._watch_period, self._on_watch)

    def deactivate(self) -> None:
        """Release all muscles and withdraw the services."""
        self._end(Reason.DEACTIVATED)
        self._core_sleep.allow()
        self.destroy_subscription(self._subscription)
        self.destroy_timer(self._watch_timer)
        self.destroy_service(self._arm_service)
        self.destroy_service(self._disarm_service)
        self.destroy_publisher(self._override)
        self.destroy_publisher(self._status)

    def _on_joint_state(self, data: bytes) -> None:
        now = self.monotonic()
        self._states += 1
        inhibition = self._inhibition
        try:
            message = self._raw_states.read(data)
            header = message.header
            position, velocity = self._reader.numbers(message)
            made = now - max(self.age(header.stamp), 0.0)
            if not inhibition.armed:
                inhibition.see(made)
                return
            decision = inhibition.decide(JointNumbers(made, position, velocity), now)
        except PlannerError as error:
            self._reject(error, now)
            return
        if decision.reason is Reason.NONE:
            self._override.publish(self._at_rate.override(header, decision))
            self._latency.add(self.age(header.stamp))
            self._status.publish(self._at_rate.status(header, decision))
            return
        self._publish_release(header)
        self._latency.add(self.age(header.stamp))
        self._tell_end(header)

    def _reject(self, error: PlannerError, now: float) -> None:
        self._rejected.count(error)
        was_armed = self._inhibition.armed
        self._inhibition.reject(now)
        if was_armed and not self._inhibition.armed:
            self._publish_end()

    def _on_watch(self) -> None:
        if not self._inhibition.armed:
            self._core_sleep.allow()  # again, if a defect cut the end of the swing short
            if self._releases and self._release is not None:
                self._releases -= 1
                self._override.publish(self._release)
            return
        self._inhibition.watch(self.monotonic())
        if not self._inhibition.armed:
            self._publish_end()

    def _end(self, reason: Reason) -> None:
        if self._inhibition.armed:
            self._inhibition.disarm(reason)
            self._publish_end()

    def _publish_end(self) -> None:
        header = self._header_of_now()
        self._publish_release(header)
        self._tell_end(header)

    def _publish_release(self, header: Header | SimpleNamespace) -> None:
        """Let go of no muscle any more; again later, as nothing else follows if it is lost."""
        self._release = self._messages.override(header, self._inhibition.nothing())
        self._releases = _MORE_RELEASES
        self._override.publish(self._release)

    def _tell_end(self, header: Header | SimpleNamespace) -> None:
        self._core_sleep.allow()
        self._publish_resting_status(header)
        self._last_end = self._reason_text(self._inhibition.reason)
        self.get_logger().info(
            f"disarmed after {self._inhibition.decisions} decisions: {self._last_end}"
        )

    def _publish_resting_status(self, header: Header | SimpleNamespace) -> None:
        decision = self._inhibition.nothing()
        text = self._reason_text(decision.reason)
        self._status.publish(self._messages.status(header, decision, text))

    def _header_of_now(self) -> Header:
        return Header(stamp=self.stamp())

    def _reason_text(self, reason: Reason) -> str:
        text = _REASON_TEXTS[reason]
        if reason is Reason.STALE_STATE and self._inhibition.rejected:
            text += f", {self._inhibition.rejected} rejected: {self._rejected.last}"
        if reason is Reason.REVERSED and self._inhibition.longest_lapse > 0.0:
            lapse = self._inhibition.longest_lapse
            text += f"; joint states came late, muscles were driven again for up to {lapse:.3f} s"
        return text

    def _on_arm(
        self, request: ArmInhibitor.Request, response: ArmInhibitor.Response
    ) -> ArmInhibitor.Response:
        response.error_code = ErrorCode.INTERNAL
        response.error_string = "defect in the inhibitor, see its log"
        if self._inhibition.armed:
            response.error_code = ErrorCode.BUSY
            response.error_string = "armed already: disarm it or wait until its swing is over"
            return response
        try:
            arming = self._arming(request)
            self._inhibition.arm(arming)
        except PlannerError as error:
            response.error_code = error_code(error)
            response.error_string = str(error)
            return response
        self._releases = 0
        if refusal := self._core_sleep.prevent():
            self.tell_refusal(refusal, asked=False)  # it is the default
        self._publish_resting_status(self._header_of_now())
        self.get_logger().info(f"armed for at most {arming.time_limit:g} s")
        response.error_code = ErrorCode.SUCCESS
        response.error_string = ""
        return response

    def _arming(self, request: ArmInhibitor.Request) -> Arming:
        model = self._robot.model
        check_request_stamp(
            "arming request",
            to_ns(request.stamp.sec, request.stamp.nanosec),
            self.get_clock().now().nanoseconds,
            self._request_max_age,
        )
        time_limit = to_seconds(request.time_limit.sec, request.time_limit.nanosec)
        if not 0.0 < time_limit <= self._max_time_limit:
            raise InvalidLimit(
                f"time_limit is {time_limit:g} s, expected more than 0 and at most "
                f"{self._max_time_limit:g} s"
            )
        protected = np.zeros(len(model.muscle_names), dtype=bool)
        protected[unique_known("muscle", request.kept_muscle, model.muscle_names)] = True
        return Arming(
            goal=posture("goal_position", model, request.joint_name, request.goal_position),
            threshold=self._asked_threshold(request.threshold),
            protected=protected,
            time_limit=time_limit,
            start_time=self.monotonic(),
        )

    def _asked_threshold(self, value: float) -> float:
        # Zero is the paper's C, so it cannot mean "not given".
        return self._threshold if math.isnan(value) else checked_threshold(value)

    def _on_disarm(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        response.message = "disarmed" if self._inhibition.armed else "was not armed"
        self._end(Reason.DISARMED)
        return response

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report arming, rate and rejections."""
        values: dict[str, object] = {"joint_states": self._states, "last_end": self._last_end}
        if self.is_active:
            values["armed"] = self._inhibition.armed
            values["decisions"] = self._inhibition.decisions
            values |= self._latency.report()
        values |= self._rejected.counts
        if self._rejected.last:
            return DiagnosticStatus.WARN, f"rejected: {self._rejected.last}", values
        return DiagnosticStatus.OK, "ok", values


def _duration(seconds: float) -> Duration:
    sec, nanosec = from_seconds(seconds)
    return Duration(sec=sec, nanosec=nanosec)


def main() -> int:
    """Run the node."""
    return run(InhibitorNode)
