"""The planner as a service: `plan_swing`."""

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from fastswing_msgs.msg import ErrorCode
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.conversion.error_codes import error_code
from fastswing_planner.conversion.plans import (
    outcome_to_message,
    request_from_message,
    write_plan,
)
from fastswing_planner.errors import PlannerError
from fastswing_planner.lifecycle.common_parameters import ROBOT_DESCRIPTION
from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.lifecycle.running import run
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.swing import SETTING_RANGES, SwingSettings
from fastswing_planner.qp.solvers import DEFAULT_SOLVER, SOLVERS, solver_from
from fastswing_planner.robot.description import load_robot

_SETTINGS = SwingSettings()


def _setting(name: str, description: str) -> Parameter:
    low, high, unit = SETTING_RANGES[name]
    return Parameter(name, getattr(_SETTINGS, name), description, unit, low, high, read_only=False)


TABLE = (
    ROBOT_DESCRIPTION,
    Parameter(
        "solver",
        DEFAULT_SOLVER,
        "What solves the quadratic programs; daqp is the faster one, the plans are the same.",
        choices=tuple(SOLVERS),
    ),
    _setting(
        "time_step",
        "Step of the simulated swing, unless a request gives its own. Shorter predicts peaks "
        "finer.",
    ),
    _setting(
        "epsilon", "A predicted swing ends this near to its end, unless a request gives its own."
    ),
    _setting(
        "max_steps",
        "Steps after which a swing that has not ended is refused, unless a request gives its own.",
    ),
    Parameter(
        "search_time_limit",
        1.0,
        "Longest search for a mask, unless a request gives its own; then the best so far is taken.",
        "s",
        0.001,
        3600.0,
        read_only=False,
    ),
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
        self._robot = load_robot(parameters["robot_description"])
        solver = solver_from(parameters["solver"])
        self._planner = SwingPlanner(self._robot.model, self._robot.limits, solver)
        self.parameters_changed(parameters)

    def parameters_changed(self, parameters: Mapping[str, Any]) -> None:
        """Use other defaults from the next request on."""
        self._settings = SwingSettings(
            parameters["time_step"], parameters["epsilon"], parameters["max_steps"]
        )
        self._time_limit: float = parameters["search_time_limit"]

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
            swing = request_from_message(
                request, self._settings, self._time_limit, self._robot.payload_body
            )
            if request.compare:
                outcomes = self._planner.compare(swing, self.monotonic)
                response.comparison = [outcome_to_message(outcome) for outcome in outcomes]
            plan = self._planner.plan(swing, self.monotonic)
        except PlannerError as error:
            self._refused[error.code_name] = self._refused.get(error.code_name, 0) + 1
            response.error_code = error_code(error)
            response.error_string = str(error)
            return response
        write_plan(plan, response.plan)
        response.plan.header.stamp = self.stamp()
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
