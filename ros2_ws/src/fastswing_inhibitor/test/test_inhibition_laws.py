"""Whatever happens while armed, nothing is let go after the end, and the end comes in time."""

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from fastswing_inhibitor.inhibition import (
    Arming,
    Inhibition,
    InhibitionSettings,
    JointNumbers,
    Reason,
)
from fastswing_planner.arrays import frozen
from fastswing_planner.errors import NotReady, StaleState
from fastswing_planner.testing.arms import LinearArm

# One joint with an agonist and an antagonist.
JACOBIAN = frozen([[0.06], [-0.06]])
SETTINGS = InhibitionSettings()
LIMIT_SEC = 1.0


class AnyArming(RuleBasedStateMachine):
    """States come late, jump or stay away; somebody arms and disarms at any time."""

    @initialize()
    def begin(self) -> None:
        self.inhibition = Inhibition(
            LinearArm(JACOBIAN, joint_range=10.0), frozen([0.3, 0.3]), SETTINGS
        )
        self.now = 10.0
        self.armed_at = -np.inf
        self.newest = -np.inf
        self.place = 0.0

    @rule(elapsed=st.floats(0.0, 0.08))
    def wait(self, elapsed: float) -> None:
        self.now += elapsed
        self.inhibition.watch(self.now)

    @rule(goal=st.floats(-2.0, 2.0), kept=st.booleans())
    def arm(self, goal: float, kept: bool) -> None:
        if self.inhibition.armed:
            return
        arming = Arming(frozen([goal]), 0.0, np.array([kept, False]), LIMIT_SEC, self.now)
        try:
            self.inhibition.arm(arming)
        except (NotReady, StaleState):
            assert not self.inhibition.armed
            assert self.now - self.newest > SETTINGS.state_timeout
            return
        self.armed_at, self.kept = self.now, kept

    @rule()
    def disarm(self) -> None:
        self.inhibition.disarm(Reason.DISARMED)
        assert not self.inhibition.armed

    @rule(age=st.floats(0.0, 0.07), move=st.floats(-0.5, 0.5), speed=st.floats(-5.0, 5.0))
    def measure(self, age: float, move: float, speed: float) -> None:
        self.place += move
        joints = JointNumbers(self.now - age, [self.place], [speed])
        if not self.inhibition.armed:
            self.inhibition.see(joints.time)
            self.newest = joints.time
            return
        try:
            decision = self.inhibition.decide(joints, self.now)
        except StaleState:
            assert age > SETTINGS.state_timeout
            self.inhibition.reject(self.now)
            return
        if decision.reason is Reason.NONE:
            self.newest = joints.time
            assert not (self.kept and decision.inhibited[0])
            assert not all(decision.inhibited)
        else:
            assert not any(decision.inhibited)

    @rule()
    def reject(self) -> None:
        self.inhibition.reject(self.now)

    @invariant()
    def an_end_comes_in_time(self) -> None:
        if not hasattr(self, "inhibition"):
            return
        self.inhibition.watch(self.now)
        if self.inhibition.armed:
            assert self.inhibition.reason is Reason.NONE
            assert self.now - self.armed_at <= LIMIT_SEC
            assert self.now - max(self.newest, self.armed_at) <= SETTINGS.state_timeout
        else:
            assert self.inhibition.reason is not Reason.NONE


AnyArming.TestCase.settings = settings(
    max_examples=60, stateful_step_count=40, deadline=None, derandomize=True
)
test_an_armed_inhibitor_ends_in_time = AnyArming.TestCase
