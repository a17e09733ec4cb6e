"""With ROS_SECURITY_STRATEGY=Enforce nobody gets in without keys, or does more than permitted.

The Fast DDS of the Python wheels is built without its security plug-ins. There nodes must refuse
to start, and the tests that need the plug-ins are skipped; beside an installed ROS 2 they run.
"""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from keystore import KeystoreRequest, make_keystore
from processes import (
    Process,
    free_domain,
    free_udp_port,
    isolated_environment,
    stop_all,
)

ROOT = Path(__file__).parents[2]


TIMEOUT_SEC = 60.0
SILENCE_SEC = 10.0
"""How long a stranger listens in vain; discovery takes less than a third of it."""
NO_PLUGINS = "This Fast DDS version doesn't have the security libraries"
PACKAGES = {
    "mock_driver": "musashi_muscle_bridge",
    "bridge": "musashi_muscle_bridge",
    "planner": "fastswing_planner",
    "swing_executor": "fastswing_planner",
    "inhibitor": "fastswing_inhibitor",
}
SWING = """
import rclpy
from rclpy.action import ActionClient
from fastswing_msgs.action import ExecuteSwing
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI

rclpy.init()
node = rclpy.create_node("task")
robot = load_robot(MUSASHI)
goal = ExecuteSwing.Goal(
    start_position=robot.postures["start"].tolist(),
    end_position=robot.postures["end"].tolist(),
)
swings = ActionClient(node, ExecuteSwing, "execute_swing")
assert swings.wait_for_server(60.0), "no executor"
while True:
    goal.stamp = node.get_clock().now().to_msg()
    sent = swings.send_goal_async(goal)
    rclpy.spin_until_future_complete(node, sent)
    answer = sent.result().get_result_async()
    rclpy.spin_until_future_complete(node, answer)
    result = answer.result().result
    if result.error_code != -40:  # NOT_READY: the executor has not found everyone yet
        break
print("ended with", result.error_code, result.error_string)
"""
LISTEN = f"""
import time
import rclpy
from sensor_msgs.msg import JointState
from fastswing_msgs.msg import LengthCommand

rclpy.init()
node = rclpy.create_node("stranger")
heard = []
node.create_subscription(JointState, "joint_states", heard.append, 1)
command = node.create_publisher(LengthCommand, "length_command", 1)
deadline = time.monotonic() + {SILENCE_SEC}
listeners = 0
while time.monotonic() < deadline:
    rclpy.spin_once(node, timeout_sec=0.1)
    listeners = max(listeners, command.get_subscription_count())
    command.publish(LengthCommand())
print("heard", len(heard) > 0, "listeners", listeners)
"""


class SecuredSuite:
    """The suite's nodes, each with the keys of its enclave."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.domain = free_domain()
        self.keystore = folder / "keystore"
        make_keystore(self.keystore, KeystoreRequest(domain=self.domain))
        self.processes: list[Process] = []
        self._bus = f"udp://127.0.0.1:{free_udp_port()}"
        self.open_environment = isolated_environment(self.domain)
        self.environment = {
            **self.open_environment,
            "ROS_SECURITY_ENABLE": "true",
            "ROS_SECURITY_STRATEGY": "Enforce",
            "ROS_SECURITY_KEYSTORE": str(self.keystore),
        }

    def start(self, name: str, enclave: str = "") -> Process:
        """Start a node with its own enclave, or another one."""
        bus = {"bus_url": self._bus} if PACKAGES[name] == "musashi_muscle_bridge" else {}
        process = Process(
            PACKAGES[name],
            name,
            bus,
            self.environment,
            self.folder / f"{name}.log",
            ros_arguments=["--enclave", enclave or f"/{name}"],
        )
        self.processes.append(process)
        return process

    def wait_until_active(self, process: Process) -> None:
        """Wait for the node's own word; fails if it ends."""
        deadline = time.monotonic() + TIMEOUT_SEC
        while ": active" not in process.log_tail():
            assert process.running, process.log_tail()
            assert time.monotonic() < deadline, process.log_tail()
            time.sleep(0.05)

    def start_all(self) -> None:
        """Start everything that a swing needs."""
        for process in [self.start(name) for name in PACKAGES]:
            self.wait_until_active(process)

    def run(self, program: str, enclave: str = "") -> str:
        """Return what a Python program prints; without an enclave it has no keys."""
        arguments = ["--ros-args", "--enclave", enclave] if enclave else []
        run = subprocess.run(
            [sys.executable, "-c", program, *arguments],
            env=self.environment if enclave else self.open_environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=3 * TIMEOUT_SEC,
        )
        return run.stdout

    def close(self) -> None:
        stop_all(self.processes, TIMEOUT_SEC)


@pytest.fixture
def secured(tmp_path: Path) -> Iterator[SecuredSuite]:
    suite = SecuredSuite(tmp_path)
    yield suite
    suite.close()


@pytest.fixture(scope="module")
def has_plugins(tmp_path_factory: pytest.TempPathFactory) -> bool:
    """Ask the middleware itself, by starting a node with valid keys."""
    suite = SecuredSuite(tmp_path_factory.mktemp("probe"))
    try:
        return NO_PLUGINS not in suite.run(
            "import rclpy; rclpy.init(); rclpy.create_node('task')", "/task"
        )
    finally:
        suite.close()


