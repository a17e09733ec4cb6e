"""What is wrong with robot, bus or parameters ends a node with 2 and one line; nothing moves."""

import os
import pty
import re
import shutil
import socket
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import yaml
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState

from musashi_muscle_bridge.buses.serial_bus import SerialBus
from musashi_muscle_bridge.buses.udp_bus import UdpBoardPort
from test.system.other_arms import TWO_LINK_ARM

if TYPE_CHECKING:
    from test.system.suite import Suite


END_SEC = 60.0
ON_THE_BUS = pytest.mark.parametrize("executable", ["bridge", "mock_driver"])


def only_line(world: "Suite", executable: str, **parameters: object) -> str:
    """Start a node that must end with 2; return the one line that it printed."""
    process = world.start(executable, **parameters)
    assert process.wait(END_SEC) == 2, process.log_tail()
    (line,) = process.log.read_text().splitlines()
    return line


def arm(folder: Path, **changes: object) -> Path:
    """Write the two-link arm's description with some keys replaced; return the YAML file."""
    shutil.copy(TWO_LINK_ARM.with_suffix(".xml"), folder)
    path = folder / "arm.yaml"
    path.write_text(yaml.safe_dump({**yaml.safe_load(TWO_LINK_ARM.read_text()), **changes}))
    return path


# The robot.

WRONG_ROBOTS = {
    "a muscle that the MJCF lacks": (
        {"muscles": ["deltoid", "latissimus", "biceps", "anconeus"]},
        "the MJCF does not fit: unknown muscle 'anconeus', "
        "choose from: triceps, biceps, deltoid, latissimus",
    ),
    "a joint that the MJCF lacks": (
        {"joints": ["shoulder", "wrist"]},
        "the MJCF does not fit: unknown joint 'wrist', choose from: shoulder, elbow",
    ),
    "a count that does not fit": (
        {"current_limit": [4, 4, 3]},
        "key 'current_limit' is [4, 4, 3], expected one number, or 4 for "
        "deltoid, latissimus, biceps, triceps",
    ),
    "tensions out of order": (
        {"tension_min": 120},
        "tension_max of deltoid is 100 N, must be above its tension_min 120 N",
    ),
    "a posture out of range": (
        {"postures": {"home": [0.0, 3.0]}},
        "posture 'home' of elbow is 3 rad, the MJCF allows -1 to 1",
    ),
    "an absent MJCF": ({"mjcf": "other.xml"}, "key 'mjcf' is 'other.xml': "),
}


@ON_THE_BUS
@pytest.mark.parametrize(("changes", "text"), WRONG_ROBOTS.values(), ids=WRONG_ROBOTS.keys())
def test_a_wrong_robot_is_told_with_file_key_and_value(
    world: "Suite", tmp_path: Path, executable: str, changes: dict[str, object], text: str
) -> None:
    path = arm(tmp_path, **changes)
    line = only_line(world, executable, robot_description=path)
    assert f"cannot configure: {path}: {text}" in line


def test_a_wrong_constant_of_the_emulated_arm_is_told(world: "Suite", tmp_path: Path) -> None:
    path = arm(tmp_path, plant={"winch_mass": -1})
    line = only_line(world, "mock_driver", robot_description=path)
    assert f"cannot configure: {path}: plant: winch_mass is -1, expected a positive number" in line


# The bus.


@ON_THE_BUS
@pytest.mark.parametrize(
    ("url", "text"),
    [
        ("can://can0", "unknown scheme 'can', choose from: serial, udp"),
        ("127.0.0.1:48800", "unknown scheme '', choose from: serial, udp"),
        ("udp://127.0.0.1", "expected udp://HOST:PORT, such as udp://127.0.0.1:48800"),
        ("serial://ttyACM0", "expected serial:///PATH, such as serial:///dev/ttyACM0 or "),
        ("serial:///dev/x?baudrate=fast", "baudrate is 'fast', expected 1 to 100000000"),
        ("serial:///dev/no_such_port", "no such port; is the cable plugged in?"),
    ],
)
def test_a_url_that_means_nothing_is_told_with_the_choices(
    world: "Suite", executable: str, url: str, text: str
) -> None:
    line = only_line(world, executable, bus_url=url)
    assert f"cannot activate: bus_url '{url}': {text}" in line


