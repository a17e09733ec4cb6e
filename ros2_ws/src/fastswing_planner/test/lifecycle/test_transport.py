"""Every process talks over UDP, unless the environment says otherwise."""

import os

import pytest

from fastswing_planner.lifecycle.transport import choose_transport

NAME = "FASTDDS_BUILTIN_TRANSPORTS"


@pytest.mark.parametrize(("before", "after"), [(None, "UDPv4"), ("LARGE_DATA", "LARGE_DATA")])
def test_what_the_environment_says_stays(
    monkeypatch: pytest.MonkeyPatch, before: str | None, after: str
) -> None:
    monkeypatch.setenv(NAME, before or "")
    if before is None:
        monkeypatch.delenv(NAME)
    choose_transport()
    assert os.environ[NAME] == after