@pytest.fixture
def plugins(has_plugins: bool) -> None:
    if not has_plugins:
        pytest.skip(f"{NO_PLUGINS} (the Python wheels' is built without)")


@pytest.fixture
def no_plugins(has_plugins: bool) -> None:
    if has_plugins:
        pytest.skip("this Fast DDS has its security plug-ins")


# Without the plug-ins: refuse, never run in the open.


@pytest.mark.parametrize("name", PACKAGES)
def test_without_the_plugins_a_node_that_must_be_secure_does_not_start(
    secured: SecuredSuite, no_plugins: None, name: str
) -> None:
    assert secured.start(name).wait(TIMEOUT_SEC) == 2


def test_without_the_plugins_a_node_says_why_it_does_not_start(
    secured: SecuredSuite, no_plugins: None
) -> None:
    process = secured.start("bridge")
    process.wait(TIMEOUT_SEC)
    assert NO_PLUGINS in process.log.read_text()


def test_the_wheels_fast_dds_holds_no_authentication_plugin(no_plugins: None) -> None:
    folders = os.environ["LD_LIBRARY_PATH"].split(":")
    libraries = [path for folder in folders for path in Path(folder).glob("libfastrtps.so*")]
    assert libraries
    assert not any(b"PKI-DH" in path.read_bytes() for path in libraries)


# With and without the plug-ins.


def test_a_node_without_an_enclave_in_the_keystore_does_not_start(secured: SecuredSuite) -> None:
    assert secured.start("bridge", "/nobody").wait(TIMEOUT_SEC) == 2


def test_a_missing_enclave_is_named(secured: SecuredSuite) -> None:
    process = secured.start("bridge", "/nobody")
    process.wait(TIMEOUT_SEC)
    assert "nobody" in process.log.read_text()


def test_a_refusal_to_start_shows_no_traceback(secured: SecuredSuite) -> None:
    process = secured.start("bridge", "/nobody")
    process.wait(TIMEOUT_SEC)
    assert "Traceback" not in process.log.read_text()


def test_without_a_keystore_a_node_that_must_be_secure_does_not_start(
    secured: SecuredSuite,
) -> None:
    shutil.rmtree(secured.keystore)
    assert secured.start("bridge").wait(TIMEOUT_SEC) == 2


# With the plug-ins.


def test_the_secured_suite_swings_the_arm(secured: SecuredSuite, plugins: None) -> None:
    secured.start_all()
    output = secured.run(SWING, "/task")
    assert "ended with 0" in output, output


@pytest.mark.parametrize("name", ["cert.pem", "permissions.p7s", "governance.p7s"])
def test_one_tampered_byte_stops_a_node_from_starting(
    secured: SecuredSuite, plugins: None, name: str
) -> None:
    path = secured.keystore / "enclaves/bridge" / name
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert secured.start("bridge").wait(TIMEOUT_SEC) == 2


def test_a_stranger_without_keys_neither_hears_nor_reaches_the_bridge(
    secured: SecuredSuite, plugins: None
) -> None:
    for name in ("mock_driver", "bridge"):
        secured.wait_until_active(secured.start(name))
    output = secured.run(LISTEN)
    assert "heard False listeners 0" in output, output


def test_keys_of_another_keystore_open_nothing(secured: SecuredSuite, plugins: None) -> None:
    for name in ("mock_driver", "bridge"):
        secured.wait_until_active(secured.start(name))
    make_keystore(secured.keystore, KeystoreRequest(domain=secured.domain), replace=True)
    output = secured.run(
        "import rclpy, time; rclpy.init(); node = rclpy.create_node('task'); "
        f"time.sleep({SILENCE_SEC}); print('found', node.count_publishers('joint_states'))",
        "/task",
    )
    assert "found 0" in output, output


def test_task_code_cannot_command_a_muscle(secured: SecuredSuite, plugins: None) -> None:
    output = secured.run(
        "import rclpy; from fastswing_msgs.msg import LengthCommand; rclpy.init(); "
        "node = rclpy.create_node('task'); "
        "node.create_publisher(LengthCommand, 'length_command', 1); print('permitted')",
        "/task",
    )
    assert "permitted" not in output, output


def test_keys_hold_in_their_own_domain_alone(secured: SecuredSuite, plugins: None) -> None:
    secured.environment["ROS_DOMAIN_ID"] = str(secured.domain % 99 + 1)
    assert secured.start("bridge").wait(TIMEOUT_SEC) == 2


# The programs above do what they say: without security they swing, hear and reach.


def test_in_the_open_the_same_stranger_hears_and_reaches_the_bridge(
    secured: SecuredSuite,
) -> None:
    secured.environment = secured.open_environment
    for name in ("mock_driver", "bridge"):
        secured.wait_until_active(secured.start(name))
    output = secured.run(LISTEN)
    assert "heard True listeners 1" in output, output


def test_in_the_open_the_same_task_code_swings_the_arm(secured: SecuredSuite) -> None:
    secured.environment = secured.open_environment
    secured.start_all()
    output = secured.run(SWING, "/task")
    assert "ended with 0" in output, output