@pytest.fixture
def serial_port() -> Iterator[str]:
    """Return a serial port that another program has open."""
    boards, bridge = pty.openpty()
    tty.setraw(bridge)
    url = f"serial://{os.ttyname(bridge)}"
    other = SerialBus(url)
    yield url
    other.close()
    os.close(boards)
    os.close(bridge)


@ON_THE_BUS
def test_a_busy_serial_port_is_told(world: "Suite", serial_port: str, executable: str) -> None:
    line = only_line(world, executable, bus_url=serial_port)
    text = "the port is busy; end the other program that has it open"
    assert f"cannot activate: bus_url '{serial_port}': {text}" in line


def test_a_busy_udp_port_is_told(world: "Suite") -> None:
    url = world.bus_url
    other = UdpBoardPort(url)
    line = only_line(world, "mock_driver")
    other.close()
    text = "Address already in use; is another mock driver running?"
    assert f"cannot activate: bus_url '{url}': {text}" in line


@pytest.mark.parametrize(("name", "meant"), [("read_ony", "read_only"), ("bus_ulr", "bus_url")])
def test_a_misspelt_parameter_is_refused(world: "Suite", name: str, meant: str) -> None:
    line = only_line(world, "bridge", **{name: True})
    assert line == f"cannot start: unknown parameter '{name}', did you mean '{meant}'?"


# Nothing is energised.


@pytest.mark.parametrize(
    "parameters", [{"robot_description": "/no/such/robot.yaml"}, {"watchdog_action": "hope"}]
)
def test_a_bridge_that_could_not_start_has_sent_no_frame(
    world: "Suite", parameters: dict[str, object]
) -> None:
    port = UdpBoardPort(world.bus_url)
    only_line(world, "bridge", **parameters)
    received = port.receive(0.0)
    port.close()
    assert received is None


# With a lifecycle manager.


def transition(world: "Suite", executable: str, which: int) -> bool:
    request = ChangeState.Request(transition=Transition(id=which))
    return bool(world.ask(ChangeState, f"{executable}/change_state", request).success)


@ON_THE_BUS
def test_a_managed_node_with_a_wrong_robot_stays_unconfigured(
    world: "Suite", tmp_path: Path, executable: str
) -> None:
    path = arm(tmp_path, tension_min=120)
    world.start(executable, robot_description=path, autostart=False)
    assert not transition(world, executable, Transition.TRANSITION_CONFIGURE)
    assert world.state_of(executable) == State.PRIMARY_STATE_UNCONFIGURED


@ON_THE_BUS
def test_a_managed_node_whose_port_is_absent_stays_inactive(
    world: "Suite", executable: str
) -> None:
    world.start(executable, bus_url="serial:///dev/no_such_port", autostart=False)
    assert transition(world, executable, Transition.TRANSITION_CONFIGURE)
    assert not transition(world, executable, Transition.TRANSITION_ACTIVATE)
    assert world.state_of(executable) == State.PRIMARY_STATE_INACTIVE
    assert "Traceback" not in world.processes[executable].log.read_text()


def test_a_host_that_nobody_knows_is_told(world: "Suite") -> None:
    line = only_line(world, "bridge", bus_url="udp://no-such-host.invalid:48800")
    assert re.search(r"bus_url 'udp://no-such-host.invalid:48800': .*write the boards' IPv4", line)


def test_a_port_on_the_way_of_a_socket_file_is_told(world: "Suite", tmp_path: Path) -> None:
    path = tmp_path / "not_a_port"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as other:
        other.bind(str(path))
        line = only_line(world, "bridge", bus_url=f"serial://{path}")
    assert f"bus_url 'serial://{path}': not usable as a serial port: " in line
