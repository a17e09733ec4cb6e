"""The server of `rcl_echo.c` in Python: what rclpy costs a node that does nothing.

The cheapest that rclpy offers: bytes in, the same bytes out, no log topic, no parameter services.
"""

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from sensor_msgs.msg import JointState

_LONG_SEC = 1e6


def main() -> None:
    """Echo until SIGTERM."""
    rclpy.init()
    node = Node("pyserver", enable_rosout=False, start_parameter_services=False)
    newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publisher = node.create_publisher(JointState, "pong", newest)
    node.create_subscription(JointState, "ping", publisher.publish, newest, raw=True)
    executor = EventsExecutor()
    executor.add_node(node)
    # Without a timeout EventsExecutor livelocks in rclpy 7.1.
    executor.spin_until_future_complete(Future(), timeout_sec=_LONG_SEC)


if __name__ == "__main__":
    main()
