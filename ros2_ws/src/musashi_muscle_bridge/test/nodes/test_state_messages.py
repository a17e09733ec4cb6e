"""What is written into serialised messages is what the middleware would have serialised."""

from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_msgs.msg import MuscleState
from fastswing_planner.cdr.stamps import Stamp
from musashi_muscle_bridge.buses.protocol import JOINT_ROW, STATE_ROW, Fault, StateFrame
from musashi_muscle_bridge.control.loop import Measurement
from musashi_muscle_bridge.nodes.state_messages import (
    StateMessages,
    reported_faults,
)

MUSCLE_VALUES = ("length", "velocity", "tension", "current", "temperature", "mode")
MUSCLES, JOINTS = ("#1", "biceps", "Trizeps größer"), ("S-p", "E-p")

stamps = st.builds(Stamp, st.integers(0, 2**31 - 1), st.integers(0, 999_999_999))
counts = st.integers(0, 2**32 - 1)


def rows(dtype: np.dtype, count: int) -> st.SearchStrategy:
    """Rows of arbitrary bytes: NaN and infinities among them."""
    return arrays("u1", count * dtype.itemsize).map(lambda octets: octets.view(dtype))


measurements = st.builds(
    Measurement,
    st.builds(StateFrame, counts, rows(STATE_ROW, len(MUSCLES)), rows(JOINT_ROW, len(JOINTS))),
    arrays(bool, len(MUSCLES)),
    st.booleans(),
    st.floats(0.0, 1e6),
)


def header(stamp: Stamp) -> Header:
    return Header(stamp=Time(sec=stamp.sec, nanosec=stamp.nanosec))


def content(message: Any) -> dict[str, Any]:
    """Return all fields, numbers as bytes: a NaN is as good as the same NaN."""
    found: dict[str, Any] = {}
    for field in message.get_fields_and_field_types():
        value = getattr(message, field)
        if field == "name":
            found[field] = list(value)
        else:
            found[field] = value if field == "header" else np.array(value, dtype=float).tobytes()
    return found


@given(measurements, stamps, counts)
def test_a_raw_muscle_state_is_the_ordinary_one(
    measured: Measurement, stamp: Stamp, holds: int
) -> None:
    data = StateMessages(MUSCLES, JOINTS).muscle_state(stamp, measured, holds)
    rows = measured.state.rows
    ordinary = MuscleState(
        header=header(stamp),
        name=MUSCLES,
        fault=reported_faults(measured).tolist(),
        holds=holds,
        **{field: rows[field].tolist() for field in MUSCLE_VALUES},
    )
    assert content(deserialize_message(data, MuscleState)) == content(ordinary)


@given(measurements, stamps)
def test_a_raw_joint_state_is_the_ordinary_one(measured: Measurement, stamp: Stamp) -> None:
    data = StateMessages(MUSCLES, JOINTS).joint_state(stamp, measured)
    joints = measured.state.joints
    ordinary = JointState(
        header=header(stamp),
        name=JOINTS,
        position=joints["position"].tolist(),
        velocity=joints["velocity"].tolist(),
    )
    assert content(deserialize_message(data, JointState)) == content(ordinary)


@given(measurements, measurements, stamps, counts)
def test_a_raw_state_does_not_remember_the_one_before(
    before: Measurement, measured: Measurement, stamp: Stamp, holds: int
) -> None:
    states = StateMessages(MUSCLES, JOINTS)
    states.muscle_state(stamp, before, 0)
    fresh = StateMessages(MUSCLES, JOINTS)
    assert states.muscle_state(stamp, measured, holds) == fresh.muscle_state(stamp, measured, holds)


@pytest.mark.parametrize(
    ("fault", "lost", "reported"),
    [
        (Fault.NONE, False, Fault.NONE),
        (Fault.NONE, True, Fault.BUS),
        (Fault.WATCHDOG, False, Fault.WATCHDOG),
        (Fault.WATCHDOG, True, Fault.WATCHDOG),
    ],
)
def test_a_muscle_that_is_not_heard_has_a_fault_unless_its_board_told_another(
    fault: Fault, lost: bool, reported: Fault
) -> None:
    state = np.zeros(1, STATE_ROW)
    state["fault"] = fault
    frame = StateFrame(1, state, np.zeros(0, JOINT_ROW))
    assert reported_faults(Measurement(frame, np.array([lost]), True, 0.0)).tolist() == [reported]
