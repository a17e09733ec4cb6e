"""Each error has a code of its own, and comes back from it."""

from collections.abc import Iterator

import pytest

from fastswing_msgs.msg import ErrorCode
from fastswing_planner.conversion.error_codes import error_code, error_from, error_name
from fastswing_planner.errors import PlannerError


def all_errors(kind: type[PlannerError] = PlannerError) -> Iterator[type[PlannerError]]:
    yield kind
    for special in kind.__subclasses__():
        if special.__module__ == "fastswing_planner.errors":
            yield from all_errors(special)


def codes() -> dict[str, int]:
    return {name: value for name, value in vars(ErrorCode).items() if name.isupper()}


def told(kind: type[PlannerError]) -> type[PlannerError]:
    """Return what a client learns of an error: the class of its code."""
    return next(one for one in kind.__mro__ if "code_name" in vars(one))


@pytest.mark.parametrize("kind", list(all_errors()), ids=lambda kind: kind.__name__)
def test_the_code_name_of_an_error_is_a_constant(kind: type[PlannerError]) -> None:
    assert kind.code_name in codes()


@pytest.mark.parametrize("kind", list(all_errors()), ids=lambda kind: kind.__name__)
def test_an_error_comes_back_from_its_code(kind: type[PlannerError]) -> None:
    back = error_from(error_code(kind("what")), "what")
    assert (type(back), str(back)) == (told(kind), "what")


def test_no_two_codes_have_the_same_number() -> None:
    assert len(set(codes().values())) == len(codes())


@pytest.mark.parametrize("name", codes())
def test_a_codes_number_names_it(name: str) -> None:
    assert error_name(codes()[name]) == name


@pytest.mark.parametrize("number", [1, -1000, 2**31 - 1])
def test_a_number_without_a_name_is_internal(number: int) -> None:
    assert error_name(number) == "INTERNAL"
