"""Requests that were on their way for too long are refused."""

import pytest

from fastswing_planner.errors import StaleRequest
from fastswing_planner.lifecycle.request_age import check_request_stamp

NOW = 1_700_000_000_000_000_000


def refusal(stamp_ns: int) -> str:
    with pytest.raises(StaleRequest) as caught:
        check_request_stamp("goal", stamp_ns, NOW, 1.0)
    return str(caught.value)


def test_a_request_without_stamp_is_refused() -> None:
    assert refusal(0) == (
        "the goal's stamp is zero: fill in when it was made, late ones are not carried out"
    )


def test_an_old_request_is_refused() -> None:
    assert refusal(NOW - 8_000_000_000) == "the goal is 8.00 s old, at most 1 s: send it again"


def test_a_request_from_the_future_is_refused() -> None:
    assert refusal(NOW + 3_600_000_000_000) == (
        "the goal's stamp is 3600.00 s in the future: do the computers' clocks agree?"
    )


@pytest.mark.parametrize("age_ns", [0, 999_000_000, -999_000_000])
def test_a_request_within_the_limit_is_taken(age_ns: int) -> None:
    check_request_stamp("goal", NOW - age_ns, NOW, 1.0)


def test_the_code_is_stale_request() -> None:
    assert StaleRequest.code_name == "STALE_REQUEST"
