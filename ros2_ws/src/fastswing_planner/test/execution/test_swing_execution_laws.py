"""Whatever happens to a swing, it ends in a held posture and commands nothing afterwards."""

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.errors import SwingAborted
from fastswing_planner.execution.measurements import (
    InhibitionReport,
    JointMeasurement,
    MuscleMeasurement,
)
from fastswing_planner.execution.prepared_swing import PreparedSwing
from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.execution.swing_execution import SwingCommands, SwingExecution
from fastswing_planner.planning.holding import Holding
from fastswing_planner.planning.request import Method
from fastswing_planner.testing.arms import LinearArm

START, END = -1.0, 0.5
PERIOD = 0.01
JACOBIAN = frozen([[0.05], [-0.04]])
SETTINGS = ExecutionSettings(raise_speed=3.0, elongate_speed=0.3, rest_time=0.05)
LONGEST_SEC = sum(
    getattr(SETTINGS, name)
    for name in ("raise_limit", "elongate_limit", "settle_limit", "swing_limit", "recover_limit")
)
FASTEST = 0.15 + np.pi / 2 * 0.3
"""[m/s] of the ways before the swing: 3 rad/s at 0.05 m, or paying out."""


class AnySwing(RuleBasedStateMachine):
    """The arm obeys or not, states come or not, people interfere, the executor stalls."""

    @initialize(method=st.sampled_from(Method), place=st.floats(-2.0, 2.0))
    def begin(self, method: Method, place: float) -> None:
        self.now = 10.0
        self.began = self.now
        self.place, self.speed = place, 0.0
        self.health = MuscleMeasurement(
            self.now, frozen([0.1, 0.2]), frozen([0.0, 0.0]), frozen([50.0, 50.0])
        )
        swing = PreparedSwing(
            method,
            frozen([START]),
            frozen([END]),
            frozen([0.02, 0.0]),
            frozen([70.0, 25.0]),
            frozen([35.0, 50.0]),
        )
        self.method = method
        self.execution = SwingExecution(
            LinearArm(JACOBIAN),
            lambda _: Holding(True, 0.0, frozen([50.0, 50.0])),
            frozen([7000.0, 7000.0]),
            swing,
            SETTINGS,
            self.joints(),
            self.health,
        )
        self.ended = ""
        self.armings = 0
        self.silent = False
        self.phases = [Phase.RAISE]
        self.last_lengths: Vector | None = None

    def joints(self) -> JointMeasurement:
        return JointMeasurement(self.now, frozen([self.place]), frozen([self.speed]))

    def take(self, commands: SwingCommands) -> None:
        """Check one step's commands."""
        before, after = self.phases[-1], self.execution.phase
        if after is not before:
            self.phases.append(after)
        if commands.arm:
            assert self.method.inhibits
            assert after is Phase.SETTLE
            self.armings += 1
        if commands.lengths is not None:
            assert np.isfinite(commands.lengths).all()
            if self.last_lengths is not None and after < Phase.SWING:
                assert np.abs(commands.lengths - self.last_lengths).max() <= (
                    FASTEST * self.elapsed + 1e-9
                )
            self.last_lengths = commands.lengths

    def step(self, elapsed: float = PERIOD) -> None:
        self.now += elapsed
        self.elapsed = elapsed
        try:
            self.take(self.execution.step(self.now))
        except SwingAborted as error:
            self.end(error.code_name)
        if self.execution.done:
            self.ended = "SUCCESS"

    def end(self, code: str) -> None:
        commands = self.execution.stop()
        assert commands.disarm
        assert not commands.arm
        assert commands.lengths is not None
        assert commands.lengths.tolist() == self.health.length.tolist()
        self.ended = code

    @rule(count=st.integers(1, 80))
    def run(self, count: int) -> None:
        """Let the executor run while all states come."""
        for _ in range(count):
            self.execution.add_joints(self.joints())
            self.health = self.health._replace(time=self.now)
            self.execution.add_muscles(self.health)
            if not self.silent:
                self.execution.add_inhibition(InhibitionReport(self.now, True))
            self.step()

    @rule(place=st.sampled_from([START, END, START + 0.07, END - 0.09, 0.0]))
    def move(self, place: float) -> None:
        self.place, self.speed = place, 0.0

    @rule(speed=st.floats(-5.0, 5.0))
    def push(self, speed: float) -> None:
        self.speed = speed

    @rule(elapsed=st.floats(0.001, 3.0))
    def stall(self, elapsed: float) -> None:
        """No state comes, and the executor runs once."""
        self.step(elapsed)

    @rule(
        change=st.sampled_from(
            [{"faulty": ("m0",)}, {"limp": ("m1",)}, {"limp": ("m0", "m1")}, {"driven": ("m0",)}]
        )
    )
    def harm(self, change: dict[str, tuple[str, ...]]) -> None:
        self.health = changed(self.health, change)

    @rule()
    def hold(self) -> None:
        self.health = self.health._replace(holds=self.health.holds + 1)

    @rule()
    def arm(self) -> None:
        if self.armings:
            self.execution.inhibitor_armed()

    @rule()
    def lose_the_inhibitor(self) -> None:
        self.execution.add_inhibition(
            InhibitionReport(self.now, False, False, "joint states stopped")
        )

    @rule(silent=st.booleans())
    def silence_the_inhibitor(self, silent: bool) -> None:
        self.silent = silent

    @precondition(lambda self: not self.ended)
    @rule()
    def cancel(self) -> None:
        self.end("CANCELED")

    @invariant()
    def phases_come_in_order(self) -> None:
        if hasattr(self, "phases"):
            assert self.phases == list(Phase)[1 : len(self.phases) + 1]

    @invariant()
    def no_swing_takes_forever(self) -> None:
        if hasattr(self, "phases") and not self.ended:
            assert self.now - self.began < LONGEST_SEC + 5 * 3.0

    @invariant()
    def the_inhibitor_is_asked_at_most_once(self) -> None:
        assert getattr(self, "armings", 0) <= 1

    @invariant()
    def nothing_is_ordered_after_the_end(self) -> None:
        if getattr(self, "ended", ""):
            assert self.execution.step(self.now) == SwingCommands()


def changed(muscles: MuscleMeasurement, change: dict[str, tuple[str, ...]]) -> MuscleMeasurement:
    """Return the measurement with some names changed."""
    return muscles._replace(**change)  # type: ignore[arg-type]  # names of texts only


AnySwing.TestCase.settings = settings(
    max_examples=60, stateful_step_count=40, deadline=None, derandomize=True
)
test_any_swing_ends_in_a_held_posture = AnySwing.TestCase
