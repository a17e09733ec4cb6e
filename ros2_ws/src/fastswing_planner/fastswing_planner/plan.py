"""Plans a swing: from a request to mask, elongation, tensions and predicted trajectory."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from fastswing_planner.arrays import (
    BoolVector,
    Vector,
    finite_vector,
    frozen,
    named_vector,
    unique_known,
)
from fastswing_planner.elongation import elongation
from fastswing_planner.errors import (
    HoldingInfeasible,
    InvalidLimit,
    OutOfRange,
    StartEqualsEnd,
    UnknownMethod,
    WrongLength,
)
from fastswing_planner.holding import Holding, hold
from fastswing_planner.limits import MuscleLimits, muscle_limits
from fastswing_planner.mask_search import SearchResult, Trial, greedy_search
from fastswing_planner.muscle_model import MuscleModel, Payload
from fastswing_planner.qp import QpSolver
from fastswing_planner.speed_index import swing_speed_index
from fastswing_planner.swing import SwingSettings, Trajectory, simulate_swing


class Method(IntEnum):
    """How to swing; the values are those of `fastswing_msgs/SwingOptions`."""

    BASIC = 0
    INHIBIT = 1
    ELONGATE = 2


@dataclass(frozen=True)
class MuscleConstants:
    """Limits that replace the robot's for the named muscles; empty arrays replace nothing."""

    muscle_names: Sequence[str] = ()
    velocity: ArrayLike = ()
    acceleration: ArrayLike = ()
    tension_min: ArrayLike = ()
    tension_max: ArrayLike = ()


@dataclass(frozen=True)
class SwingRequest:
    """What a user asks for.

    start, end      [rad] in the order of joint_names; empty joint_names: the model's order
    kept_muscles    muscles that are never masked
    constants       limits that differ from the robot's
    threshold       C [s/rad] of eq. 5 of the paper
    """

    start: ArrayLike
    end: ArrayLike
    method: Method = Method.BASIC
    joint_names: Sequence[str] = ()
    kept_muscles: Sequence[str] = ()
    constants: MuscleConstants = field(default_factory=MuscleConstants)
    threshold: float = 0.0
    payload: Payload | None = None
    settings: SwingSettings = field(default_factory=SwingSettings)


@dataclass(frozen=True)
class SwingPlan:
    """A planned swing; m muscles, n joints.

    kept             the mask m of the paper as booleans, shape (m,)
    elongation       [m] shape (m,), >= 0, 0 for kept muscles and for other methods
    holding          how the start posture is held once the masked muscles are elongated
    final_holding    how the end posture is held with all muscles
    speed_index      q [s/rad] at the midpoint, shape (m,)
    trajectory       the predicted swing
    time_cost_basic  [s] of the swing with all muscles kept
    """

    method: Method
    start: Vector
    end: Vector
    kept: BoolVector
    elongation: Vector
    holding: Holding
    final_holding: Holding
    speed_index: Vector
    trajectory: Trajectory
    time_cost_basic: float
    epsilon: float
    trials: tuple[Trial, ...]


def posture(what: str, model: MuscleModel, joint_names: Sequence[str], values: ArrayLike) -> Vector:
    """Return a checked posture [rad] in the model's joint order, shape (n,).

    Raises WrongLength, NotFinite, UnknownName, DuplicateName or OutOfRange.
    """
    angles = named_vector(what, "joint", joint_names, values, model.joint_names)
    for name, angle, low, high in zip(
        model.joint_names, angles, model.joint_lower, model.joint_upper, strict=True
    ):
        if not low <= angle <= high:
            raise OutOfRange(
                f"{what} of {name} is {angle:.4f} rad, its range is {low:.4f} to {high:.4f} rad"
            )
    return angles


def swing_postures(
    model: MuscleModel, joint_names: Sequence[str], start: ArrayLike, end: ArrayLike
) -> tuple[Vector, Vector]:
    """Return checked start and end postures [rad]; raises StartEqualsEnd and as `posture`."""
    first = posture("start_position", model, joint_names, start)
    last = posture("end_position", model, joint_names, end)
    if np.array_equal(first, last):
        angles = ", ".join(f"{angle:g}" for angle in first)
        raise StartEqualsEnd(
            f"start_position and end_position are the same ({angles} rad): nothing to swing"
        )
    return first, last


def requested_limits(
    model: MuscleModel, limits: MuscleLimits, constants: MuscleConstants
) -> MuscleLimits:
    """Return the robot's limits with the requested constants in their place.

    Raises UnknownName, DuplicateName, WrongLength, NotFinite or InvalidLimit.
    """
    index = unique_known("muscle", constants.muscle_names, model.muscle_names)
    vectors = []
    for what in ("velocity", "acceleration", "tension_min", "tension_max"):
        vector = np.array(getattr(limits, what))
        values = np.asarray(getattr(constants, what), dtype=float)
        if values.size not in (0, len(index)):
            raise WrongLength(
                f"{what} has {values.size} values, expected none or one for each of the "
                f"{len(index)} muscles in muscle_name"
            )
        if values.size:
            vector[index] = values
        vectors.append(vector)
    return muscle_limits(model.muscle_names, *vectors)


