"""What is UDP's own: strangers, addresses, and what is wrong with a URL."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from musashi_muscle_bridge.buses.udp_bus import UdpBoardPort, UdpBus, udp_address
from musashi_muscle_bridge.errors import BusError, BusTimeout

LOST = 0.05
"""[s] to wait for what shall not come."""
CLOCKS = 0.1
"""[s] between two readings of clocks."""
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
def stranger() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        yield stranger


def test_a_stranger_cannot_answer_in_the_boards_place(bus: UdpBus, stranger: socket.socket) -> None:
    stranger.sendto(b"forged", bus.address)
    with pytest.raises(BusTimeout):
        bus.receive(LOST)


def test_a_strangers_datagrams_are_counted(bus: UdpBus, stranger: socket.socket) -> None:
    for _ in range(3):
        stranger.sendto(b"forged", bus.address)
    with pytest.raises(BusTimeout):
        bus.receive(LOST)
    assert bus.dropped == {"stranger": 3}


def test_a_stranger_does_not_hide_the_answer(
    bus: UdpBus, port: UdpBoardPort, stranger: socket.socket
) -> None:
    stranger.sendto(b"forged", bus.address)
    port.send(b"state", bus.address)
    assert bus.receive(SOON) == b"state"


def test_a_timeout_ends_under_a_strangers_flood(bus: UdpBus, stranger: socket.socket) -> None:
    stop = threading.Event()

    def flood() -> None:
        while not stop.is_set():
            stranger.sendto(b"forged", bus.address)

    thread = threading.Thread(target=flood)
    thread.start()
    with pytest.raises(BusTimeout):
        bus.receive(LOST)
    stop.set()
    thread.join()


def test_the_bridge_listens_on_the_way_to_its_boards_only(bus: UdpBus) -> None:
    assert bus.address[0] == "127.0.0.1"


def test_a_frame_as_large_as_a_datagram_can_be_passes(bus: UdpBus, port: UdpBoardPort) -> None:
    bus.send(bytes(65507))
    found = port.receive(SOON)
    assert found is not None
    assert len(found.frame) == 65507


def test_the_boards_see_where_a_frame_came_from(bus: UdpBus, port: UdpBoardPort) -> None:
    bus.send(b"command")
    found = port.receive(SOON)
    assert found is not None
    assert found.sender == bus.address


def test_the_boards_see_when_a_frame_came_however_late_they_read_it(
    bus: UdpBus, port: UdpBoardPort
) -> None:
    before = time.monotonic()
    bus.send(b"frame")
    after = time.monotonic()
    time.sleep(5.0 * CLOCKS)
    received = port.receive(SOON)
    assert received is not None
    assert before - CLOCKS < received.arrived < after + CLOCKS


def test_absent_boards_are_a_timeout(url: str) -> None:
    bus = UdpBus(url)
    for _ in range(3):
        bus.send(b"command")
        with pytest.raises(BusTimeout):
            bus.receive(LOST)
    bus.close()


def test_a_busy_port_asks_for_the_other_mock_driver(url: str, port: UdpBoardPort) -> None:
    with pytest.raises(BusError) as caught:
        UdpBoardPort(url)
    assert str(caught.value) == (
        f"bus_url '{url}': Address already in use; is another mock driver running?"
    )


def test_boards_at_an_address_of_another_machine_cannot_be_emulated() -> None:
    with pytest.raises(BusError) as caught:
        UdpBoardPort("udp://192.0.2.1:48800")
    assert str(caught.value) == (
        "bus_url 'udp://192.0.2.1:48800': Cannot assign requested address; "
        "is another mock driver running?"
    )


@pytest.mark.parametrize("make", [UdpBus, UdpBoardPort])
def test_a_host_that_nobody_knows_is_refused(make: Callable[[str], Any]) -> None:
    with pytest.raises(BusError) as caught:
        make("udp://no-such-host.invalid:48800")
    start = "bus_url 'udp://no-such-host.invalid:48800': "
    assert str(caught.value).startswith(start)
    assert str(caught.value).endswith("'no-such-host.invalid'; write the boards' IPv4 address")


def test_a_good_url_gives_host_and_port() -> None:
    assert udp_address("udp://127.0.0.1:48800") == ("127.0.0.1", 48800)


@pytest.mark.parametrize("make", [udp_address, UdpBus, UdpBoardPort])
@pytest.mark.parametrize(
    "bad",
    [
        "udp://127.0.0.1",
        "udp://:48800",
        "udp://127.0.0.1:0",
        "tcp://127.0.0.1:48800",
        "udp://127.0.0.1:48800/x",
        "udp://127.0.0.1:48800?x=1",
        "",
    ],
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
