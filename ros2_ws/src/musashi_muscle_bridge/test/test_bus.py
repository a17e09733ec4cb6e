"""The scheme of a URL selects a bus among the installed ones."""

from importlib.metadata import EntryPoint

import pytest

from musashi_muscle_bridge import bus as bus_module
from musashi_muscle_bridge.bus import BOARD_ENDS, BRIDGE_ENDS, open_board_port, open_bus
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
            "musashi_muscle_bridge.bus:NoSuchBus",
            "module 'musashi_muscle_bridge.bus' has no attribute 'NoSuchBus'",
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
