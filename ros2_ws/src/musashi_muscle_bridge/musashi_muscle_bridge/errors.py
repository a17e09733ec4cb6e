"""What can be wrong between ROS and the boards."""

from fastswing_planner.errors import InvalidRequest, PlannerError


class BridgeError(PlannerError):
    """Root of all errors of this package."""

    code_name = "NOT_READY"


class BusError(BridgeError, OSError):
    """A bus cannot be opened or used; the text names its URL."""


class BusTimeout(BusError, TimeoutError):
    """The boards did not answer in time."""


class FrameError(BridgeError, ValueError):
    """A frame is damaged, of another version, or does not fit."""


class CommandRejected(BridgeError, InvalidRequest):
    """A command was not taken; `reason` is a short name for counting."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason
