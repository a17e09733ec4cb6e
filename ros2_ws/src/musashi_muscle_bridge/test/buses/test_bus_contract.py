"""What every bus must do: udp, serial, and the one of docs/bring_your_own_boards.md."""

import os
import pty
import socket
import time
import tty
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.buses import cobs
from musashi_muscle_bridge.buses.bus import BoardPort, Bus, Received, open_board_port, open_bus
from musashi_muscle_bridge.buses.protocol import (
    COMMAND_ROW,
    JOINT_ROW,
    STATE_ROW,
    CommandFrame,
    Mode,
    StateFrame,
    WatchdogAction,
)
from musashi_muscle_bridge.emulation.board_link import BoardLink
from musashi_muscle_bridge.emulation.boards import Boards
from musashi_muscle_bridge.errors import BusError, BusTimeout, FrameError

LOST = 0.05
"""[s] to wait for what shall not come."""
SOON = 10.0
"""[s] to wait for what shall come."""
MARKER = 0xFFFF
"""Sequence of the sound frame that follows a damaged one."""


class Wire(ABC):
    """A bus under test; its raw end lets a test write what it likes to the bridge."""

    url: str

    @abstractmethod
    def on_the_wire(self, frame: bytes) -> bytes:
        """Return the bytes that carry a frame."""

    @abstractmethod
    def open_raw(self) -> Bus:
        """Open the bridge's end, with the test in the boards' place."""

    @abstractmethod
    def write(self, raw: bytes) -> None:
        """Write bytes to the bridge; what it does not take is lost."""

    @abstractmethod
    def close(self) -> None:
        """Close the raw end."""


class DatagramWire(Wire):
    """Sockets: a frame is a datagram."""

    def __init__(self, url: str, family: int, address: str | tuple[str, int]) -> None:
        self.url = url
        self._address = address
        self._raw = socket.socket(family, socket.SOCK_DGRAM)
        self._raw.settimeout(SOON)

    def on_the_wire(self, frame: bytes) -> bytes:
        return frame

    def open_raw(self) -> Bus:
        self._raw.bind(self._address)
        bus = open_bus(self.url)
        bus.send(b"where I am")
        _, self._bridge = self._raw.recvfrom(100)
        self._raw.setblocking(False)
        return bus

    def write(self, raw: bytes) -> None:
        with suppress(BlockingIOError):
            self._raw.sendto(raw, self._bridge)

    def close(self) -> None:
        self._raw.close()


class SerialWire(Wire):
    """A pseudo-terminal: a frame is COBS between zeros."""

    def __init__(self, folder: Path) -> None:
        self.url = f"serial://{folder}/boards?pty=true"
        self._raw, self._bridge = pty.openpty()
        tty.setraw(self._bridge)
        os.set_blocking(self._raw, False)

    def on_the_wire(self, frame: bytes) -> bytes:
        return b"\0" + cobs.encode(frame) + b"\0"

    def open_raw(self) -> Bus:
        return open_bus(f"serial://{os.ttyname(self._bridge)}")

    def write(self, raw: bytes) -> None:
        with suppress(BlockingIOError):
            os.write(self._raw, raw)

    def close(self) -> None:
        os.close(self._raw)
        os.close(self._bridge)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@pytest.fixture(scope="session")
def lab_bus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    page = pytest.importorskip("lab_bus_page", reason="a package alone comes without docs")
    installed: Path = page.install_lab_bus(tmp_path_factory.mktemp("lab"))
    return installed


@pytest.fixture(params=["udp", "serial", "lab"])
def wire(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Wire]:
    made: Wire
    if request.param == "udp":
        port = free_port()
        made = DatagramWire(f"udp://127.0.0.1:{port}", socket.AF_INET, ("127.0.0.1", port))
    elif request.param == "serial":
        made = SerialWire(tmp_path)
    else:
        monkeypatch.syspath_prepend(str(request.getfixturevalue("lab_bus")))
        path = str(tmp_path / "lab.socket")
        made = DatagramWire(f"lab://{path}", socket.AF_UNIX, path)
    yield made
    made.close()


def state(sequence: int, muscles: int = 1, joints: int = 1) -> bytes:
    rows = np.zeros(muscles, STATE_ROW)
    rows["id"] = np.arange(muscles)
    rows["length"] = 0.5
    return StateFrame(sequence, rows, np.zeros(joints, JOINT_ROW)).encode()


