"""A made-up recording: the elbow is raised for 2 s, rests, and swings at SWING_AT for 1 s."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fastswing_planner.analysis.finding import FindingSettings, armed_intervals, find_bursts
from fastswing_planner.analysis.recording import (
    CommandSeries,
    JointSeries,
    JointSpeed,
    MuscleSeries,
    OverrideSeries,
    RecordedPlan,
    Recording,
    StatusSeries,
    TopicTimes,
)
from fastswing_planner.arrays import Vector

JOINTS = ("S-p", "E-p")
MUSCLES = ("#1", "#9", "#10")
SWING_AT = 4.0
PEAK = 3.0
TRAVEL = 2.0 * PEAK / np.pi
RAISED = -1.6


def elbow_speed(time: Vector) -> Vector:
    """Return the speed of raising at 0.8 rad/s, rest, and half a sine wave [rad/s]."""
    swing = np.where((time > SWING_AT) & (time < SWING_AT + 1.0), 1.0, 0.0)
    return np.where(time < 2.0, -0.8, PEAK * np.sin(np.pi * (time - SWING_AT)) * swing)


def elbow_angle(time: Vector) -> Vector:
    """Return the integral of `elbow_speed` from 0 on [rad]."""
    phase = np.clip(time - SWING_AT, 0.0, 1.0)
    return -0.8 * np.minimum(time, 2.0) + PEAK / np.pi * (1.0 - np.cos(np.pi * phase))


def plan() -> RecordedPlan:
    return RecordedPlan(
        received=0.1,
        method="inhibit",
        joint_names=JOINTS,
        start=np.array([0.0, RAISED]),
        end=np.array([0.0, RAISED + TRAVEL]),
        muscle_names=MUSCLES,
        kept=np.array([True, False, False]),
        inhibited=np.array([False, True, True]),
        elongation=np.zeros(3),
        speed_index=np.array([-0.1, 0.4, 0.3]),
        time_cost=0.75,
        time=np.array([0.25, 0.5, 0.75]),
        joint_velocity=np.array([[0.1, 1.0], [0.2, 3.5], [0.0, 2.0]]),
        muscle_velocity=np.array([[-0.1, 0.2, 0.1], [-0.2, 0.5, 0.4], [0.0, 0.1, 0.1]]),
    )


def recording(rate: float = 200.0, until: float = 6.0) -> Recording:
    """Muscle #9 runs at a sixth of the elbow's speed, #1 at a thirtieth the other way."""
    time = np.arange(0.0, until, 1.0 / rate)
    speed, angle = elbow_speed(time), elbow_angle(time)
    velocity = np.stack([0.05 * speed, speed], axis=1)
    muscle_velocity = np.stack([-speed / 30.0, speed / 6.0, speed / 12.0], axis=1)
    inhibited = (time >= SWING_AT + 0.01) & (time < SWING_AT + 0.6)
    mode = np.full((time.size, 3), 3, dtype=np.uint8)
    mode[inhibited, 1:] = 0
    stamps = np.arange(SWING_AT, SWING_AT + 0.6, 0.01)
    return Recording(
        source="run.mcap",
        namespace="",
        speed=JointSpeed(time, np.abs(speed), "E-p"),
        joints=JointSeries(
            JOINTS, np.arange(time.size), time, np.stack([0 * angle, angle], axis=1), velocity
        ),
        began_ns=1_700_000_000_000_000_000,
        muscles=MuscleSeries(
            MUSCLES,
            time,
            muscle_velocity,
            np.stack([20.0 + 50.0 * np.abs(speed), 10.0 + 0 * speed, 12.0 + 0 * speed], axis=1),
            np.zeros((time.size, 3)),
            mode,
            np.zeros((time.size, 3), dtype=np.uint8),
        ),
        overrides=OverrideSeries(
            stamps, stamps + 0.002, np.full(stamps.size, 0.05), (("#9", "#10"),) * stamps.size
        ),
        status=StatusSeries(
            np.array([3.9, 4.3, 4.7]),
            np.array([True, True, False]),
            np.array([0.0, 2.0, 2.0]),
            ("", "", "the goal was reached"),
        ),
        commands=CommandSeries(np.array([1.0, 1.5, SWING_AT - 0.02]), np.array([3e-3, 3e-3, 0.2])),
        plans=(plan(),),
        topics=(TopicTimes("/joint_states", "sensor_msgs/msg/JointState", time, time, None, True),),
    )


def searched(recording: Recording) -> Recording:
    """Return a recording with the fast motions that are found in it."""
    speed, armed = recording.speed, armed_intervals(recording.status)
    bursts = find_bursts(speed.time, speed.speed, armed, FindingSettings())
    return replace(recording, bursts=tuple(bursts))


@pytest.fixture(scope="session")
def recorded() -> Callable[..., Recording]:
    """Return the recording with some of its parts exchanged."""

    def build(rate: float = 200.0, until: float = 6.0, **parts: Any) -> Recording:
        return searched(replace(recording(rate, until), **parts))

    return build
