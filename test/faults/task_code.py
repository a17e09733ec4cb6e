"""Task code that is killed: asks for the robot's own swing by Method 1, or only listens."""

import sys
from contextlib import suppress

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import SwingOptions
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI


def main(swings: bool) -> None:
    """Spin until killed."""
    rclpy.init()
    node = Node("task_code")
    node.create_subscription(
        JointState, "joint_states", lambda _message: None, qos_profile_sensor_data
    )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    if swings:
        postures = load_robot(MUSASHI).postures
        goal = ExecuteSwing.Goal(
            start_position=postures["start"].tolist(),
            end_position=postures["end"].tolist(),
            options=SwingOptions(method=SwingOptions.METHOD_INHIBIT),
        )
        client = ActionClient(node, ExecuteSwing, "execute_swing")
        while not client.server_is_ready():
            executor.spin_once(timeout_sec=0.05)
        goal.stamp = node.get_clock().now().to_msg()
        client.send_goal_async(goal)
    with suppress(ExternalShutdownException):
        executor.spin()


if __name__ == "__main__":
    main(sys.argv[1] == "swing")
