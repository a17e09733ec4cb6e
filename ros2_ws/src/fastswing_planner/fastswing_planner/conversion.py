"""Messages to and from the planner's objects."""

from collections.abc import Sequence

import numpy as np

from fastswing_msgs.msg import (
    ErrorCode,
    MaskTrial,
    SwingFigures,
    SwingOptions,
    SwingPoint,
)
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.errors import PlannerError
from fastswing_planner.figures import SwingFigures as Figures
from fastswing_planner.mask_search import Trial, Verdict
from fastswing_planner.muscle_model import MuscleModel, Payload
from fastswing_planner.plan import MuscleConstants, SwingPlan, SwingRequest, method_from
from fastswing_planner.swing import SwingSettings, Trajectory

_VERDICTS = {
    Verdict.TAKEN: MaskTrial.VERDICT_TAKEN,
    Verdict.NOT_FASTER: MaskTrial.VERDICT_NOT_FASTER,
    Verdict.HOLDING_INFEASIBLE: MaskTrial.VERDICT_HOLDING_INFEASIBLE,
}


def error_code(error: PlannerError) -> int:
    """Return the ErrorCode constant of an error."""
    return int(getattr(ErrorCode, error.code_name))


def error_name(code: int) -> str:
    """Return the name of an ErrorCode constant; INTERNAL for a number that is none."""
    names = {value: name for name, value in vars(ErrorCode).items() if name.isupper()}
    return names.get(code, "INTERNAL")


def request_from_message(
    request: PlanSwing.Request, settings: SwingSettings, payload_body: str
) -> SwingRequest:
    """Return the swing that is asked for.

    settings      used where the request's options are zero
    payload_body  used where the request names none

    Raises UnknownMethod or InvalidLimit.
    """
    options: SwingOptions = request.options
    position = options.payload_position
    payload = Payload(
        options.payload_mass,
        options.payload_body or payload_body,
        (position.x, position.y, position.z),
    )
    return SwingRequest(
        start=request.start_position,
        end=request.end_position,
        method=method_from(options.method),
        joint_names=tuple(request.joint_name),
        kept_muscles=tuple(options.kept_muscle),
        constants=MuscleConstants(
            tuple(options.muscle_name),
            options.velocity_limit,
            options.acceleration_limit,
            options.tension_min,
            options.tension_max,
        ),
        threshold=options.threshold,
        payload=payload if options.payload_mass != 0.0 else None,
        settings=SwingSettings(
            time_step=options.time_step or settings.time_step,
            epsilon=options.epsilon or settings.epsilon,
            max_steps=settings.max_steps,
        ),
    )


def plan_to_message(plan: SwingPlan, model: MuscleModel) -> SwingPlanMessage:
    """Return the message of a plan; its stamp is left to the caller."""
    return SwingPlanMessage(
        method=int(plan.method),
        joint_name=model.joint_names,
        start_position=plan.start.tolist(),
        end_position=plan.end.tolist(),
        muscle_name=model.muscle_names,
        mask=plan.kept.astype(np.uint8).tolist(),
        elongation=plan.elongation.tolist(),
        holding_tension=plan.holding.tension.tolist(),
        final_tension=plan.final_holding.tension.tolist(),
        speed_index=plan.speed_index.tolist(),
        epsilon=plan.epsilon,
        time_cost=plan.trajectory.time_cost,
        time_cost_basic=plan.time_cost_basic,
        trajectory=_points(plan.trajectory),
        trials=[_trial(trial, model.muscle_names) for trial in plan.trials],
    )


def _points(trajectory: Trajectory) -> list[SwingPoint]:
    return [
        SwingPoint(
            time_from_start=float(time),
            joint_position=position.tolist(),
            joint_velocity=velocity.tolist(),
            muscle_length=length.tolist(),
            muscle_velocity=muscle_velocity.tolist(),
        )
        for time, position, velocity, length, muscle_velocity in zip(
            trajectory.time,
            trajectory.joint_position,
            trajectory.joint_velocity,
            trajectory.muscle_length,
            trajectory.muscle_velocity,
            strict=True,
        )
    ]


def _trial(trial: Trial, muscle_names: Sequence[str]) -> MaskTrial:
    return MaskTrial(
        masked_muscle=[
            name for name, kept in zip(muscle_names, trial.kept, strict=True) if not kept
        ],
        verdict=_VERDICTS[trial.verdict],
        time_cost=trial.time_cost,
        holding_residual=trial.holding_residual,
    )


def column(points: Sequence[SwingPoint], field: str) -> Matrix:
    """Return one field of all points of a trajectory, shape (k + 1, n or m)."""
    return np.array([getattr(point, field) for point in points], dtype=float)


def predicted_figures(message: SwingPlanMessage) -> SwingFigures:
    """Return a plan's figures in the form of the measured ones."""
    return SwingFigures(
        peak_joint_velocity=_peaks(column(message.trajectory, "joint_velocity")),
        time_cost=message.time_cost,
        peak_muscle_velocity=_peaks(column(message.trajectory, "muscle_velocity")),
        peak_tension=[float("nan")] * len(message.muscle_name),
    )


def _peaks(values: Matrix) -> list[float]:
    peaks: Vector = np.abs(values).max(axis=0)
    return [float(peak) for peak in peaks]


def figures_to_message(figures: Figures) -> SwingFigures:
    """Return the message of measured figures."""
    return SwingFigures(
        peak_joint_velocity=figures.peak_joint_velocity.tolist(),
        time_cost=figures.time_cost,
        peak_muscle_velocity=figures.peak_muscle_velocity.tolist(),
        peak_tension=figures.peak_tension.tolist(),
    )