def checked_threshold(value: float) -> float:
    """Return C [s/rad]; raises InvalidLimit unless it is finite and not negative."""
    if not (np.isfinite(value) and value >= 0):
        raise InvalidLimit(
            f"threshold is {value}, must be finite and not negative: below 0 agonists would be "
            "inhibited"
        )
    return float(value)


class SwingPlanner:
    """Plans swings of one arm."""

    def __init__(self, model: MuscleModel, limits: MuscleLimits, solver: QpSolver) -> None:
        """Plan with the arm's own limits unless a request says otherwise."""
        self._model = model
        self._limits = limits
        self._solver = solver

    def hold(
        self, joint_position: Vector, payload: Payload | None = None, kept: BoolVector | None = None
    ) -> Holding:
        """Return how a posture [rad], shape (n,), is held within the robot's own limits."""
        return self._hold(joint_position, self._limits, payload, kept)

    def _hold(
        self,
        joint_position: Vector,
        limits: MuscleLimits,
        payload: Payload | None,
        kept: BoolVector | None,
    ) -> Holding:
        everything = np.ones(len(self._model.muscle_names), dtype=bool)
        return hold(
            self._solver,
            self._model.jacobian(joint_position),
            self._model.gravity_torque(joint_position, payload),
            limits,
            everything if kept is None else kept,
        )

    def plan(self, request: SwingRequest) -> SwingPlan:
        """Plan one swing.

        Raises an InvalidRequest for a wrong request, HoldingInfeasible or SwingBlocked if the arm
        cannot do it, HoldingUndecided or SolverFailed if that is not known.
        """
        model = self._model
        start, end = swing_postures(model, request.joint_names, request.start, request.end)
        limits = requested_limits(model, self._limits, request.constants)
        protected = np.zeros(len(model.muscle_names), dtype=bool)
        protected[unique_known("muscle", request.kept_muscles, model.muscle_names)] = True
        threshold = checked_threshold(request.threshold)
        payload = _checked_payload(request.payload)
        distance = float(np.linalg.norm(end - start))
        if distance < request.settings.epsilon:
            raise StartEqualsEnd(
                f"start_position and end_position are only {distance:.3g} rad apart, epsilon is "
                f"{request.settings.epsilon:g} rad: nothing to swing"
            )
        index = swing_speed_index(model, start, end, limits.velocity)

        def hold_start(kept: BoolVector) -> Holding:
            return self._hold(start, limits, payload, kept)

        def simulate(kept: BoolVector) -> Trajectory:
            return simulate_swing(model, self._solver, start, end, limits, kept, request.settings)

        basic_protected = (
            protected if request.method is Method.ELONGATE else ~np.zeros_like(protected)
        )
        search = greedy_search(index, basic_protected, hold_start, simulate)
        time_cost_basic = search.trials[0].time_cost
        final = self._hold(end, limits, payload, None)
        if not final.feasible:
            raise HoldingInfeasible(
                f"the end posture cannot be held: {final.residual:.3g} N m are missing; choose "
                "another end posture, less payload or a wider tension range"
            )
        if request.method is Method.INHIBIT:
            # o[i] = 0 if q[i] > C (eq. 5): the simulation of section IV-C masks these muscles.
            kept = ~(index > threshold) | protected
            search = SearchResult(kept, search.holding, simulate(kept), search.trials)
        return SwingPlan(
            method=request.method,
            start=start,
            end=end,
            kept=search.kept,
            elongation=(
                elongation(search.trajectory, limits, search.kept)
                if request.method is Method.ELONGATE
                else frozen(np.zeros(index.size))
            ),
            holding=search.holding,
            final_holding=final,
            speed_index=index,
            trajectory=search.trajectory,
            time_cost_basic=time_cost_basic,
            epsilon=request.settings.epsilon,
            trials=search.trials,
        )


def method_from(value: int) -> Method:
    """Return the method with this number; raises UnknownMethod listing the choices."""
    try:
        return Method(value)
    except ValueError as error:
        choices = ", ".join(f"{method.value} ({method.name.lower()})" for method in Method)
        raise UnknownMethod(f"unknown method {value}, choose from: {choices}") from error


def _checked_payload(payload: Payload | None) -> Payload | None:
    if payload is None:
        return None
    finite_vector("payload_position", payload.position, ("x", "y", "z"))
    if not (np.isfinite(payload.mass) and payload.mass >= 0):
        raise InvalidLimit(f"payload_mass is {payload.mass} kg, must be finite and not negative")
    return payload
