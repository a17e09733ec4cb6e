"""The planner's service for task code: plain calls, dataclasses back, exceptions for errors."""

import time
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from fastswing_msgs.msg import ErrorCode
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.conversion.error_codes import error_from
from fastswing_planner.conversion.plans import (
    outcome_from_message,
    plan_from_message,
    request_to_message,
)
from fastswing_planner.errors import PlannerUnavailable, UnknownName
from fastswing_planner.planning.plan import Outcome, SwingPlan
from fastswing_planner.planning.request import Method, SwingRequest
from fastswing_planner.planning.task import checked_time_limit

_SLICE_SEC = 0.1
_ASK_AGAIN_SEC = 5.0


class PlannerClient:
    """Asks a running planner node.

    It has a ROS context, node and executor of its own, so it works in any program, with or without
    rclpy running there, also in callbacks. One thread at a time may use it.
    """

    def __init__(self, namespace: str = "", timeout_sec: float = 30.0) -> None:
        """Connect; nothing is waited for yet.

        namespace    of the planner node
        timeout_sec  longest wait for an answer [s], beside the search's time limit
        """
        self._timeout_sec = timeout_sec
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(
            "planner_client",
            namespace=namespace,
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._client = self._node.create_client(PlanSwing, "plan_swing")
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)

    def __enter__(self) -> "PlannerClient":
        """Return the client, which is closed at the end of the block."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()

    def close(self) -> None:
        """Disconnect from ROS."""
        self._node.destroy_node()
        self._context.try_shutdown()

    def plan(
        self,
        start: Mapping[str, float],
        end: Mapping[str, float],
        method: Method = Method.BASIC,
        **options: Any,
    ) -> SwingPlan:
        """Return the plan of one swing.

        start, end  [rad] by joint name
        options     other fields of SwingRequest, such as payload or search; without a time_limit
                    the planner's parameter search_time_limit holds

        Raises the planner's own errors: an InvalidRequest, HoldingInfeasible, SwingBlocked, ...
        (see `errors`), and PlannerUnavailable if none answers in time.
        """
        answer = self._ask(_request(start, end, method, options), compare=False)
        return plan_from_message(answer.plan)

    def compare(
        self, start: Mapping[str, float], end: Mapping[str, float], **options: Any
    ) -> tuple[Outcome, ...]:
        """Return what each method makes of one swing.

        Arguments and errors as of `plan`; an error of a single method is its outcome.
        """
        answer = self._ask(_request(start, end, Method.BASIC, options), compare=True)
        return tuple(outcome_from_message(message) for message in answer.comparison)

    def _ask(self, request: SwingRequest, compare: bool) -> PlanSwing.Response:
        checked_time_limit(request.time_limit)
        message = request_to_message(request, compare)
        timeout = self._timeout_sec + message.options.search_time_limit
        deadline = time.monotonic() + timeout
        self._spin_until(self._client.service_is_ready, deadline)
        asked: list[Future] = []
        wait = _ASK_AGAIN_SEC + 10.0 * message.options.search_time_limit
        try:
            while not any(answer.done() for answer in asked):
                if time.monotonic() >= deadline:
                    service = self._node.resolve_service_name(self._client.srv_name)
                    raise PlannerUnavailable(
                        f"{service} does not answer within {timeout:g} s: is the planner running?"
                    )
                # The first answer after discovery can get lost; planning twice does no harm. An
                # earlier one may still come: the planner answers in turn.
                asked.append(self._client.call_async(message))
                again = min(deadline, time.monotonic() + wait)
                self._spin_until(lambda: any(answer.done() for answer in asked), again)
                wait *= 2.0
            response = next(answer.result() for answer in asked if answer.done())
        finally:
            for answer in asked:
                self._client.remove_pending_request(answer)
        if response.error_code != ErrorCode.SUCCESS:
            raise error_from(response.error_code, response.error_string)
        return response

    def _spin_until(self, done: Callable[[], bool], deadline: float) -> None:
        while not done() and time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=_SLICE_SEC)


def _request(
    start: Mapping[str, float],
    end: Mapping[str, float],
    method: Method,
    options: Mapping[str, Any],
) -> SwingRequest:
    if set(start) != set(end):
        raise UnknownName(
            f"start and end name different joints: {', '.join(sorted(set(start) ^ set(end)))}"
        )
    return SwingRequest(
        start=list(start.values()),
        end=[end[name] for name in start],
        method=method,
        joint_names=tuple(start),
        **options,
    )
