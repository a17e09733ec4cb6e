"""Plans swings by each of the methods."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fastswing_planner.arrays import BoolVector, Matrix, Vector, frozen_flags
from fastswing_planner.errors import HoldingInfeasible, InvalidLimit, PlannerError, SingularJacobian
from fastswing_planner.planning.elongation import elongation
from fastswing_planner.planning.holding import Holding, hold
from fastswing_planner.planning.holding_margin import holding_margin
from fastswing_planner.planning.known_swings import KnownSwings
from fastswing_planner.planning.mask_search import Candidate, MaskSearch, SearchResult, antagonists
from fastswing_planner.planning.plan import Outcome, SwingPlan
from fastswing_planner.planning.request import Method, Search, SwingRequest
from fastswing_planner.planning.speed_index import swing_speed_index
from fastswing_planner.planning.swing import Trajectory, simulate_swing
from fastswing_planner.planning.task import SwingTask, checked_task
from fastswing_planner.qp.problem import QpSolver
from fastswing_planner.robot.limits import MuscleLimits
from fastswing_planner.robot.muscle_model import MuscleModel, Payload

HIGH_TENSION = 0.8
"""A plan warns where a muscle holds above this part of its tension_max."""
_MOST_UNLIMITED = 16  # antagonists that an exhaustive search takes on without a time limit
_FULL_RANK = 1e-6  # of the largest singular value


class SwingPlanner:
    """Plans swings of one arm."""

    def __init__(self, model: MuscleModel, limits: MuscleLimits, solver: QpSolver) -> None:
        """Plan with the arm's own limits unless a request says otherwise.

        Raises InvalidLimit, InvalidTensionRange or NotFinite for limits that make no sense.
        """
        self._model = model
        # Once: requests that change none of them are planned without another look.
        self._limits = limits.checked(model.muscle_names)
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
        weight: Matrix | None = None,
    ) -> Holding:
        everything = np.ones(len(self._model.muscle_names), dtype=bool)
        return hold(
            self._solver,
            self._model.jacobian(joint_position),
            self._model.gravity_torque(joint_position, payload),
            limits,
            everything if kept is None else kept,
            weight,
        )

    def plan(self, request: SwingRequest, clock: Callable[[], float] | None = None) -> SwingPlan:
        """Plan one swing.

        clock  the time [s], such as time.monotonic; needed where the request has a time limit

        Raises an InvalidRequest for a wrong request, HoldingInfeasible, SwingBlocked or
        SingularJacobian if the arm cannot do it, HoldingUndecided or SolverFailed if that is not
        known.
        """
        task = checked_task(self._model, self._limits, request)
        self._require_muscles_for_every_joint(task)
        index = swing_speed_index(self._model, task.start, task.end, task.limits.velocity)
        swings = KnownSwings(lambda kept, like: self._simulate(task, kept, like))
        search = self._search(task, index, swings, clock)
        final = self._hold(task.end, task.limits, task.payload, None, task.holding_weight)
        if not final.feasible:
            raise HoldingInfeasible(
                f"the end posture cannot be held: {final.residual:.3g} N m are missing; choose "
                "another end posture, less payload or a wider tension range"
            )
        best, inhibited = _with_inhibition(task, index, search.best, swings)
        plan = SwingPlan(
            joint_names=self._model.joint_names,
            muscle_names=self._model.muscle_names,
            method=task.method,
            start=task.start,
            end=task.end,
            kept=frozen_flags(best.kept),
            inhibited=frozen_flags(inhibited),
            elongation=elongation(best.trajectory, task.limits, best.kept | inhibited),
            basic_tension=search.basic.holding.tension,
            holding_tension=best.holding.tension,
            holding_margin=self._margin(task, search.best),
            final_tension=final.tension,
            speed_index=index,
            trajectory=best.trajectory,
            time_cost_basic=search.basic.trajectory.time_cost,
            epsilon=task.settings.epsilon,
            trials=search.trials,
            proven=search.proven and task.method.elongates,
            warnings=(),
        )
        return replace(plan, warnings=_warnings(plan, task.limits, search.cut))

    def compare(
        self, request: SwingRequest, clock: Callable[[], float] | None = None
    ) -> tuple[Outcome, ...]:
        """Plan one swing by each method; an error is kept as that method's outcome."""
        outcomes = []
        for method in Method:
            try:
                outcomes.append(Outcome(method, self.plan(replace(request, method=method), clock)))
            except PlannerError as error:
                outcomes.append(Outcome(method, None, error))
        return tuple(outcomes)

    def _require_muscles_for_every_joint(self, task: SwingTask) -> None:
        for what, posture in (
            ("start", task.start),
            ("midpoint", (task.start + task.end) / 2.0),
            ("end", task.end),
        ):
            muscle_jacobian = self._model.jacobian(posture)
            sizes = np.linalg.svd(muscle_jacobian, compute_uv=False)
            if sizes.size == posture.size and sizes[-1] > _FULL_RANK * sizes[0]:
                continue
            _, sizes, rows = np.linalg.svd(muscle_jacobian)
            loose = rows[np.count_nonzero(sizes > _FULL_RANK * sizes[0]) :]
            if loose.size:
                names = [
                    name
                    for name, share in zip(
                        self._model.joint_names, np.abs(loose).max(axis=0), strict=True
                    )
                    if share > 0.01
                ]
                raise SingularJacobian(
                    f"the muscle Jacobian is singular at the {what} of the swing: no muscle "
                    f"restrains some motion of {', '.join(names)}; leave joints out of the "
                    "robot's description, or add muscles"
                )

    def _search(
        self,
        task: SwingTask,
        index: Vector,
        swings: KnownSwings,
        clock: Callable[[], float] | None,
    ) -> SearchResult:
        muscle_jacobian = self._model.jacobian(task.start)
        torque = self._model.gravity_torque(task.start, task.payload)

        def hold_start(kept: BoolVector) -> Holding:
            weight = task.holding_weight
            return hold(self._solver, muscle_jacobian, torque, task.limits, kept, weight)

        candidates = antagonists(index, task.protected) if task.method.elongates else []
        search = MaskSearch(
            index.size,
            hold_start,
            swings.swing,
            _deadline(task, clock, len(candidates)),
        )
        if task.search is Search.EXHAUSTIVE:
            return search.exhaustive(candidates, task.limits.tension_min)
        return search.greedy(candidates)

    def _simulate(self, task: SwingTask, kept: BoolVector, like: Trajectory | None) -> Trajectory:
        return simulate_swing(
            self._model,
            self._solver,
            task.start,
            task.end,
            task.limits,
            kept,
            task.settings,
            task.swing_weight,
            like,
        )

    def _margin(self, task: SwingTask, best: Candidate) -> float:
        kept, limits = best.kept, task.limits
        return holding_margin(
            self._solver,
            self._model.jacobian(task.start)[kept],
            self._model.gravity_torque(task.start, task.payload),
            limits.tension_min[kept],
            limits.tension_max[kept],
            best.holding.tension[kept],
        )


