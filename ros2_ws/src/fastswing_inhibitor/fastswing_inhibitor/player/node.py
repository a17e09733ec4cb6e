"""Publishes a bag's states again, with /clock, so that a live inhibitor runs on a bag."""

import argparse
import signal
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from types import FrameType
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from fastswing_inhibitor.player.clock import ReplayClock, Window, messages_in_order, window
from fastswing_inhibitor.player.topics import playable_topics
from fastswing_planner.bags import Bag, Topic, open_bag
from fastswing_planner.cdr.stamps import from_ns
from fastswing_planner.errors import NotReady

_CLOCK_PERIOD_SEC = 0.01
_LONGEST_WAIT_SEC = 0.05


def qos_of(topic: Topic) -> QoSProfile:
    """Return a QoS that every reader of the recorded publishers hears."""
    latched = any(str(one.get("durability")) in ("transient_local", "1") for one in topic.qos)
    return QoSProfile(
        depth=100,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


class ReplayNode(Node):
    """Publishes messages of a bag when it is their time."""

    def __init__(self, bag: Bag, topics: list[str], part: Window, rate: float) -> None:
        """Create publishers and the service `~/pause`; paused."""
        super().__init__("replay")
        self._bag = bag
        self._part = part
        self._topics = topics
        self.clock = ReplayClock(part.start_ns, rate)
        self._senders = {
            name: self.create_publisher(
                _message_class(bag.topics[name].type), name, qos_of(bag.topics[name])
            )
            for name in topics
        }
        self._clock_publisher = self.create_publisher(Clock, "/clock", 10)
        self.create_service(SetBool, "~/pause", self._on_pause)
        self._next_clock = 0.0

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        (self.clock.pause if request.data else self.clock.resume)(time.monotonic())
        response.success = True
        response.message = "paused" if request.data else "running"
        self.get_logger().info(response.message)
        return response

    def play(self, spin: Callable[[float], bool]) -> int:
        """Publish the part once; returns the number of messages.

        spin  serves requests for some seconds; returns False when it is time to end
        """
        count = 0
        self.clock.jump(self._part.start_ns, time.monotonic())
        for bag_ns, topic, data in self._rows():
            while True:
                self._tick(bag_ns)
                wait = self.clock.wait(bag_ns, time.monotonic())
                if not spin(min(max(wait, 0.0), _LONGEST_WAIT_SEC)):
                    return count
                if self.clock.wait(bag_ns, time.monotonic()) <= 0.0:
                    break
            self._publish_clock(bag_ns)
            self._senders[topic].publish(data)
            count += 1
        return count

    def _rows(self) -> Iterator[tuple[int, str, bytes]]:
        return messages_in_order(self._bag, self._topics, self._part)

    def _tick(self, next_ns: int) -> None:
        """Publish the time now and then, where the bag is silent too, never past `next_ns` [ns]."""
        now = time.monotonic()
        if now >= self._next_clock:
            self._publish_clock(min(self.clock.now_ns(now), next_ns))

    def _publish_clock(self, bag_ns: int) -> None:
        self._next_clock = time.monotonic() + _CLOCK_PERIOD_SEC
        sec, nanosec = from_ns(bag_ns)
        self._clock_publisher.publish(Clock(clock=Time(sec=sec, nanosec=nanosec)))


def _message_class(type_name: str) -> Any:
    package, _, name = type_name.split("/")
    try:
        return getattr(import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise NotReady(f"message {type_name} is not installed; source its workspace") from error


def publish(options: argparse.Namespace) -> int:
    """Publish a bag until its end, SIGINT or SIGTERM; returns 0. Raises PlannerError."""
    bag = open_bag(*options.bag)
    chosen = playable_topics(bag, options.topic)
    part = window(bag, options.start, options.duration)
    ReplayClock(0, options.rate)
    stopped: list[int] = []

    def on_signal(number: int, _frame: FrameType | None) -> None:
        stopped.append(number)

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    rclpy.init(args=["replay", *options.ros_args], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = ReplayNode(bag, chosen.names, part, options.rate)
        if not options.paused:
            node.clock.resume(time.monotonic())
        if chosen.warning:
            node.get_logger().warning(chosen.warning)
        node.get_logger().info(f"publishing {', '.join(chosen.names)}")
        _play(node, options.loop, stopped)
        node.destroy_node()
    except ExternalShutdownException:
        pass
    finally:
        rclpy.try_shutdown()
    return 0


def _play(node: ReplayNode, loop: bool, stopped: list[int]) -> None:
    """Publish the part once or, in a loop, until a signal is in `stopped`."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def spin(seconds: float) -> bool:
        executor.spin_once(timeout_sec=seconds)
        return not stopped

    while not stopped:
        count = node.play(spin)
        node.get_logger().info(f"{count} messages published")
        if not loop:
            break
