"""A request becomes a task: every number checked against the robot."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fastswing_planner.arrays import (
    BoolVector,
    Matrix,
    Vector,
    finite_vector,
    frozen,
    named_vector,
    unique_known,
)
from fastswing_planner.errors import (
    InvalidLimit,
    InvalidWeight,
    NotFinite,
    OutOfRange,
    StartEqualsEnd,
    WrongLength,
)
from fastswing_planner.planning.request import Method, MuscleConstants, Search, SwingRequest
from fastswing_planner.planning.swing import SwingSettings
from fastswing_planner.robot.limits import MuscleLimits
from fastswing_planner.robot.muscle_model import MuscleModel, Payload

_LARGEST_POSITION = 1000.0  # [rad] of a joint without limits
_LARGEST_THRESHOLD = 1e6  # [s/rad]
_LARGEST_MASS = 1e4  # [kg]
_LARGEST_DISTANCE = 100.0  # [m]
_WORST_WEIGHT = 1e-6  # smallest eigenvalue of a weight, in parts of its largest


@dataclass(frozen=True)
class SwingTask:
    """A checked request: m muscles and n joints in the model's order.

    protected       muscles that are never masked, shape (m,)
    holding_weight  W1, shape (m, m)
    swing_weight    W2, shape (n, n)
    """

    start: Vector
    end: Vector
    method: Method
    limits: MuscleLimits
    protected: BoolVector
    threshold: float
    payload: Payload | None
    settings: SwingSettings
    holding_weight: Matrix
    swing_weight: Matrix
    search: Search
    time_limit: float


def checked_task(model: MuscleModel, limits: MuscleLimits, request: SwingRequest) -> SwingTask:
    """Return the request in the model's order, every value checked.

    limits  the robot's own, used where the request has no others

    Raises an InvalidRequest that names the value and what would be right.
    """
    muscles, joints = model.muscle_names, model.joint_names
    start, end = swing_postures(model, request.joint_names, request.start, request.end)
    distance = float(np.linalg.norm(end - start))
    if distance < request.settings.epsilon:
        raise StartEqualsEnd(
            f"start_position and end_position are only {distance:.3g} rad apart, epsilon is "
            f"{request.settings.epsilon:g} rad: nothing to swing"
        )
    protected = np.zeros(len(muscles), dtype=bool)
    protected[unique_known("muscle", request.kept_muscles, muscles)] = True
    constants = request.constants
    return SwingTask(
        start=start,
        end=end,
        method=request.method,
        limits=requested_limits(model, limits, constants),
        protected=protected,
        threshold=checked_threshold(request.threshold),
        payload=_checked_payload(request.payload),
        settings=request.settings,
        holding_weight=_checked_weight(
            "holding_weight", "muscle", constants.holding_weight, constants.muscle_names, muscles
        ),
        swing_weight=_checked_weight(
            "swing_weight", "joint", request.swing_weight, request.joint_names, joints
        ),
        search=request.search,
        time_limit=checked_time_limit(request.time_limit),
    )


def posture(what: str, model: MuscleModel, joint_names: Sequence[str], values: ArrayLike) -> Vector:
    """Return a checked posture [rad] in the model's joint order, shape (n,).

    Raises WrongLength, NotFinite, UnknownName, DuplicateName or OutOfRange.
    """
    angles = named_vector(what, "joint", joint_names, values, model.joint_names)
    lower = np.maximum(model.joint_lower, -_LARGEST_POSITION)
    upper = np.minimum(model.joint_upper, _LARGEST_POSITION)
    for name, angle, low, high in zip(model.joint_names, angles, lower, upper, strict=True):
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

    limits  as `muscle_limits` made them; returned as they are if nothing else is requested

    Raises UnknownName, DuplicateName, WrongLength, NotFinite, InvalidLimit or InvalidTensionRange.
    """
    index = unique_known("muscle", constants.muscle_names, model.muscle_names)
    index = index or list(range(len(model.muscle_names)))
    changed = {}
    for field_name, what in (
        ("velocity", "velocity_limit"),
        ("acceleration", "acceleration_limit"),
        ("tension_min", "tension_min"),
        ("tension_max", "tension_max"),
    ):
        values = np.asarray(getattr(constants, field_name), dtype=float)
        if values.size:
            _require_size(what, values, index, constants.muscle_names)
            vector = np.array(getattr(limits, field_name))
            vector[index] = values
            changed[field_name] = vector
    if not changed:
        return limits
    return replace(limits, **changed).checked(model.muscle_names)


