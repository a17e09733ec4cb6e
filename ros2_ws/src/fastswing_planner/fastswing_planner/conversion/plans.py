"""Requests, plans and comparisons to and from their messages."""

import dataclasses
from array import array
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point

from fastswing_msgs.msg import (
    ErrorCode,
    MaskTrial,
    MethodOutcome,
    SwingFigures,
    SwingOptions,
    SwingTrajectory,
)
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.arrays import Matrix, Vector, frozen, frozen_flags
from fastswing_planner.cdr.plan_fields import PlanFields
from fastswing_planner.conversion.error_codes import error_code, error_from
from fastswing_planner.errors import InvalidRequest, WrongLength
from fastswing_planner.execution.figures import SwingFigures as Figures
from fastswing_planner.planning.mask_search import Trial, Verdict
from fastswing_planner.planning.plan import Outcome, SwingPlan
from fastswing_planner.planning.request import (
    Method,
    MuscleConstants,
    Search,
    SwingRequest,
    choice_from,
)
from fastswing_planner.planning.swing import SwingSettings, Trajectory
from fastswing_planner.robot.muscle_model import Payload

_VERDICTS = {
    Verdict.TAKEN: MaskTrial.VERDICT_TAKEN,
    Verdict.NOT_FASTER: MaskTrial.VERDICT_NOT_FASTER,
    Verdict.HOLDING_INFEASIBLE: MaskTrial.VERDICT_HOLDING_INFEASIBLE,
    Verdict.SWING_BLOCKED: MaskTrial.VERDICT_SWING_BLOCKED,
}
_VERDICTS_BACK = {number: verdict for verdict, number in _VERDICTS.items()}

# Vectors that have the same name in the plan and in its message.
_VECTORS = (
    "elongation",
    "basic_tension",
    "holding_tension",
    "final_tension",
    "speed_index",
)
_TABLES = ("joint_position", "joint_velocity", "muscle_length", "muscle_velocity")


def request_from_message(
    request: PlanSwing.Request, settings: SwingSettings, time_limit: float, payload_body: str
) -> SwingRequest:
    """Return the swing that is asked for.

    settings      used where the request's options are zero
    time_limit    [s] of the search, used where the request's is zero
    payload_body  used where the request names none

    Raises UnknownMethod, NotFinite or InvalidLimit.
    """
    options: SwingOptions = request.options
    return SwingRequest(
        start=request.start_position,
        end=request.end_position,
        method=choice_from(Method, "method", options.method),
        joint_names=tuple(request.joint_name),
        kept_muscles=tuple(options.kept_muscle),
        constants=MuscleConstants(
            tuple(options.muscle_name),
            options.velocity_limit,
            options.acceleration_limit,
            options.tension_min,
            options.tension_max,
            options.holding_weight,
        ),
        threshold=options.threshold,
        payload=payload_from_options(options, payload_body),
        settings=SwingSettings(
            time_step=options.time_step or settings.time_step,
            epsilon=options.epsilon or settings.epsilon,
            max_steps=options.max_steps or settings.max_steps,
        ),
        swing_weight=options.swing_weight,
        search=choice_from(Search, "search", options.search),
        time_limit=options.search_time_limit or time_limit,
    )


def payload_from_options(options: SwingOptions, payload_body: str) -> Payload | None:
    """Return the payload of a request; None without mass.

    payload_body  used where the request names none
    """
    if options.payload_mass == 0.0:
        return None
    at = options.payload_position
    body = options.payload_body or payload_body
    return Payload(options.payload_mass, body, (at.x, at.y, at.z))


def request_to_message(request: SwingRequest, compare: bool) -> PlanSwing.Request:
    """Return the message of a request; its settings are sent even where they are the defaults.

    An infinite time limit is left to the planner's parameter.
    """
    constants, payload = request.constants, request.payload
    options = SwingOptions(
        method=int(request.method),
        search=int(request.search),
        search_time_limit=0.0 if request.time_limit == np.inf else float(request.time_limit),
        kept_muscle=list(request.kept_muscles),
        muscle_name=list(constants.muscle_names),
        velocity_limit=_numbers(constants.velocity),
        acceleration_limit=_numbers(constants.acceleration),
        tension_min=_numbers(constants.tension_min),
        tension_max=_numbers(constants.tension_max),
        holding_weight=_numbers(constants.holding_weight),
        swing_weight=_numbers(request.swing_weight),
        threshold=float(request.threshold),
        **dataclasses.asdict(request.settings),
    )
    if payload is not None:
        options.payload_mass = float(payload.mass)
        options.payload_body = payload.body
        x, y, z = payload.position
        options.payload_position = Point(x=float(x), y=float(y), z=float(z))
    return PlanSwing.Request(
        joint_name=list(request.joint_names),
        start_position=_numbers(request.start),
        end_position=_numbers(request.end),
        options=options,
        compare=compare,
    )


def plan_to_message(plan: SwingPlan) -> SwingPlanMessage:
    """Return the message of a plan; its stamp is left to the caller."""
    message = SwingPlanMessage()
    write_plan(plan, message)
    return message