def _with_inhibition(
    task: SwingTask, index: Vector, best: Candidate, swings: KnownSwings
) -> tuple[Candidate, BoolVector]:
    """Return the swing that Method 1 makes of the best mask, and what it inhibits."""
    if not task.method.inhibits:
        return best, np.zeros(index.size, dtype=bool)
    # o[i] = 0 if q[i] > C (eq. 5): the simulation of section IV-C masks these muscles.
    inhibited = (index > task.threshold) & ~task.protected & best.kept
    kept = best.kept & ~inhibited
    return Candidate(kept, best.holding, swings.swing(kept)), inhibited


def _deadline(
    task: SwingTask, clock: Callable[[], float] | None, candidate_count: int
) -> Callable[[], bool]:
    if np.isinf(task.time_limit):
        if task.search is Search.EXHAUSTIVE and candidate_count > _MOST_UNLIMITED:
            raise InvalidLimit(
                f"an exhaustive search of {candidate_count} antagonists needs a search_time_limit "
                f"(up to {_MOST_UNLIMITED} go without)"
            )
        return lambda: False
    if clock is None:
        raise InvalidLimit("a search_time_limit needs a clock, such as time.monotonic")
    begin = clock()
    return lambda: clock() - begin >= task.time_limit


def _warnings(plan: SwingPlan, limits: MuscleLimits, cut: bool) -> tuple[str, ...]:
    texts = []
    for what, tension in (
        ("start", plan.holding_tension),
        ("end", plan.final_tension),
    ):
        for name, value, limit in zip(plan.muscle_names, tension, limits.tension_max, strict=True):
            if value > HIGH_TENSION * limit:
                texts.append(
                    f"{name} holds the {what} posture with {value:.0f} N, "
                    f"{value / limit:.0%} of its tension_max {limit:g} N"
                )
    if cut:
        texts.append("the search ended at its time limit: a better mask may exist")
    return tuple(texts)
