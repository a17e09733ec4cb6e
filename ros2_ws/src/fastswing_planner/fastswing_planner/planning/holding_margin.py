"""How far a held posture is from one that can no longer be held."""

from functools import cache
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.qp.problem import QpSolver, QuadraticProgram

_MOST_FACES = 5000
_FULL_RANK = 1e-6  # of the largest singular value
_SMALLEST_SHARE = 1e-6  # of the largest


def holding_margin(
    solver: QpSolver,
    muscle_jacobian: Matrix,
    torque: Vector,
    tension_min: Vector,
    tension_max: Vector,
    tension: Vector,
) -> float:
    """Return the largest torque [N m], in whatever direction, that may be added to a held one.

    muscle_jacobian           G [m/rad] of the kept muscles, shape (k, n)
    torque                    tau^nec [N m], shape (n,)
    tension_min, tension_max  [N] shape (k,)
    tension                   [N] that hold tau^nec, shape (k,)

    It is the exact distance to infeasibility where the set of torques that can be held has at
    most 5000 pairs of faces (10 muscles and 5 joints: 210), else a lower bound of it.
    """
    joint_count = torque.size
    singular = np.linalg.svd(muscle_jacobian, compute_uv=False)
    if singular.size < joint_count or singular[-1] < _FULL_RANK * singular[0]:
        return 0.0
    if comb(tension.size, joint_count - 1) <= _MOST_FACES:
        return _distance_to_faces(muscle_jacobian, torque, tension_min, tension_max)
    return _distance_bound(solver, muscle_jacobian, tension_min, tension_max, tension)


def _distance_to_faces(
    muscle_jacobian: Matrix, torque: Vector, tension_min: Vector, tension_max: Vector
) -> float:
    """Return the distance [N m] from tau^nec to the nearest face of the torques that can be held.

    These torques, {-G^T f : f^min <= f <= f^max}, are a zonotope: each of its faces is parallel
    to the arms of n - 1 muscles.
    """
    joint_count = torque.size
    spans = _spans(tension_min.size, joint_count - 1)
    # The last column of a complete Q is normal to what the others span.
    columns = np.swapaxes(muscle_jacobian[spans], 1, 2)
    normals = np.linalg.qr(columns, mode="complete")[0][:, :, -1]
    normals = np.concatenate([normals, -normals])
    # distance = max over f of u^T (-G^T f) - u^T tau^nec, for each normal u
    pull = -normals @ muscle_jacobian.T
    farthest = np.maximum(pull * tension_min, pull * tension_max).sum(axis=1)
    return max(float(np.min(farthest - normals @ torque)), 0.0)


@cache
def _spans(muscle_count: int, size: int) -> NDArray[np.int_]:
    """Return all sets of so many muscles, shape (sets, size)."""
    spans = np.array(list(combinations(range(muscle_count), size)), dtype=int)
    spans.setflags(write=False)
    return spans


def _distance_bound(
    solver: QpSolver,
    muscle_jacobian: Matrix,
    tension_min: Vector,
    tension_max: Vector,
    tension: Vector,
) -> float:
    """Return a torque [N m] that can be added in any direction, by sharing it out linearly.

    With W = pinv(G^T), an added torque t changes f by -W t, at most |w_i| |t| in muscle i. So
    |t| <= r is held if f keeps r |w_i| away from its bounds; f is chosen for the largest r.
    """
    count = tension.size
    share = np.linalg.norm(np.linalg.pinv(muscle_jacobian.T), axis=1)
    unit = float(np.max(tension_max))
    scale = float(np.max(share))
    # maximise r subject to G^T f = G^T f_held,  f^min + r |w| <= f <= f^max - r |w|
    column = (share / scale)[:, np.newaxis]
    arms = muscle_jacobian.T / np.abs(muscle_jacobian).max()
    no_limit = np.full(count, 1e6)
    weight = np.full(count + 1, 1e-4)
    cost = np.zeros(count + 1)
    cost[-1] = -1.0
    answer = solver.solve(
        QuadraticProgram(
            P=np.diag(weight),
            c=cost,
            A=np.hstack([arms, np.zeros((arms.shape[0], 1))]),
            b=arms @ (tension / unit),
            C=np.block([[np.eye(count), -column], [np.eye(count), column]]),
            lower=np.concatenate([tension_min / unit, -no_limit]),
            upper=np.concatenate([no_limit, tension_max / unit]),
        )
    )
    held = answer[:-1] * unit
    spare = np.minimum(held - tension_min, tension_max - held)
    # A muscle without moment arm takes no share, so that its bounds do not count.
    sharing = share > _SMALLEST_SHARE * scale
    return max(float(np.min(spare[sharing] / share[sharing])), 0.0)
