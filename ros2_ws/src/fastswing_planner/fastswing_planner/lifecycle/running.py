"""Runs a node as a process, from its first word to its last."""

import signal
import sys
from collections.abc import Callable
from types import FrameType

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from fastswing_planner.lifecycle.managed_node import ManagedNode
from fastswing_planner.lifecycle.real_time import tighten_timers
from fastswing_planner.lifecycle.transport import choose_transport

_OFTEN_SEC = 0.1
_SPIN_SLICE_SEC = 3600.0
_LAST_WORDS_SEC = 0.2


def spin(node: ManagedNode, stop: Future) -> None:
    """Spin until `stop` is done, then stop working; signals are noticed every _OFTEN_SEC."""
    executor = EventsExecutor()
    executor.add_node(node)
    # Python calls its signal handlers between two of its own instructions, so this serves them too.
    node.create_steady_timer(_OFTEN_SEC, node.greet_listeners)
    # EventsExecutor.spin() without a timeout livelocks in rclpy 7.1, and each call of this one
    # leaves some memory behind.
    while not stop.done():
        executor.spin_until_future_complete(stop, timeout_sec=_SPIN_SLICE_SEC)
    node.stop_working()
    # What the stop set going, such as an action's result, still has to leave.
    executor.spin_until_future_complete(Future(), timeout_sec=_LAST_WORDS_SEC)


def run(node_class: Callable[[], ManagedNode]) -> int:
    """Run a node until SIGINT or SIGTERM; returns 0, or 2 if it could not start."""
    stop = Future()

    def on_signal(_signal: int, _frame: FrameType | None) -> None:
        if not stop.done():
            stop.set_result(None)

    signal.signal(signal.SIGINT, on_signal)
    signal.signal(signal.SIGTERM, on_signal)
    choose_transport()
    tighten_timers()  # before the middleware's threads, which inherit it
    try:
        # The context must outlive the signal, so that a node can publish its last word.
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        node = node_class()
    except Exception as error:
        # ROS reads `200` as an integer and takes none where the default is `500.0`.
        integer = "'INTEGER', expecting type 'DOUBLE'" in str(error)
        hint = "; write it with a decimal point" if integer else ""
        print(f"cannot start: {error}{hint}", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    node.asked_to_end = stop.done
    started = node.autostart()
    if started:
        spin(node, stop)
    node.stop_working()
    node.destroy_node()
    rclpy.shutdown()
    return 0 if started or stop.done() else 2
