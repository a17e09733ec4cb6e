"""The planner as one would write it plainly: MuJoCo, qpsolvers and quadprog, nothing reused.

The same mathematics and masks, without checks, weights, couplings, laws and error messages.
"""

from dataclasses import dataclass
from itertools import combinations
from math import comb

import mujoco
import numpy as np
from numpy.typing import NDArray
from qpsolvers import solve_qp
from scipy.optimize import lsq_linear

from fastswing_planner.robot.description import Robot

Array = NDArray[np.float64]
EPSILON, MOST_STEPS, MOST_FACES = 0.01, 400, 5000


@dataclass(frozen=True)
class PlainPlan:
    """What came out; m muscles, k steps.

    masked      muscles to pay out, in decreasing q
    steps       of the swing
    tension     [N] that holds the start, shape (m,)
    final       [N] that holds the end, shape (m,)
    elongation  [m] shape (m,)
    margin      [N m] of the start; NaN where it is not computed
    """

    masked: tuple[int, ...]
    steps: int
    tension: Array
    final: Array
    elongation: Array
    margin: float


class PlainPlanner:
    """Plans the swing from `start` to `end` of a robot whose joints and muscles are all chosen."""

    def __init__(self, robot: Robot, whole: bool = True, time_step: float = 0.03) -> None:
        """Load the MJCF.

        whole      answer what the planner answers: also the missing torque of each mask, and the
                   margin where it is exact; otherwise what stands in the paper
        time_step  [s]
        """
        self._robot = robot
        self._whole = whole
        self._dt = time_step
        self._model = mujoco.MjModel.from_xml_path(str(robot.mjcf))
        self._data = mujoco.MjData(self._model)
        names = robot.model.muscle_names, robot.model.joint_names
        self._muscles = [self._model.tendon(name).id for name in names[0]]
        self._joints = [self._model.joint(name).qposadr[0] for name in names[1]]

    def _forward(self, position: Array) -> tuple[Array, Array]:
        """Return muscle lengths [m] and G [m/rad]."""
        self._data.qpos[self._joints] = position
        mujoco.mj_forward(self._model, self._data)
        dense = np.zeros((self._model.ntendon, self._model.nv))
        model, data = self._model, self._data
        mujoco.mju_sparse2dense(
            dense, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
        )
        arms = dense[self._muscles][:, self._joints]
        return np.array(data.ten_length[self._muscles]), arms

    def _statics(self, position: Array) -> tuple[Array, Array]:
        """Return G [m/rad] and tau^nec [N m]."""
        _, arms = self._forward(position)
        return arms, (self._data.qfrc_bias - self._data.qfrc_passive)[self._joints]

    def _margin(self, position: Array, kept: list[int]) -> float:
        """Return the distance [N m] to the nearest face of the torques that can be held."""
        arms, torque = self._statics(position)
        arms, limits, nearest = arms[kept], self._robot.limits, np.inf
        if not self._whole or comb(len(kept), torque.size - 1) > MOST_FACES:
            return np.nan
        for span in combinations(range(len(kept)), torque.size - 1):
            normal = np.linalg.svd(arms[list(span)])[2][-1]
            for one in (normal, -normal):
                pull = -arms @ one
                most = np.maximum(pull * limits.tension_min[kept], pull * limits.tension_max[kept])
                nearest = min(nearest, float(most.sum() - one @ torque))
        return nearest

    def _hold(self, position: Array, kept: list[int]) -> Array | None:
        """Return the least tensions [N] of eq. 6, None if the posture cannot be held."""
        limits = self._robot.limits
        arms, torque = self._statics(position)
        if self._whole:
            bounds = (limits.tension_min[kept], limits.tension_max[kept])
            nearest = lsq_linear(-arms[kept].T, torque, bounds, method="bvls").x
            if np.linalg.norm(arms[kept].T @ nearest + torque) > 1e-4:
                return None
        found = solve_qp(
            np.eye(len(kept)),
            np.zeros(len(kept)),
            A=-arms[kept].T,
            b=torque,
            lb=limits.tension_min[kept],
            ub=limits.tension_max[kept],
            solver="quadprog",
        )
        if found is None:
            return None
        tension = np.zeros(len(self._muscles))
        tension[kept] = found
        return tension

    def _swing(self, start: Array, end: Array, kept: list[int]) -> list[Array] | None:
        """Return the muscle lengths [m] after each step (eqs. 7 to 9), None if it gets stuck."""
        limits = self._robot.limits
        position, speed = start, np.zeros(len(self._muscles))
        lengths, arms = self._forward(position)
        path = [lengths]
        while np.linalg.norm(end - position) >= EPSILON:
            if len(path) > MOST_STEPS:
                return None
            gain = limits.acceleration * self._dt
            highest = np.minimum(np.maximum(speed + gain, 0.0), limits.velocity)
            lowest = np.maximum(np.minimum(speed - gain, 0.0), -limits.velocity)
            step = solve_qp(
                np.eye(start.size),
                position - end,
                G=np.vstack([arms[kept], -arms[kept]]),
                h=np.concatenate([highest[kept] * self._dt, -lowest[kept] * self._dt]),
                solver="quadprog",
            )
            if step is None:
                return None
            position = position + step
            speed = arms @ step / self._dt
            lengths, arms = self._forward(position)
            path.append(lengths)
        return path

    def plan(self, elongate: bool) -> PlainPlan:
        """Plan with all muscles, or by Method 2 with the greedy search."""
        start, end = self._robot.postures["start"], self._robot.postures["end"]
        limits, everything = self._robot.limits, list(range(len(self._muscles)))
        _, arms = self._forward((start + end) / 2.0)
        index = arms @ (end - start) / np.linalg.norm(end - start) / limits.velocity
        order = [int(i) for i in np.argsort(-index) if index[i] > 0.0] if elongate else []
        final = self._hold(end, everything)
        best: tuple[tuple[int, int, float], tuple[int, ...], Array, list[Array]] | None = None
        for count in range(len(order) + 1):
            masked = tuple(order[:count])
            kept = [muscle for muscle in everything if muscle not in masked]
            tension = self._hold(start, kept)
            if tension is None:
                break
            path = self._swing(start, end, kept)
            if path is None:
                continue
            rank = (len(path), count, float(tension.max()))
            if best is None or rank < best[0]:
                best = (rank, masked, tension, path)
        if best is None or final is None:
            raise ValueError("the plain planner finds no swing")
        _, masked, tension, path = best
        kept = [muscle for muscle in everything if muscle not in masked]
        ahead, margin = self._ahead(path, list(masked)), self._margin(start, kept)
        return PlainPlan(masked, len(path) - 1, tension, final, ahead, margin)

    def _ahead(self, path: list[Array], masked: list[int]) -> Array:
        """Return how far [m] the masked muscles' paths run ahead of the fastest payout."""
        limits = self._robot.limits
        speed = paid_out = most = np.zeros(len(self._muscles))
        for lengths in path[1:]:
            speed = np.minimum(speed + limits.acceleration * self._dt, limits.velocity)
            paid_out = paid_out + speed * self._dt
            most = np.maximum(most, lengths - path[0] - paid_out)
        found = np.zeros(len(self._muscles))
        found[masked] = most[masked]
        return found
