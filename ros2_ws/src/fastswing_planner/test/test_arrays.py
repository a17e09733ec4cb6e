"""Arrays are checked where they come in, and the text names the wrong element."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import finite_vector, frozen, named_vector, unique_known
from fastswing_planner.errors import DuplicateName, NotFinite, UnknownName, WrongLength

JOINTS = ("a", "b", "c")
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def test_a_frozen_array_cannot_be_written() -> None:
    with pytest.raises(ValueError, match=r"^assignment destination is read-only$"):
        frozen([1.0, 2.0])[0] = 3.0


def test_a_frozen_array_does_not_follow_its_source() -> None:
    source = np.array([1.0, 2.0])
    copy = frozen(source)
    source[0] = 9.0
    assert copy.tolist() == [1.0, 2.0]


def test_freezing_leaves_the_source_writable() -> None:
    source = np.zeros(2)
    frozen(source)
    assert source.flags.writeable


@given(st.lists(NUMBERS, min_size=3, max_size=3))
def test_finite_numbers_pass_unchanged(values: list[float]) -> None:
    assert finite_vector("angle", values, JOINTS).tolist() == values


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_number_that_is_not_finite_is_named(bad: float, place: int) -> None:
    values = [0.0, 0.0, 0.0]
    values[place] = bad
    with pytest.raises(NotFinite) as caught:
        finite_vector("angle", values, JOINTS)
    assert str(caught.value) == f"angle of {JOINTS[place]} is {bad}, expected a finite number"


@pytest.mark.parametrize("count", [0, 2, 4])
def test_a_wrong_number_of_values_lists_the_names(count: int) -> None:
    with pytest.raises(WrongLength) as caught:
        finite_vector("angle", [0.0] * count, JOINTS)
    assert str(caught.value) == f"angle has {count} values, expected 3: a, b, c"


def test_a_table_of_values_is_refused() -> None:
    with pytest.raises(WrongLength):
        finite_vector("angle", np.zeros((3, 1)), JOINTS)


@given(st.permutations(JOINTS))
def test_names_become_their_places(names: list[str]) -> None:
    assert [JOINTS[index] for index in unique_known("joint", names, JOINTS)] == names


def test_an_unknown_name_lists_the_choices() -> None:
    with pytest.raises(UnknownName) as caught:
        unique_known("joint", ["a", "z"], JOINTS)
    assert str(caught.value) == "unknown joint 'z', choose from: a, b, c"


def test_a_name_given_twice_is_refused() -> None:
    with pytest.raises(DuplicateName) as caught:
        unique_known("joint", ["a", "b", "a"], JOINTS)
    assert str(caught.value) == "joint 'a' is named more than once"


@given(st.permutations(JOINTS), st.lists(NUMBERS, min_size=3, max_size=3))
def test_named_values_find_their_places(names: list[str], values: list[float]) -> None:
    ordered = named_vector("angle", "joint", names, values, JOINTS)
    assert dict(zip(JOINTS, ordered.tolist(), strict=True)) == dict(zip(names, values, strict=True))


def test_values_without_names_are_in_the_robots_order() -> None:
    assert named_vector("angle", "joint", [], [1, 2, 3], JOINTS).tolist() == [1.0, 2.0, 3.0]


def test_names_that_are_missing_are_listed() -> None:
    with pytest.raises(WrongLength) as caught:
        named_vector("angle", "joint", ["b"], [0.0], JOINTS)
    assert str(caught.value) == "angle lacks joint a, c"


def test_a_wrong_value_is_named_in_the_callers_order() -> None:
    with pytest.raises(NotFinite) as caught:
        named_vector("angle", "joint", ["c", "a", "b"], [math.nan, 0.0, 0.0], JOINTS)
    assert str(caught.value) == "angle of c is nan, expected a finite number"