def checked_threshold(value: float) -> float:
    """Return C [s/rad]; raises NotFinite or InvalidLimit unless it is finite and not negative."""
    if not np.isfinite(value):
        raise NotFinite(f"threshold is {value}, expected a finite number")
    if not 0 <= value <= _LARGEST_THRESHOLD:
        raise InvalidLimit(
            f"threshold is {value:g} s/rad, must be 0 to {_LARGEST_THRESHOLD:g}: below 0 agonists "
            "would be inhibited"
        )
    return float(value)


def _require_size(
    what: str, values: Vector, index: Sequence[int], muscle_names: Sequence[str]
) -> None:
    if values.shape != (len(index),):
        named = "muscles in muscle_name" if muscle_names else "muscles"
        raise WrongLength(
            f"{what} has {values.size} values, expected none or one for each of the "
            f"{len(index)} {named}"
        )


def _checked_weight(
    what: str, kind: str, values: ArrayLike, names: Sequence[str], valid: Sequence[str]
) -> Matrix:
    """Return a weight whose largest eigenvalue is 1: only the ratios within it matter."""
    index = unique_known(kind, names, valid) or list(range(len(valid)))
    count, given = len(index), np.asarray(values, dtype=float)
    if given.size not in (0, count, count * count):
        raise WrongLength(
            f"{what} has {given.size} values, expected none, {count} (the diagonal) or "
            f"{count * count} (all of it, row by row)"
        )
    if not np.isfinite(given).all():
        raise NotFinite(f"{what} holds {given[~np.isfinite(given)][0]}, expected finite numbers")
    weight = np.eye(len(valid))
    if not given.size:
        return frozen(weight)
    diagonal = given.size == count
    weight[np.ix_(index, index)] = np.diag(given) if diagonal else given.reshape(count, count)
    size = float(np.abs(weight).max()) or 1.0
    weight = weight / size
    if not np.allclose(weight, weight.T, rtol=0.0, atol=1e-9):
        row, column = map(int, np.unravel_index(np.argmax(np.abs(weight - weight.T)), weight.shape))
        one, other = valid[row], valid[column]
        raise InvalidWeight(
            f"{what} is not symmetric: {weight[row, column] * size:g} for {one} with {other}, "
            f"but {weight[column, row] * size:g} for {other} with {one}"
        )
    eigenvalues = np.linalg.eigvalsh(weight)
    if not eigenvalues[0] > _WORST_WEIGHT * eigenvalues[-1] >= 0.0:
        raise InvalidWeight(
            f"{what} is not positive definite: its eigenvalues reach from "
            f"{eigenvalues[0] * size:g} to {eigenvalues[-1] * size:g}, the smallest must be above "
            f"{_WORST_WEIGHT:g} of the largest"
        )
    return frozen(weight / eigenvalues[-1])


def _checked_payload(payload: Payload | None) -> Payload | None:
    if payload is None:
        return None
    position = finite_vector("payload_position", payload.position, ("x", "y", "z"))
    if np.abs(position).max() > _LARGEST_DISTANCE:
        raise InvalidLimit(
            f"payload_position is {position.tolist()} m, must be within {_LARGEST_DISTANCE:g} m"
        )
    if not np.isfinite(payload.mass):
        raise NotFinite(f"payload_mass is {payload.mass}, expected a finite number")
    if not 0 <= payload.mass <= _LARGEST_MASS:
        raise InvalidLimit(f"payload_mass is {payload.mass:g} kg, must be 0 to {_LARGEST_MASS:g}")
    return payload


def checked_time_limit(value: float) -> float:
    """Return a search's time limit [s]; raises NotFinite or InvalidLimit unless it is positive."""
    if np.isnan(value):
        raise NotFinite("search_time_limit is nan, expected a number of seconds")
    if not value > 0:
        raise InvalidLimit(f"search_time_limit is {value:g} s, must be positive")
    return float(value)
