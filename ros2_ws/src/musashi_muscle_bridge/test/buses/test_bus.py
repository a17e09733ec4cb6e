"""The scheme of a URL selects a bus among the installed ones."""

from importlib.metadata import EntryPoint

import pytest

from musashi_muscle_bridge.buses import bus as bus_module
from musashi_muscle_bridge.buses.bus import (
    BOARD_ENDS,
    BRIDGE_ENDS,
    group_urls,
    open_all,
    open_board_port,
    open_bus,
)
from musashi_muscle_bridge.errors import BusError


@pytest.mark.parametrize("opener", [open_bus, open_board_port])
@pytest.mark.parametrize(
    ("bad", "scheme"), [("can://can0", "can"), ("127.0.0.1", ""), ("", ""), ("udp", "")]
)
def test_an_unknown_scheme_is_refused_with_the_choices(opener: type, bad: str, scheme: str) -> None:
    with pytest.raises(BusError) as caught:
        opener(bad)
    assert str(caught.value) == (
        f"bus_url '{bad}': unknown scheme '{scheme}', choose from: serial, udp"
    )


def test_what_is_no_url_is_refused_with_the_reason() -> None:
    with pytest.raises(BusError) as caught:
        open_bus("udp://[::1")
    assert str(caught.value) == "bus_url 'udp://[::1': Invalid IPv6 URL; expected SCHEME://..."


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("no_such_module:Bus", "No module named 'no_such_module'"),
        (
            "musashi_muscle_bridge.buses.bus:NoSuchBus",
            "module 'musashi_muscle_bridge.buses.bus' has no attribute 'NoSuchBus'",
        ),
    ],
)
@pytest.mark.parametrize("group", [BRIDGE_ENDS, BOARD_ENDS])
def test_a_bus_that_cannot_be_loaded_is_named(
    monkeypatch: pytest.MonkeyPatch, group: str, value: str, why: str
) -> None:
    def entry_points(group: str) -> list[EntryPoint]:
        return [EntryPoint("lab", value, group)]

    monkeypatch.setattr(bus_module, "entry_points", entry_points)
    opener = open_bus if group == BRIDGE_ENDS else open_board_port
    with pytest.raises(BusError) as caught:
        opener("lab:///tmp/lab")
    assert str(caught.value) == (
        f"bus_url 'lab:///tmp/lab': the entry point '{value}' of {group} cannot be loaded: {why}"
    )


# Several buses.


def test_the_whole_text_is_the_url_of_a_single_group() -> None:
    assert group_urls("serial:///a b", 1) == ["serial:///a b"]


def test_several_urls_are_separated_by_blanks() -> None:
    assert group_urls(" udp://a:1  udp://b:2 ", 2) == ["udp://a:1", "udp://b:2"]


def test_each_group_needs_a_url() -> None:
    with pytest.raises(BusError) as caught:
        group_urls("udp://a:1 udp://b:2", 3)
    assert str(caught.value) == (
        "bus_url 'udp://a:1 udp://b:2' has 2 URLs, the robot has 3 board_groups: "
        "write one URL for each, separated by blanks"
    )


def test_two_groups_cannot_share_a_bus() -> None:
    with pytest.raises(BusError) as caught:
        group_urls("udp://a:1 udp://a:1", 2)
    assert str(caught.value) == (
        "bus_url 'udp://a:1 udp://a:1': two board_groups cannot share udp://a:1"
    )


def test_when_one_bus_cannot_be_opened_none_stays_open() -> None:
    class End:
        closed = False

        def close(self) -> None:
            self.closed = True

    opened: list[End] = []

    def opener(url: str) -> End:
        if url == "bad":
            raise BusError(url)
        opened.append(End())
        return opened[-1]

    with pytest.raises(BusError):
        open_all(opener, ["good", "better", "bad"])
    assert [end.closed for end in opened] == [True, True]
