"""Frames travel as datagrams between bridge and boards, and what goes wrong names the URL."""

import socket
import time
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint
from typing import Any

import pytest

from musashi_muscle_bridge import bus as bus_module
from musashi_muscle_bridge.bus import ENTRY_POINT_GROUP, open_bus
from musashi_muscle_bridge.errors import BusError, BusTimeout
from musashi_muscle_bridge.udp_bus import UdpBoardPort, UdpBus, udp_address

LOST = 0.05
"""[s] to wait for what shall not come."""
SOON = 5.0
"""[s] to wait for what shall come."""


@pytest.fixture
def url() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"udp://127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def port(url: str) -> Iterator[UdpBoardPort]:
    port = UdpBoardPort(url)
    yield port
    port.close()


@pytest.fixture
def bus(url: str, port: UdpBoardPort) -> Iterator[UdpBus]:
    bus = UdpBus(url)
    yield bus
    bus.close()


@pytest.fixture
def _udp_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Entry points as the installed package has them, whether it is installed or not."""

    def entry_points(group: str) -> list[EntryPoint]:
        assert group == ENTRY_POINT_GROUP
        udp = EntryPoint("udp", "musashi_muscle_bridge.udp_bus:UdpBus", group)
        serial = EntryPoint("serial", "musashi_muscle_bridge.serial_bus:SerialBus", group)
        return [udp, serial]

    monkeypatch.setattr(bus_module, "entry_points", entry_points)


def test_a_frame_reaches_the_boards(bus: UdpBus, port: UdpBoardPort) -> None:
    bus.send(b"command")
    assert port.receive(SOON) == b"command"


def test_the_answer_reaches_the_bridge(bus: UdpBus, port: UdpBoardPort) -> None:
    bus.send(b"command")
    port.receive(SOON)
    port.send(b"state")
    assert bus.receive(SOON) == b"state"


def test_frames_keep_their_borders_and_their_order(bus: UdpBus, port: UdpBoardPort) -> None:
    for frame in (b"one", b"two", b"three"):
        bus.send(frame)
    assert [port.receive(SOON) for _ in range(3)] == [b"one", b"two", b"three"]


def test_a_frame_of_many_muscles_passes_in_one_piece(bus: UdpBus, port: UdpBoardPort) -> None:
    frame = bytes(range(256)) * 200
    bus.send(frame)
    assert port.receive(SOON) == frame


def test_silent_boards_are_a_timeout_that_names_the_url(
    bus: UdpBus, port: UdpBoardPort, url: str
) -> None:
    with pytest.raises(BusTimeout) as caught:
        bus.receive(LOST)
    assert str(caught.value) == f"{url}: no answer from the boards"


def test_the_bridge_waits_as_long_as_it_was_told(bus: UdpBus) -> None:
    begin = time.monotonic()
    with pytest.raises(BusTimeout):
        bus.receive(LOST)
    assert LOST * 0.9 <= time.monotonic() - begin < LOST + SOON


def test_a_timeout_of_zero_does_not_block(bus: UdpBus) -> None:
    begin = time.monotonic()
    with pytest.raises(BusTimeout):
        bus.receive(0.0)
    assert time.monotonic() - begin < SOON


def test_a_bus_timeout_is_also_the_builtin_one() -> None:
    assert issubclass(BusTimeout, TimeoutError)
    assert issubclass(BusTimeout, BusError)


def test_absent_boards_are_a_timeout_too(url: str) -> None:
    bus = UdpBus(url)
    for _ in range(3):
        bus.send(b"command")
        with pytest.raises(BusTimeout):
            bus.receive(LOST)
    bus.close()


def test_boards_that_come_late_are_found(url: str) -> None:
    bus = UdpBus(url)
    bus.send(b"nobody hears this")
    with pytest.raises(BusTimeout):
        bus.receive(LOST)
    port = UdpBoardPort(url)
    bus.send(b"command")
    assert port.receive(SOON) == b"command"
    bus.close()
    port.close()


def test_a_stranger_cannot_answer_in_the_boards_place(bus: UdpBus, port: UdpBoardPort) -> None:
    bus.send(b"command")
    port.receive(SOON)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.sendto(b"forged", bus._socket.getsockname())
    with pytest.raises(BusTimeout):
        bus.receive(LOST)


def test_boards_without_a_command_get_none(port: UdpBoardPort) -> None:
    assert port.receive(LOST) is None


def test_boards_do_not_answer_before_they_were_asked(bus: UdpBus, port: UdpBoardPort) -> None:
    port.send(b"state")
    with pytest.raises(BusTimeout):
        bus.receive(LOST)


def test_boards_survive_a_bridge_that_went_away(url: str, port: UdpBoardPort) -> None:
    first = UdpBus(url)
    first.send(b"last words")
    port.receive(SOON)
    first.close()
    for _ in range(3):
        port.send(b"state")
        assert port.receive(LOST) is None
    second = UdpBus(url)
    second.send(b"command")
    assert port.receive(SOON) == b"command"
    port.send(b"state")
    assert second.receive(SOON) == b"state"
    second.close()


def test_a_busy_port_asks_for_the_other_mock_driver(url: str, port: UdpBoardPort) -> None:
    with pytest.raises(BusError) as caught:
        UdpBoardPort(url)
    assert str(caught.value) == (
        f"bus_url '{url}': Address already in use; is another mock driver running?"
    )


def test_a_closed_port_is_free_again(url: str) -> None:
    UdpBoardPort(url).close()
    UdpBoardPort(url).close()


def test_a_closed_bus_sends_nothing_and_says_so(bus: UdpBus, url: str) -> None:
    bus.close()
    with pytest.raises(BusError, match=f"^{url}: "):
        bus.send(b"command")


def test_a_good_url_gives_host_and_port() -> None:
    assert udp_address("udp://127.0.0.1:48800") == ("127.0.0.1", 48800)


@pytest.mark.parametrize("make", [udp_address, UdpBus, UdpBoardPort])
@pytest.mark.parametrize(
    "bad", ["udp://127.0.0.1", "udp://:48800", "udp://127.0.0.1:0", "tcp://127.0.0.1:48800", ""]
)
def test_an_incomplete_url_is_refused_with_an_example(make: Callable[[str], Any], bad: str) -> None:
    with pytest.raises(BusError) as caught:
        make(bad)
    assert str(caught.value) == (
        f"bus_url '{bad}': expected udp://HOST:PORT, such as udp://127.0.0.1:48800"
    )


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        ("udp://127.0.0.1:70000", "Port out of range 0-65535"),
        ("udp://127.0.0.1:x", "Port could not be cast to integer value as 'x'"),
    ],
)
def test_a_port_that_is_no_port_is_refused_with_the_reason(bad: str, why: str) -> None:
    with pytest.raises(BusError) as caught:
        udp_address(bad)
    assert str(caught.value) == f"bus_url '{bad}': {why}; expected udp://HOST:PORT"


@pytest.mark.usefixtures("_udp_is_installed")
def test_the_scheme_of_a_url_selects_the_bus(url: str, port: UdpBoardPort) -> None:
    bus = open_bus(url)
    bus.send(b"command")
    assert port.receive(SOON) == b"command"
    bus.close()


@pytest.mark.usefixtures("_udp_is_installed")
@pytest.mark.parametrize(("bad", "scheme"), [("can://can0", "can"), ("127.0.0.1", "")])
def test_an_unknown_scheme_is_refused_with_the_choices(bad: str, scheme: str) -> None:
    with pytest.raises(BusError) as caught:
        open_bus(bad)
    assert str(caught.value) == (
        f"bus_url '{bad}': unknown scheme '{scheme}', choose from: serial, udp"
    )
