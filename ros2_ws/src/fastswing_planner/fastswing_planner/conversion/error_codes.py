"""Errors to and from the codes that services and actions carry."""

from collections.abc import Iterator

from fastswing_msgs.msg import ErrorCode
from fastswing_planner.errors import PlannerError


def error_code(error: PlannerError) -> int:
    """Return the ErrorCode constant of an error."""
    return int(getattr(ErrorCode, error.code_name))


def error_name(code: int) -> str:
    """Return the name of an ErrorCode constant; INTERNAL for a number that is none."""
    names = {value: name for name, value in vars(ErrorCode).items() if name.isupper()}
    return names.get(code, "INTERNAL")


def error_from(code: int, text: str) -> PlannerError:
    """Return the error that a code and its text stand for; a plain PlannerError if none does."""
    name = error_name(code)
    for kind in _all_errors(PlannerError):
        if vars(kind).get("code_name") == name:
            return kind(text)
    return PlannerError(text)


def _all_errors(kind: type[PlannerError]) -> Iterator[type[PlannerError]]:
    yield kind
    for special in kind.__subclasses__():
        yield from _all_errors(special)