def command(sequence: int, muscles: int = 2) -> bytes:
    rows = np.zeros(muscles, COMMAND_ROW)
    rows["id"] = np.arange(muscles)
    rows["mode"], rows["setpoint"] = Mode.LENGTH, 1.0
    rows["tension_limit"] = rows["current_limit"] = 10.0
    return CommandFrame(sequence, rows, WatchdogAction.ZERO_CURRENT, 1.0).encode()


def received(port: BoardPort) -> Received:
    found = port.receive(SOON)
    assert found is not None
    return found


def states_until_the_marker(bus: Bus) -> list[int]:
    """Return the sequence numbers of what a bridge would take, up to the marker."""
    taken: list[int] = []
    while MARKER not in taken:
        with suppress(FrameError):
            taken.append(StateFrame.decode(bus.receive(SOON)).sequence)
    return taken


class TestBothEnds:
    """Bridge and boards at either end of the same bus."""

    @pytest.fixture
    def port(self, wire: Wire) -> Iterator[BoardPort]:
        port = open_board_port(wire.url)
        yield port
        port.close()

    @pytest.fixture
    def bus(self, wire: Wire, port: BoardPort) -> Iterator[Bus]:
        bus = open_bus(wire.url)
        yield bus
        bus.close()

    @pytest.mark.parametrize(
        "frame", [b"x", bytes(1000), bytes(range(256)) * 4], ids=["one", "zeros", "all"]
    )
    def test_any_bytes_reach_the_boards(self, bus: Bus, port: BoardPort, frame: bytes) -> None:
        bus.send(frame)
        assert received(port).frame == frame

    def test_the_answer_reaches_the_bridge(self, bus: Bus, port: BoardPort) -> None:
        bus.send(b"command")
        port.send(b"state", received(port).sender)
        assert bus.receive(SOON) == b"state"

    def test_frames_keep_their_borders_and_their_order(self, bus: Bus, port: BoardPort) -> None:
        for frame in (b"one", b"two", b"three"):
            bus.send(frame)
        assert [received(port).frame for _ in range(3)] == [b"one", b"two", b"three"]

    def test_frames_of_74_muscles_and_38_joints_pass(self, bus: Bus, port: BoardPort) -> None:
        bus.send(command(1, 74))
        found = received(port)
        port.send(state(1, 74, 38), found.sender)
        assert len(CommandFrame.decode(found.frame).rows) == 74
        assert len(StateFrame.decode(bus.receive(SOON)).rows) == 74

    def test_silent_boards_are_a_timeout_that_names_the_url(
        self, bus: Bus, port: BoardPort, wire: Wire
    ) -> None:
        with pytest.raises(BusTimeout) as caught:
            bus.receive(LOST)
        assert str(caught.value) == f"{wire.url}: no answer from the boards"

    @pytest.mark.parametrize("timeout", [0.0, -1.0])
    def test_a_timeout_that_is_over_does_not_block(self, bus: Bus, timeout: float) -> None:
        with pytest.raises(BusTimeout):
            bus.receive(timeout)

    def test_boards_without_a_command_get_none(self, port: BoardPort) -> None:
        assert port.receive(LOST) is None

    def test_after_a_lost_answer_the_next_one_comes(self, bus: Bus, port: BoardPort) -> None:
        bus.send(b"first")
        received(port)
        with pytest.raises(BusTimeout):
            bus.receive(LOST)
        bus.send(b"second")
        port.send(b"state", received(port).sender)
        assert bus.receive(SOON) == b"state"

    def test_a_doubled_command_is_answered_once(
        self, bus: Bus, port: BoardPort, hoist: Robot
    ) -> None:
        link = BoardLink(Boards(hoist))
        for sequence in (1, 1, 2):
            bus.send(command(sequence))
        found = [received(port) for _ in range(3)]
        answers = [link.answer(each.frame, each.sender) for each in found]
        assert [answer is None for answer in answers] == [False, True, False]

    def test_a_flood_of_commands_leaves_the_newest_way_free(
        self, bus: Bus, port: BoardPort
    ) -> None:
        for _ in range(3000):
            bus.send(bytes(300))
        while port.receive(LOST) is not None:
            pass
        bus.send(b"command")
        assert received(port).frame == b"command"

    def test_boards_survive_a_bridge_that_went_away(
        self, bus: Bus, port: BoardPort, wire: Wire
    ) -> None:
        bus.send(b"last words")
        gone = received(port).sender
        bus.close()
        for _ in range(3):
            port.send(b"state", gone)
        second = open_bus(wire.url)
        second.send(b"command")
        port.send(b"answer", received(port).sender)
        assert second.receive(SOON) == b"answer"
        second.close()

    def test_within_a_second_of_its_return_the_boards_port_is_found_again(
        self, bus: Bus, port: BoardPort, wire: Wire
    ) -> None:
        bus.send(b"before")
        received(port)
        port.close()
        for _ in range(20):
            with suppress(BusError):
                bus.send(b"unheard")
            with suppress(BusError):
                bus.receive(0.001)
        returned = open_board_port(wire.url)
        begin = time.monotonic()
        found = None
        while found is None and time.monotonic() - begin < SOON:
            with suppress(BusError):
                bus.send(b"after")
            found = returned.receive(0.01)
        waited = time.monotonic() - begin
        assert found is not None
        returned.send(b"answer", found.sender)
        assert bus.receive(SOON) == b"answer"
        assert waited < 1.0
        returned.close()

    def test_a_port_in_use_is_refused_naming_the_url(self, port: BoardPort, wire: Wire) -> None:
        with pytest.raises(BusError) as caught:
            open_board_port(wire.url)
        assert str(caught.value).startswith(f"bus_url '{wire.url}': ")

    def test_a_closed_port_is_free_again(self, wire: Wire) -> None:
        open_board_port(wire.url).close()
        open_board_port(wire.url).close()

    def test_a_closed_bus_sends_nothing_and_says_so(self, bus: Bus, wire: Wire) -> None:
        bus.close()
        with pytest.raises(BusError, match=f"^{wire.url.replace('?', '[?]')}: "):
            bus.send(b"command")


