"""The topics that a recorder takes, and how it listens to them."""

from dataclasses import dataclass
from importlib import import_module

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from fastswing_planner.bags.metadata import BagTopic, OfferedQos
from fastswing_planner.conversion.definitions import UnknownMessageType, split_type_name
from fastswing_planner.errors import UnknownName

QUEUE_DEPTH = 1000
TYPES = {
    "joint_states": "sensor_msgs/msg/JointState",
    "muscle_state": "fastswing_msgs/msg/MuscleState",
    "length_command": "fastswing_msgs/msg/LengthCommand",
    "tension_command": "fastswing_msgs/msg/TensionCommand",
    "current_command": "fastswing_msgs/msg/CurrentCommand",
    "current_override": "fastswing_msgs/msg/CurrentOverride",
    "inhibition_status": "fastswing_msgs/msg/InhibitionStatus",
    "swing_plan": "fastswing_msgs/msg/SwingPlan",
    "diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
LATCHED = frozenset({"swing_plan"})


@dataclass
class RecordedTopic:
    """One recorded topic on its way; `subscription` None: not subscribed yet."""

    topic: BagTopic
    message_class: type
    qos: QoSProfile
    subscription: Subscription | None = None
    publishers: int = 0
    messages: int = 0
    bytes: int = 0
    lost: int = 0
    sequence: int = 0
    earlier_messages: int = 0
    earlier_lost: int = 0

    def count(self, size: int, sequence: int) -> None:
        """Count a message; a single publisher's missing sequence numbers were lost."""
        if self.publishers == 1 and 0 < self.sequence < sequence:
            self.lost += sequence - self.sequence - 1
        self.sequence = sequence
        self.messages += 1
        self.bytes += size

    def next_file(self) -> None:
        """Let the present counts be those of earlier files."""
        self.earlier_messages, self.earlier_lost = self.messages, self.lost


def message_class(type_name: str) -> type:
    """Return the Python class of 'package/msg/Name'; raises UnknownMessageType."""
    package, name = split_type_name(type_name)
    try:
        found: type = getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise UnknownMessageType(f"message '{type_name}' is not installed") from error
    return found


def offered_qos(profile: QoSProfile) -> OfferedQos:
    """Return a publisher's QoS in rosbag2's words."""
    return OfferedQos(
        history=profile.history.name.lower(),
        depth=profile.depth,
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        deadline_ns=profile.deadline.nanoseconds,
        lifespan_ns=profile.lifespan.nanoseconds,
        liveliness=profile.liveliness.name.lower(),
        liveliness_lease_ns=profile.liveliness_lease_duration.nanoseconds,
        avoid_ros_namespace_conventions=profile.avoid_ros_namespace_conventions,
    )


def qos_for(name: str) -> QoSProfile:
    """Return how a topic is listened to: every publisher is heard, and latched ones in time."""
    if name in LATCHED:
        return QoSProfile(
            depth=1,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
        )
    # Best effort hears every publisher and never makes one wait.
    return QoSProfile(depth=QUEUE_DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)


def parse(entry: str) -> tuple[str, str]:
    """Return name and type of an entry of the parameter `topics`."""
    name, _, type_name = entry.strip().partition(" ")
    type_name = type_name.strip() or TYPES.get(name.rpartition("/")[2], "")
    if not type_name:
        raise UnknownName(
            f"the type of topic '{name}' is not known: write '{name} PACKAGE/msg/TYPE', "
            f"or choose from: {', '.join(TYPES)}"
        )
    return name, type_name
