"""Boards, arbiter, inhibition rule and swing execution in one loop of explicit time.

The same objects as in the nodes, without ROS: deterministic and faster than real time.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from typing import NamedTuple

import numpy as np

from fastswing_inhibitor.inhibition import (
    Arming,
    Inhibition,
    InhibitionSettings,
    JointNumbers,
    Reason,
)
from fastswing_planner.errors import PlannerError
from fastswing_planner.execution.figures import SwingFigures
from fastswing_planner.execution.measurements import (
    InhibitionReport,
    JointMeasurement,
    MuscleMeasurement,
)
from fastswing_planner.execution.prepared_swing import PreparedSwing
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.execution.swing_execution import SwingCommands, SwingExecution
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import SwingRequest
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses.protocol import Fault, Mode, StateFrame, WatchdogAction
from musashi_muscle_bridge.control.command_limits import command_limits
from musashi_muscle_bridge.control.period import ControlPeriod
from musashi_muscle_bridge.emulation.boards import Boards

# Plain numbers: they compare much faster than an enumeration's members.
_NO_FAULT, _ZERO_CURRENT = int(Fault.NONE), int(Mode.ZERO_CURRENT)
_REASONS = {reason: reason.name.lower() for reason in Reason}  # likewise an enumeration's names


class Sample(NamedTuple):
    """One control period of a swing: time [s] and the boards' state."""

    time: float
    phase: Phase
    state: StateFrame


class ClosedLoop:
    """One arm with everything that moves it."""

    def __init__(
        self,
        robot: Robot,
        planner: SwingPlanner,
        rate: float = 1000.0,
        executor_rate: float = 100.0,
        inhibition_delay: float = 0.004,
    ) -> None:
        """Compose the loop.

        rate              [Hz] of the control period
        executor_rate     [Hz] of the executor's commands
        inhibition_delay  [s] from a joint state to the override that follows from it; through ROS
                          it travels to the inhibitor and back
        """
        self._robot = robot
        self._planner = planner
        self._period = 1.0 / rate
        self._periods_per_order = max(1, round(rate / executor_rate))
        self.boards = Boards(robot)
        self.control = ControlPeriod(
            robot, command_limits(robot, 0.1, 0.2, 0.2), WatchdogAction.ZERO_CURRENT, 0.1
        )
        self._inhibition = Inhibition(robot.model, robot.limits.velocity, InhibitionSettings())
        self._healthy = bytes([_NO_FAULT] * len(robot.model.muscle_names))
        self._overrides: deque[list[int]] = deque([[]] * round(inhibition_delay * rate))
        self._now = 0.0
        self._state = self.boards.handle(self.control.first_command())
        self.samples: list[Sample] = []

    def run(
        self, plan: SwingPlan, settings: ExecutionSettings, request: SwingRequest | None = None
    ) -> SwingFigures:
        """Carry out a plan and return what was measured; raises PlannerError if it aborts.

        request  what was planned: its threshold, kept muscles and payload; None: the defaults
        """
        request = request or SwingRequest(plan.start, plan.end)
        names = self._robot.model.muscle_names
        protected = np.isin(names, list(request.kept_muscles))
        arming = Arming(plan.end, request.threshold, protected, settings.arming_limit, 0.0)
        self._advance()
        execution = SwingExecution(
            self._robot.model,
            lambda posture: self._planner.hold(posture, request.payload),
            self._robot.wire_stiffness,
            PreparedSwing.of(plan),
            settings,
            self._joints(),
            self._muscles(),
        )
        while not execution.done:
            for _ in range(self._periods_per_order):
                self._advance()
                joints = self._joints()
                self._inhibit(joints, execution)
                execution.add_joints(joints)
                execution.add_muscles(self._muscles())
                self.samples.append(Sample(self._now, execution.phase, self._state))
            self._carry_out(execution.step(self._now), execution, arming)
        figures = execution.figures
        if figures is None:
            raise PlannerError("the swing ended without a measurement")
        return figures

    def _advance(self) -> None:
        self._now += self._period
        self.boards.advance(self._period)
        self._state = self.boards.handle(self.control.next_command(self._state, self._now))

    def _joints(self) -> JointMeasurement:
        rows = self._state.joints
        return JointMeasurement(
            self._now, rows["position"].astype(float), rows["velocity"].astype(float)
        )

    def _muscles(self) -> MuscleMeasurement:
        rows = self._state.rows
        fault, mode = rows["fault"].tobytes(), rows["mode"].tobytes()
        return MuscleMeasurement(
            self._now,
            rows["length"].astype(float),
            rows["velocity"].astype(float),
            rows["tension"].astype(float),
            () if fault == self._healthy else self._names([code != _NO_FAULT for code in fault]),
            self._names([code == _ZERO_CURRENT for code in mode]) if _ZERO_CURRENT in mode else (),
        )

    def _names(self, chosen: Sequence[bool]) -> tuple[str, ...]:
        return tuple(compress(self._robot.model.muscle_names, chosen))

    def _inhibit(self, joints: JointMeasurement, execution: SwingExecution) -> None:
        inhibited: list[int] = []
        if self._inhibition.armed:
            time, position, velocity = joints
            numbers = JointNumbers(time, position.tolist(), velocity.tolist())
            decision = self._inhibition.decide(numbers)
            inhibited = [muscle for muscle, off in enumerate(decision.inhibited) if off]
            execution.add_inhibition(
                InhibitionReport(
                    self._now,
                    self._inhibition.armed,
                    decision.reason is Reason.GOAL_REACHED,
                    _REASONS[decision.reason],
                )
            )
        else:
            self._inhibition.see(joints.time)
        self._overrides.append(inhibited)
        self.control.arbiter.override(self._overrides.popleft(), 0.05, self._now)

    def _carry_out(
        self, commands: SwingCommands, execution: SwingExecution, arming: Arming
    ) -> None:
        if commands.lengths is not None:
            self.control.arbiter.command(Mode.LENGTH, slice(None), commands.lengths, self._now)
        if commands.arm:
            self._inhibition.arm(replace(arming, start_time=self._now))
            execution.inhibitor_armed()
        if commands.disarm:
            self._inhibition.disarm(Reason.DISARMED)
            self.control.arbiter.override([], 0.0, self._now)