class TestDamage:
    """The bridge's end, with a damaged wire."""

    @pytest.fixture
    def bus(self, wire: Wire) -> Iterator[Bus]:
        bus = wire.open_raw()
        yield bus
        bus.close()

    def test_a_sound_frame_is_taken(self, bus: Bus, wire: Wire) -> None:
        wire.write(wire.on_the_wire(state(1)))
        assert StateFrame.decode(bus.receive(SOON)).sequence == 1

    def test_every_single_flipped_bit_on_the_wire_is_refused(self, bus: Bus, wire: Wire) -> None:
        sound = wire.on_the_wire(state(1))
        for bit in range(8 * len(sound)):
            damaged = bytearray(sound)
            damaged[bit // 8] ^= 1 << bit % 8
            wire.write(bytes(damaged))
            wire.write(wire.on_the_wire(state(MARKER)))
            taken = states_until_the_marker(bus)
            assert taken == [MARKER], f"bit {bit}"

    def test_every_truncated_frame_is_refused_and_the_next_one_taken(
        self, bus: Bus, wire: Wire
    ) -> None:
        content = wire.on_the_wire(state(1)).rstrip(b"\0")
        for size in range(len(content)):
            wire.write(content[:size])
            wire.write(wire.on_the_wire(state(MARKER)))
            assert states_until_the_marker(bus) == [MARKER], f"{size} bytes"

    def test_noise_does_not_hide_the_next_frame(self, bus: Bus, wire: Wire) -> None:
        wire.write(bytes(range(1, 256)) * 10)
        wire.write(wire.on_the_wire(state(MARKER)))
        assert states_until_the_marker(bus) == [MARKER]

    def test_what_nobody_reads_does_not_pile_up(self, bus: Bus, wire: Wire) -> None:
        flood = wire.on_the_wire(state(1)) * (20 if isinstance(wire, SerialWire) else 1)
        for _ in range(5000):
            wire.write(flood)
        waiting = 0
        with suppress(BusTimeout):
            while True:
                bus.receive(LOST)
                waiting += 1
        assert waiting < 5000
        wire.write(wire.on_the_wire(state(MARKER)))
        assert states_until_the_marker(bus) == [MARKER]