def write_plan(plan: SwingPlan, message: SwingPlanMessage) -> None:
    """Write a plan into a new message, such as that of a response; leaves its stamp as it is."""
    message.method = int(plan.method)
    message.joint_name = plan.joint_names
    message.start_position = _doubles(plan.start)
    message.end_position = _doubles(plan.end)
    message.muscle_name = plan.muscle_names
    message.mask = array("B", plan.kept.tobytes())
    message.inhibited = array("B", plan.inhibited.tobytes())
    for name in _VECTORS:
        setattr(message, name, _doubles(getattr(plan, name)))
    message.holding_margin = plan.holding_margin
    message.epsilon = plan.epsilon
    message.time_cost = plan.time_cost
    message.time_cost_basic = plan.time_cost_basic
    _write_trajectory(plan.trajectory, message.trajectory)
    message.trials = [_trial(trial, plan.muscle_names) for trial in plan.trials]
    message.proven = plan.proven
    message.warning = list(plan.warnings)


def plan_from_message(message: SwingPlanMessage) -> SwingPlan:
    """Return the plan that `plan_to_message` wrote.

    Raises WrongLength if a vector or table does not fit or there is no step, ValueError for an
    unknown method.
    """
    fields = PlanFields(message)
    if not fields.time.size:
        raise WrongLength("the plan's trajectory has no step")
    return SwingPlan(
        joint_names=fields.joint_names,
        muscle_names=fields.muscle_names,
        method=Method(message.method),
        start=fields.vector("start_position"),
        end=fields.vector("end_position"),
        kept=fields.flags("mask"),
        inhibited=fields.flags("inhibited"),
        **{name: fields.vector(name) for name in _VECTORS},
        holding_margin=message.holding_margin,
        epsilon=message.epsilon,
        time_cost_basic=message.time_cost_basic,
        trajectory=Trajectory(
            time=fields.time,
            at_limit=frozen_flags(fields.table("at_limit")),
            **{name: frozen(fields.table(name)) for name in _TABLES},
        ),
        trials=tuple(_trial_from(trial, fields.muscle_names) for trial in message.trials),
        proven=message.proven,
        warnings=tuple(message.warning),
    )


def outcome_to_message(outcome: Outcome) -> MethodOutcome:
    """Return the message of one method's outcome."""
    message = MethodOutcome(method=int(outcome.method), error_code=ErrorCode.SUCCESS)
    if outcome.plan is not None:
        write_plan(outcome.plan, message.plan)
    if outcome.error is not None:
        message.error_code = error_code(outcome.error)
        message.error_string = str(outcome.error)
    return message


def outcome_from_message(message: MethodOutcome) -> Outcome:
    """Return the outcome that `outcome_to_message` wrote."""
    method = Method(message.method)
    if message.error_code == ErrorCode.SUCCESS:
        return Outcome(method, plan_from_message(message.plan))
    return Outcome(method, None, error_from(message.error_code, message.error_string))


def _numbers(values: object) -> list[float]:
    return [float(value) for value in np.asarray(values, dtype=float).ravel()]


def _doubles(values: Vector) -> "array[float]":
    """Return an array of any shape as messages store it: no number is looked at one by one."""
    return array("d", np.asarray(values, dtype=np.float64).tobytes())


def _write_trajectory(trajectory: Trajectory, message: SwingTrajectory) -> None:
    message.time_from_start = _doubles(trajectory.time)
    for name in _TABLES:
        setattr(message, name, _doubles(getattr(trajectory, name)))
    message.at_limit = trajectory.at_limit.ravel().tolist()


def _trial(trial: Trial, muscle_names: Sequence[str]) -> MaskTrial:
    return MaskTrial(
        masked_muscle=[
            name for name, kept in zip(muscle_names, trial.kept, strict=True) if not kept
        ],
        verdict=_VERDICTS[trial.verdict],
        time_cost=trial.time_cost,
        holding_residual=trial.holding_residual,
    )


def _trial_from(message: MaskTrial, muscle_names: Sequence[str]) -> Trial:
    kept = frozen_flags([name not in message.masked_muscle for name in muscle_names])
    if message.verdict not in _VERDICTS_BACK:
        raise InvalidRequest(f"a mask's verdict is {message.verdict}, which is not known")
    return Trial(kept, _VERDICTS_BACK[message.verdict], message.holding_residual, message.time_cost)


def predicted_figures(plan: SwingPlan) -> SwingFigures:
    """Return a plan's figures in the form of the measured ones."""
    trajectory = plan.trajectory
    return SwingFigures(
        peak_joint_velocity=_peaks(trajectory.joint_velocity),
        time_cost=plan.time_cost,
        peak_muscle_velocity=_peaks(trajectory.muscle_velocity),
        peak_tension=[float("nan")] * len(plan.muscle_names),
    )


def figures_to_message(figures: Figures) -> SwingFigures:
    """Return the message of measured figures."""
    return SwingFigures(
        peak_joint_velocity=figures.peak_joint_velocity.tolist(),
        time_cost=figures.time_cost,
        peak_muscle_velocity=figures.peak_muscle_velocity.tolist(),
        peak_tension=figures.peak_tension.tolist(),
    )


def _peaks(values: Matrix) -> list[float]:
    return [float(peak) for peak in np.abs(values).max(axis=0)]
