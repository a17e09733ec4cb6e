"""A light client: raw messages with the times at which they were published."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from fastswing_planner.nodes.recorder import WithInfo

_READY_SEC = 30.0
_SLICE_SEC = 0.05


def clock_offset_ns() -> int:
    """Return CLOCK_REALTIME minus CLOCK_MONOTONIC [ns], from the quickest of some readings.

    It is constant until somebody sets the clock: corrections of its rate apply to both.
    """
    readings = []
    for _ in range(20):
        before, real, after = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
        readings.append((after - before, real - (before + after) // 2))
    return min(readings)[1]


class Listener:
    """A node without services or log, on the executor that costs least; messages stay bytes."""

    def __init__(self, domain: int) -> None:
        """Join a ROS domain."""
        self._context = rclpy.Context()
        rclpy.init(
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.node = Node(
            "listener",
            context=self._context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._offset_ns = clock_offset_ns()

    def listen(self, kind: type, topic: str) -> list[tuple[float, bytes]]:
        """Return a list that grows: when a message was published, monotonic [s], and its bytes."""
        heard: list[tuple[float, bytes]] = []

        def handle(data: bytes, info: Mapping[str, Any]) -> None:
            heard.append((self.monotonic(info["source_timestamp"]), data))

        self.node.create_subscription(
            kind, topic, WithInfo(handle), QoSProfile(depth=100), raw=True
        )
        return heard

    def monotonic(self, realtime_ns: int) -> float:
        """Return a time of CLOCK_REALTIME on the monotonic clock [s]."""
        return (realtime_ns - self._offset_ns) * 1e-9

    def spin(self, seconds: float) -> None:
        """Take what comes for some time [s]."""
        self._executor.spin_until_future_complete(Future(), timeout_sec=seconds)

    def until(self, what: str, condition: Callable[[], bool]) -> None:
        """Spin until a condition holds; raises TimeoutError."""
        deadline = time.monotonic() + _READY_SEC
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f"waited in vain for {what}")
            self.spin(_SLICE_SEC)

    def call(self, kind: Any, service: str, request: Any) -> Any:
        """Return a service's answer; raises TimeoutError."""
        client = self.node.create_client(kind, service)
        self.until(service, client.service_is_ready)
        future = client.call_async(request)
        self.until(f"an answer of {service}", future.done)
        self.node.destroy_client(client)
        return future.result()

    def close(self) -> None:
        """Leave ROS."""
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)
