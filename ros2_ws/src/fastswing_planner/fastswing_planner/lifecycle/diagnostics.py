"""A node's diagnostics: what it says of the robot, and what is wrong with itself."""

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

Report = tuple[bytes, str, Mapping[str, object]]
"""Level (DiagnosticStatus), summary and values."""


class Health:
    """What is wrong with a node itself.

    callback_errors  how many callbacks ended with an exception
    """

    def __init__(self) -> None:
        """Begin without a fault."""
        self.callback_errors = 0
        self._not_granted: dict[str, bool] = {}  # whether somebody asked for it

    def forget_refusals(self) -> None:
        """Forget what the kernel refused: it is asked again."""
        self._not_granted = {}

    def refused(self, text: str, asked: bool = True) -> bool:
        """Take note of what the kernel does not grant; return whether that is new.

        asked  somebody relies on it; else it is named, and the level stays
        """
        new = text not in self._not_granted
        self._not_granted.setdefault(text, asked)
        return new

    def within(self, report: Report, active: bool) -> Report:
        """Return the node's own report with this beside it."""
        level, summary, values = report
        if self.callback_errors:
            defect = "defect in a callback, see the log"
            # What the node says of the robot is more urgent than what is wrong with the node.
            summary = defect if level == DiagnosticStatus.OK else f"{summary}; {defect}"
            level = DiagnosticStatus.ERROR
        elif any(self._not_granted.values()) and level == DiagnosticStatus.OK:
            refused = (text for text, asked in self._not_granted.items() if asked)
            level, summary = DiagnosticStatus.WARN, "; ".join(refused)
        values = {
            "active": active,
            "callback_errors": self.callback_errors,
            "not_granted": "; ".join(self._not_granted),
            **values,
        }
        return level, summary, values


class DiagnosticsPublisher:
    """Publishes a node's status in the standard form."""

    def __init__(self, node: Node) -> None:
        """Create the publisher of `/diagnostics`."""
        self._node = node
        self._listeners = 0
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)

    def publish(self, report: Report, stamp: Any) -> None:
        """Publish a report with the time at which it was made."""
        level, summary, values = report
        status = DiagnosticStatus(
            level=level,
            name=self._node.get_fully_qualified_name().lstrip("/"),
            message=summary,
            hardware_id="",
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = stamp
        self._publisher.publish(message)

    def has_new_listener(self) -> bool:
        """Return whether somebody began to listen since the last call."""
        before, self._listeners = self._listeners, self._publisher.get_subscription_count()
        return self._listeners > before
