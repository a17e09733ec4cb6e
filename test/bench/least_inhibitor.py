"""The least that an inhibitor in Python has to do: reads a state, asks MuJoCo, publishes.

It checks nothing, is armed always, tells no status and has no lifecycle.

scripts/ros_env python test/bench/least_inhibitor.py ROBOT
"""

import sys
from itertools import compress

import rclpy
from builtin_interfaces.msg import Duration
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from rclpy.task import Future
from sensor_msgs.msg import JointState

from fastswing_msgs.msg import CurrentOverride
from fastswing_planner.conversion.message_template import MessageTemplate
from fastswing_planner.conversion.number_places import STAMP
from fastswing_planner.conversion.raw_reader import RawReader
from fastswing_planner.conversion.states import JointStateReader
from fastswing_planner.lifecycle.real_time import keep_what_there_is, tighten_timers
from fastswing_planner.robot.description import load_robot

_LEASE = Duration(nanosec=200_000_000)
_LONG_SEC = 1e6
_ROUND_OFF = 1e-9  # [m/s], as the asking arm moves at about 1 rad/s


def main() -> None:
    """Answer until killed."""
    model = load_robot(sys.argv[1]).model
    tighten_timers()
    rclpy.init()
    node = Node("least_inhibitor", enable_rosout=False, start_parameter_services=False)
    publisher = node.create_publisher(CurrentOverride, "current_override", QoSProfile(depth=1))
    reader = RawReader(JointState, JointStateReader.NUMBERS)
    overrides: dict[tuple[bool, ...], MessageTemplate] = {}

    def answer(data: bytes) -> None:
        state = reader.read(data)
        speeds = model.muscle_velocity(state.position, state.velocity)
        antagonists = tuple([speed > _ROUND_OFF for speed in speeds])
        if antagonists not in overrides:
            names = list(compress(model.muscle_names, antagonists))
            overrides[antagonists] = MessageTemplate(
                CurrentOverride(name=names, lease=_LEASE), STAMP
            )
        stamp = state.header.stamp
        publisher.publish(overrides[antagonists].filled(stamp.sec, stamp.nanosec))

    node.create_subscription(JointState, "joint_states", answer, qos_profile_sensor_data, raw=True)
    executor = EventsExecutor()
    executor.add_node(node)
    keep_what_there_is()
    # Without a timeout EventsExecutor livelocks in rclpy 7.1.
    executor.spin_until_future_complete(Future(), timeout_sec=_LONG_SEC)


if __name__ == "__main__":
    main()
