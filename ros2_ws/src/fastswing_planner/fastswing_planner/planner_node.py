"""The planner as a service: `plan_swing`."""

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from fastswing_msgs.msg import ErrorCode
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.conversion import error_code, plan_to_message, request_from_message
from fastswing_planner.errors import PlannerError
from fastswing_planner.managed_node import ROBOT_DESCRIPTION, ManagedNode, resolve_path, run
from fastswing_planner.parameters import Parameter
from fastswing_planner.plan import SwingPlanner
from fastswing_planner.qp import ProxSuiteSolver
from fastswing_planner.robot import load_robot
from fastswing_planner.swing import SwingSettings

_SETTINGS = SwingSettings()

TABLE = (
    ROBOT_DESCRIPTION,
    Parameter(
        "time_step",
        _SETTINGS.time_step,
        "Step of the simulated swing, unless a request gives its own.",
        "s",
        1e-4,
        1.0,
    ),
    Parameter(
        "epsilon",
        _SETTINGS.epsilon,
        "A swing has arrived this near to its end, unless a request gives its own.",
        "rad",
        1e-6,
        1.0,
    ),
    Parameter("max_steps", _SETTINGS.max_steps, "A longer swing is an error.", "", 1, 100_000),
)


class PlannerNode(ManagedNode):
    """Answers `plan_swing`; nothing moves."""

    def __init__(self) -> None:
        """Declare parameters."""
        super().__init__("planner", TABLE)
        self._answered = 0
        self._refused: dict[str, int] = {}

    def configure(self, parameters: Mapping[str, Any]) -> None:
        """Load the robot."""
        self._robot = load_robot(resolve_path(parameters["robot_description"]))
        self._settings = SwingSettings(
            parameters["time_step"], parameters["epsilon"], parameters["max_steps"]
        )
        self._planner = SwingPlanner(self._robot.model, self._robot.limits, ProxSuiteSolver())

    def activate(self) -> None:
        """Offer the service."""
        self._service = self.create_service(PlanSwing, "plan_swing", self.guarded(self._answer))

    def deactivate(self) -> None:
        """Withdraw the service."""
        self.destroy_service(self._service)

    def _answer(
        self, request: PlanSwing.Request, response: PlanSwing.Response
    ) -> PlanSwing.Response:
        response.error_code = ErrorCode.INTERNAL
        response.error_string = "defect in the planner, see its log"
        try:
            swing = request_from_message(request, self._settings, self._robot.payload_body)
            plan = self._planner.plan(swing)
        except PlannerError as error:
            self._refused[error.code_name] = self._refused.get(error.code_name, 0) + 1
            response.error_code = error_code(error)
            response.error_string = str(error)
            return response
        response.plan = plan_to_message(plan, self._robot.model)
        response.plan.header.stamp = self.get_clock().now().to_msg()
        response.error_code = ErrorCode.SUCCESS
        response.error_string = ""
        self._answered += 1
        return response

    def diagnose(self) -> tuple[bytes, str, dict[str, object]]:
        """Report what was answered and refused."""
        refused = {f"refused_{name.lower()}": count for name, count in self._refused.items()}
        return DiagnosticStatus.OK, "ok", {"plans": self._answered, **refused}


def main() -> int:
    """Run the node."""
    return run(PlannerNode)
