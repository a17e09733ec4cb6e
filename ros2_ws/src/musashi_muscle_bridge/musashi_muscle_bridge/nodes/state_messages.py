"""What the boards measured, as serialised messages."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from fastswing_msgs.msg import MuscleState
from fastswing_planner.cdr.stamps import Stamp
from fastswing_planner.conversion.message_template import MessageTemplate
from fastswing_planner.conversion.number_places import STAMP
from musashi_muscle_bridge.buses.protocol import Fault
from musashi_muscle_bridge.control.loop import Measurement

_MUSCLE_VALUES = ("length", "velocity", "tension", "current", "temperature", "mode")
_JOINT_VALUES = ("position", "velocity")
_FAULT_BUS = np.uint8(Fault.BUS)


def reported_faults(measured: Measurement) -> NDArray[np.uint8]:
    """Return the fault of each muscle, shape (m,): its board's, or that it is not heard."""
    fault: NDArray[np.uint8] = measured.state.rows["fault"]
    if not np.count_nonzero(measured.lost):
        return fault
    return np.where(measured.lost & (fault == Fault.NONE), _FAULT_BUS, fault)


class StateMessages:
    """Writes the numbers into messages that were serialised once; the same bytes, sooner."""

    def __init__(self, muscle_names: Sequence[str], joint_names: Sequence[str]) -> None:
        """Name m muscles and n joints."""
        muscles, joints = len(muscle_names), len(joint_names)
        muscle_state = MuscleState(
            name=muscle_names,
            fault=[0] * muscles,
            mode=[0] * muscles,
            **{field: [0.0] * muscles for field in _MUSCLE_VALUES if field != "mode"},
        )
        joint_state = JointState(
            name=joint_names, **{field: [0.0] * joints for field in _JOINT_VALUES}
        )
        fields = (*STAMP, "fault", "holds", *_MUSCLE_VALUES)
        self._muscle_state = MessageTemplate(muscle_state, fields)
        self._joint_state = MessageTemplate(joint_state, (*STAMP, *_JOINT_VALUES))

    # A board may send a signalling NaN, of which numpy would warn; it is published as a quiet one.
    @np.errstate(invalid="ignore")
    def muscle_state(self, stamp: Stamp, measured: Measurement, holds: int) -> bytes:
        """Return the serialised `fastswing_msgs/MuscleState`; `holds` as in the message."""
        rows = measured.state.rows
        values = [rows[field] for field in _MUSCLE_VALUES]
        return self._muscle_state.filled(*stamp, reported_faults(measured), holds, *values)

    @np.errstate(invalid="ignore")
    def joint_state(self, stamp: Stamp, measured: Measurement) -> bytes:
        """Return the serialised `sensor_msgs/JointState`."""
        joints = measured.state.joints
        return self._joint_state.filled(*stamp, *(joints[field] for field in _JOINT_VALUES))
