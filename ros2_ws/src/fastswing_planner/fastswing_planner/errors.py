"""Everything that can be wrong with a plan or a swing.

Each class carries the name of its `fastswing_msgs/ErrorCode` constant, so that the same
exception becomes the same code on the service, on the action and in the log.
"""

from typing import ClassVar


class PlannerError(Exception):
    """Root of all errors of this package."""

    code_name: ClassVar[str] = "INTERNAL"


class InvalidRequest(PlannerError, ValueError):
    """The request itself is wrong: nothing was computed."""

    code_name = "INVALID_REQUEST"


class NotFinite(InvalidRequest):
    """A NaN or an infinity where a number is needed."""

    code_name = "NOT_FINITE"


class WrongLength(InvalidRequest):
    """An array of the wrong length."""

    code_name = "WRONG_LENGTH"


class UnknownName(InvalidRequest):
    """A joint, muscle or body that the robot does not have."""

    code_name = "UNKNOWN_NAME"


class DuplicateName(InvalidRequest):
    """The same name twice."""

    code_name = "DUPLICATE_NAME"


class OutOfRange(InvalidRequest):
    """A joint angle outside the joint's range."""

    code_name = "OUT_OF_RANGE"


class StartEqualsEnd(InvalidRequest):
    """There is nothing to swing."""

    code_name = "START_EQUALS_END"


class InvalidLimit(InvalidRequest):
    """A limit, step, tolerance, weight or duration that makes no sense."""

    code_name = "INVALID_LIMIT"


class InvalidTensionRange(InvalidLimit):
    """A tension_min that is not below its tension_max."""

    code_name = "INVALID_TENSION_RANGE"


class InvalidWeight(InvalidRequest):
    """A weight that is not symmetric positive definite."""

    code_name = "INVALID_WEIGHT"


class UnknownMethod(InvalidRequest):
    """Not one of the methods, or of the searches."""

    code_name = "UNKNOWN_METHOD"


class InvalidParameter(InvalidRequest):
    """A node's parameter outside its table's type, range or choices, or misspelt."""


class StaleRequest(InvalidRequest):
    """A request that was on its way for too long, or does not say when it was made."""

    code_name = "STALE_REQUEST"


class NotReady(PlannerError):
    """Something that is needed is missing."""

    code_name = "NOT_READY"


class StaleState(PlannerError):
    """The measurements stopped, or are too old."""

    code_name = "STALE_STATE"


class RobotDescriptionError(NotReady):
    """A robot's MJCF or YAML cannot be used; the text names file, key and remedy."""


class SolverFailed(PlannerError):
    """A QP that has a solution was not solved."""

    code_name = "SOLVER_FAILED"


class HoldingInfeasible(PlannerError):
    """No tension within the limits holds the posture."""

    code_name = "HOLDING_INFEASIBLE"


class HoldingUndecided(SolverFailed):
    """The solver reached its iteration limit: not a "no"."""

    code_name = "HOLDING_UNDECIDED"


class SwingBlocked(PlannerError):
    """The simulated swing stops short of its end."""

    code_name = "SWING_BLOCKED"


class SingularJacobian(PlannerError):
    """Some motion of the joints that no muscle restrains."""

    code_name = "SINGULAR_JACOBIAN"


class SwingAborted(PlannerError):
    """A running swing had to stop, or may not begin; each kind says why."""


class SwingNotReady(SwingAborted, NotReady):
    """A node, an answer or a measurement that a swing needs is missing."""


class SwingStateStale(SwingAborted, StaleState):
    """Measurements stopped while the arm swung, or are too old to begin."""


class NotAtStart(SwingAborted):
    """The arm does not come to the start posture, or does not rest there."""

    code_name = "NOT_AT_START"


class PhaseTimeout(SwingAborted):
    """A phase of the swing lasts longer than its limit."""

    code_name = "PHASE_TIMEOUT"


class FaultLatched(SwingAborted):
    """Muscles have a fault, or the emergency stop is latched."""

    code_name = "FAULT_LATCHED"


class Interrupted(SwingAborted):
    """Somebody else commands the arm."""

    code_name = "INTERRUPTED"


class Canceled(SwingAborted):
    """The client, or the node's end, canceled the swing."""

    code_name = "CANCELED"


class Preempted(SwingAborted):
    """Another goal took the swing's place."""

    code_name = "PREEMPTED"


class Busy(SwingAborted):
    """Another swing runs."""

    code_name = "BUSY"


class PlannerUnavailable(NotReady, TimeoutError):
    """No planner answers."""


def one_line(text: str) -> str:
    """Return a text as one printable line: a damaged bag's names may hold anything."""
    return "".join(letter if letter.isprintable() else " " for letter in text)


class BagError(NotReady, OSError):
    """A bag cannot be written or read; the text names the file and what is wrong with it."""

    def __str__(self) -> str:
        """Return one line, whatever stands in the bag."""
        return one_line(super().__str__())


class UnreadableBag(BagError):
    """No bag, or one of which nothing can be read."""


class UnknownTopic(BagError):
    """A topic, type or field that the bag does not have."""


class NoHeader(UnknownTopic):
    """A topic whose messages have no stamp."""


class UndecodableMessage(BagError):
    """A message or a definition that does not follow its type."""
