"""What the swing executor talks to: bridge, planner and inhibitor."""

from collections import deque
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from fastswing_msgs.msg import LengthCommand, SwingPlan
from fastswing_msgs.srv import ArmInhibitor, PlanSwing
from fastswing_planner.arrays import Vector

# Requests are reliable: one sent while the network is out would arm seconds later, with no swing.
_ARM_LIFESPAN_SEC = 1.0
_REMEMBERED = 1000
"""Length commands that come back later than this many are taken for somebody else's."""


class ExecutorLinks:
    """Publishers and clients of the executor.

    lengths  publisher of `length_command`
    plan     publisher of `swing_plan`, kept for late subscribers
    planner, arm, disarm, hold  clients of `plan_swing`, `arm_inhibitor`, `disarm_inhibitor` and
             `hold_posture`
    """

    def __init__(self, node: Node) -> None:
        """Create the clients; `open` creates the publishers, `destroy` removes all again.

        The clients outlive a deactivation: what stops the arm then must still get through.
        """
        self._node = node
        group = ReentrantCallbackGroup()
        self.planner = node.create_client(PlanSwing, "plan_swing", callback_group=group)
        self.arm = node.create_client(
            ArmInhibitor,
            "arm_inhibitor",
            qos_profile=QoSProfile(depth=10, lifespan=Duration(seconds=_ARM_LIFESPAN_SEC)),
            callback_group=group,
        )
        self.disarm = node.create_client(Trigger, "disarm_inhibitor", callback_group=group)
        self.hold = node.create_client(Trigger, "hold_posture", callback_group=group)

        self._sent: deque[tuple[int, int]] = deque(maxlen=_REMEMBERED)

    def open(self) -> None:
        """Create the publishers."""
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.lengths = self._node.create_publisher(LengthCommand, "length_command", 10)
        self.plan = self._node.create_publisher(SwingPlan, "swing_plan", latched)

    def close(self) -> None:
        """Destroy the publishers: an inactive executor is no writer of commands."""
        for publisher in (self.lengths, self.plan):
            self._node.destroy_publisher(publisher)

    def destroy(self) -> None:
        """Destroy the clients."""
        for client in (self.planner, self.arm, self.disarm, self.hold):
            self._node.destroy_client(client)

    def now(self) -> Time:
        """Return the node's time, for a header."""
        return self._node.get_clock().now().to_msg()

    def command_lengths(self, muscle_names: Sequence[str], length: Vector) -> None:
        """Publish a length command [m], shape (m,)."""
        stamp = self.now()
        self._sent.append((stamp.sec, stamp.nanosec))
        self.lengths.publish(
            LengthCommand(header=Header(stamp=stamp), name=muscle_names, length=length.tolist())
        )

    def is_own(self, command: LengthCommand) -> bool:
        """Return whether a length command is one of ours; only stamps tell."""
        stamp = command.header.stamp
        return (stamp.sec, stamp.nanosec) in self._sent
