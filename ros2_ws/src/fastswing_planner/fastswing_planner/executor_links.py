"""What the swing executor talks to: bridge, planner and inhibitor."""

from builtin_interfaces.msg import Time
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger

from fastswing_msgs.msg import LengthCommand, SwingPlan
from fastswing_msgs.srv import ArmInhibitor, PlanSwing

# Requests are reliable: one sent while the network is out would arm seconds later, with no swing.
_ARM_LIFESPAN_SEC = 1.0


class ExecutorLinks:
    """Publishers and clients of the executor.

    lengths  publisher of `length_command`
    plan     publisher of `swing_plan`, kept for late subscribers
    planner, arm, disarm, hold  clients of `plan_swing`, `arm_inhibitor`, `disarm_inhibitor` and
             `hold_posture`
    """

    def __init__(self, node: Node) -> None:
        """Create them; `destroy` removes them again."""
        self._node = node
        group = ReentrantCallbackGroup()
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.lengths = node.create_publisher(LengthCommand, "length_command", 10)
        self.plan = node.create_publisher(SwingPlan, "swing_plan", latched)
        self.planner = node.create_client(PlanSwing, "plan_swing", callback_group=group)
        self.arm = node.create_client(
            ArmInhibitor,
            "arm_inhibitor",
            qos_profile=QoSProfile(depth=10, lifespan=Duration(seconds=_ARM_LIFESPAN_SEC)),
            callback_group=group,
        )
        self.disarm = node.create_client(Trigger, "disarm_inhibitor", callback_group=group)
        self.hold = node.create_client(Trigger, "hold_posture", callback_group=group)

    def now(self) -> Time:
        """Return the node's time, for a header."""
        return self._node.get_clock().now().to_msg()

    def destroy(self) -> None:
        """Destroy all of them."""
        for client in (self.planner, self.arm, self.disarm, self.hold):
            self._node.destroy_client(client)
        for publisher in (self.lengths, self.plan):
            self._node.destroy_publisher(publisher)
