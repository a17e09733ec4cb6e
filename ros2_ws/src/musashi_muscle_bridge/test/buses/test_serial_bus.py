"""What is the serial bus's own: ports, pseudo-terminals, and what is wrong with a URL."""

import os
import pty
import time
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from musashi_muscle_bridge.buses.serial_bus import (
    SerialAddress,
    SerialBoardPort,
    SerialBus,
    serial_address,
)
from musashi_muscle_bridge.errors import BusError, BusTimeout

SOON = 10.0
EXAMPLE = "such as serial:///dev/ttyACM0 or serial:///dev/ttyUSB0?baudrate=1000000"


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"serial://{tmp_path}/boards?pty=true"


@pytest.fixture
def device() -> Iterator[str]:
    """Return a terminal that nobody serves."""
    boards, bridge = pty.openpty()
    tty.setraw(bridge)
    yield os.ttyname(bridge)
    os.close(boards)
    os.close(bridge)


@pytest.mark.parametrize(
    ("url", "address"),
    [
        ("serial:///dev/ttyACM0", SerialAddress(Path("/dev/ttyACM0"), 1_000_000, False)),
        (
            "serial:///dev/ttyUSB0?baudrate=115200",
            SerialAddress(Path("/dev/ttyUSB0"), 115200, False),
        ),
        ("serial:///tmp/boards?pty=true", SerialAddress(Path("/tmp/boards"), 1_000_000, True)),
    ],
)
def test_a_good_url_gives_path_and_options(url: str, address: SerialAddress) -> None:
    assert serial_address(url) == address


@pytest.mark.parametrize(
    ("bad", "why"),
    [
        ("serial://", "expected serial:///PATH"),
        ("serial:///", "expected serial:///PATH"),
        ("serial://ttyACM0", "expected serial:///PATH"),
        ("serial://host/dev/ttyACM0", "expected serial:///PATH"),
        ("serial:///dev/ttyACM0#1", "expected serial:///PATH"),
        ("serial:///dev/x?baud=1", "unknown option 'baud', choose from: baudrate, pty"),
        ("serial:///dev/x?baudrate=fast", "baudrate is 'fast', expected 1 to 100000000"),
        ("serial:///dev/x?baudrate=0", "baudrate is '0', expected 1 to 100000000"),
        ("serial:///dev/x?baudrate=-9", "baudrate is '-9', expected 1 to 100000000"),
        ("serial:///dev/x?baudrate=", "baudrate is '', expected 1 to 100000000"),
        ("serial:///dev/x?pty=maybe", "pty is 'maybe', expected true or false"),
    ],
)
def test_a_url_that_means_nothing_is_refused_with_an_example(bad: str, why: str) -> None:
    with pytest.raises(BusError) as caught:
        SerialBus(bad)
    assert str(caught.value) == f"bus_url '{bad}': {why}, {EXAMPLE}"


def test_an_absent_port_asks_for_the_cable(tmp_path: Path) -> None:
    url = f"serial://{tmp_path}/ttyACM0"
    with pytest.raises(BusError) as caught:
        SerialBus(url)
    assert str(caught.value) == f"bus_url '{url}': no such port; is the cable plugged in?"


def test_the_terminal_of_a_mock_driver_may_come_after_the_bridge(url: str) -> None:
    bus = SerialBus(url)
    with pytest.raises(BusError) as caught:
        bus.send(b"unheard")
    assert str(caught.value) == f"bus_url '{url}': no such port; is the mock driver running?"
    port = SerialBoardPort(url)
    found = None
    deadline = time.monotonic() + SOON
    while found is None and time.monotonic() < deadline:
        with suppress(BusError):
            bus.send(b"command")
        found = port.receive(0.01)
    assert found is not None
    bus.close()
    port.close()


def test_a_busy_port_asks_for_the_other_program(device: str) -> None:
    url = f"serial://{device}"
    bus = SerialBus(url)
    with pytest.raises(BusError) as caught:
        SerialBus(url)
    bus.close()
    assert str(caught.value) == (
        f"bus_url '{url}': the port is busy; end the other program that has it open"
    )


def test_a_file_is_no_serial_port(tmp_path: Path) -> None:
    (tmp_path / "notes").write_text("mine")
    url = f"serial://{tmp_path}/notes"
    with pytest.raises(BusError) as caught:
        SerialBus(url)
    assert str(caught.value).startswith(f"bus_url '{url}': not usable as a serial port: ")


def test_the_boards_terminal_is_gone_with_them(url: str, tmp_path: Path) -> None:
    SerialBoardPort(url).close()
    assert not (tmp_path / "boards").is_symlink()


def test_a_second_mock_driver_at_the_same_path_is_refused(url: str, tmp_path: Path) -> None:
    port = SerialBoardPort(url)
    with pytest.raises(BusError) as caught:
        SerialBoardPort(url)
    port.close()
    assert str(caught.value) == (
        f"bus_url '{url}': {tmp_path}/boards exists; is another mock driver running? "
        "If not, remove it"
    )


def test_a_file_of_somebody_is_not_replaced_by_a_terminal(url: str, tmp_path: Path) -> None:
    (tmp_path / "boards").write_text("mine")
    with pytest.raises(BusError):
        SerialBoardPort(url)
    assert (tmp_path / "boards").read_text() == "mine"


def test_the_link_of_a_killed_mock_driver_is_replaced(url: str, tmp_path: Path) -> None:
    (tmp_path / "boards").symlink_to("/dev/pts/no_such_terminal")
    port = SerialBoardPort(url)
    bus = SerialBus(url)
    bus.send(b"command")
    found = port.receive(SOON)
    assert found is not None
    assert found.frame == b"command"
    bus.close()
    port.close()


def test_a_terminal_where_none_can_be_made_is_refused(tmp_path: Path) -> None:
    url = f"serial://{tmp_path}/no_such_folder/boards?pty=true"
    with pytest.raises(BusError) as caught:
        SerialBoardPort(url)
    assert str(caught.value) == f"bus_url '{url}': No such file or directory; choose another path"


def test_boards_may_sit_on_a_device_too(device: str) -> None:
    port = SerialBoardPort(f"serial://{device}")
    assert port.receive(0.0) is None
    port.close()


def test_what_a_gone_bridge_left_is_not_for_the_next_one(url: str) -> None:
    port = SerialBoardPort(url)
    SerialBus(url).close()
    port.send(b"late", None)
    bus = SerialBus(url)
    with pytest.raises(BusTimeout):
        bus.receive(0.05)
    bus.close()
    port.close()


def test_a_port_that_takes_nothing_loses_frames_and_counts_them(device: str) -> None:
    bus = SerialBus(f"serial://{device}")
    for _ in range(10):
        bus.send(bytes(4000))
    assert bus.dropped["unsent"] > 0
    bus.close()


def test_an_unplugging_is_told_and_counted(url: str) -> None:
    port = SerialBoardPort(url)
    bus = SerialBus(url)
    port.close()
    with pytest.raises(BusError) as caught:
        bus.receive(SOON)
    assert str(caught.value).startswith(f"{url}: ")
    assert bus.dropped["unplugged"] == 1
    bus.close()
