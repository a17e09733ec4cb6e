"""The bridge's control thread goes on whatever is asked of the node, and may only read."""

import signal
import time
from typing import TYPE_CHECKING

import pytest
from lifecycle_msgs.msg import State
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.task import Future
from std_srvs.srv import Trigger

from fastswing_msgs.msg import LengthCommand, MuscleState

if TYPE_CHECKING:
    from test.conftest import Suite

pytestmark = pytest.mark.system

WINDOW_SEC = 6.0
PENDING = 20
"""Requests under way at once."""


def counted(suite: "Suite", key: str) -> int:
    return int(suite.reported("bridge", key) or 0)


class Window:
    """Shares of the bridge's periods in some seconds: late ones, and ones without an answer."""

    def __init__(self, suite: "Suite", hammer: bool) -> None:
        self._suite = suite
        self._pending: list[Future] = []
        self._command = suite.node.create_publisher(LengthCommand, "length_command", 10)
        self._hold = suite.node.create_client(Trigger, "hold_posture")
        self._set = suite.node.create_client(SetParameters, "bridge/set_parameters")
        suite.until("the services", lambda: self._hold.service_is_ready())
        suite.until("the parameters", lambda: self._set.service_is_ready())
        suite.until("the topic", lambda: self._command.get_subscription_count() >= 1)
        before, began = self._counts(), time.monotonic()
        end = time.monotonic() + WINDOW_SEC
        while time.monotonic() < end:
            if hammer:
                self._strike()
            suite._executor.spin_once(timeout_sec=0.0 if hammer else 0.02)
        self.answered = sum(future.done() for future in self._pending)
        after, ended = self._counts(), time.monotonic()
        for client in (self._hold, self._set):
            suite.node.destroy_client(client)
        suite.node.destroy_publisher(self._command)
        periods = after["periods"] - before["periods"]
        self.rate = periods / (ended - began)

        self.late = (after["late_periods"] - before["late_periods"]) / periods

    def _counts(self) -> dict[str, int]:
        self._suite.diagnostics.pop("bridge", None)
        self._suite.until("diagnostics", lambda: "bridge" in self._suite.diagnostics)
        counts = {key: counted(self._suite, key) for key in ("replies", "misses", "late_periods")}
        return {**counts, "periods": counts["replies"] + counts["misses"]}

    def _strike(self) -> None:
        """Ask for a hold and a refused parameter, send a command that is rejected and logged."""
        self._command.publish(LengthCommand(name=["#9"], length=[float("nan")]))
        if sum(not future.done() for future in self._pending[-2 * PENDING :]) > PENDING:
            return
        change = ParameterMessage(
            name="control_rate", value=ParameterValue(type=3, double_value=10.0)
        )
        self._pending.append(self._hold.call_async(Trigger.Request()))
        self._pending.append(self._set.call_async(SetParameters.Request(parameters=[change])))


@pytest.fixture(scope="module")
def windows(bridge_and_mock: "Suite") -> dict[str, Window]:
    """Measure an idle bridge and one that is asked without pause."""
    bridge_and_mock.hold()
    return {"idle": Window(bridge_and_mock, False), "hammered": Window(bridge_and_mock, True)}


def test_the_bridge_answers_while_it_is_hammered(windows: dict[str, Window]) -> None:
    assert windows["hammered"].answered > 100


def test_a_hammered_bridge_goes_on_at_its_rate(windows: dict[str, Window]) -> None:
    assert windows["hammered"].rate > 0.7 * windows["idle"].rate


def test_a_hammered_bridge_is_hardly_later_than_an_idle_one(windows: dict[str, Window]) -> None:
    # Of 3,000 periods; what the other processes on this machine take is in both.
    assert windows["hammered"].late < 5.0 * windows["idle"].late + 0.15


def test_a_hammered_bridge_loses_no_boards(
    bridge_and_mock: "Suite", windows: dict[str, Window]
) -> None:
    assert windows["hammered"].rate > 0
    assert bridge_and_mock.reported("bridge", "lost") == ""


@pytest.mark.parametrize(
    "key",
    ["rate_hz", "period_jitter_ms", "overruns", "round_trip_ms", "misses_in_a_row", "success_rate"],
)
def test_the_diagnostics_tell_how_the_loop_runs(bridge_and_mock: "Suite", key: str) -> None:
    bridge_and_mock.until(key, lambda: bridge_and_mock.reported("bridge", key) != "")
    float(bridge_and_mock.reported("bridge", key))


def test_a_publisher_beside_another_one_is_an_error_and_its_topic_is_named(
    bridge_and_mock: "Suite",
) -> None:
    node = bridge_and_mock.node
    bridge_and_mock.hold()
    two = [node.create_publisher(LengthCommand, "length_command", 10) for _ in range(2)]
    bridge_and_mock.until(
        "the error",
        lambda: bridge_and_mock.diagnostics["bridge"].message == "two publishers on length_command",
    )
    command = LengthCommand(name=["#9"], length=[10.0])

    def stamped() -> LengthCommand:
        command.header = bridge_and_mock.now()
        return command

    bridge_and_mock.publish_until(
        two[0],
        stamped,
        "a count",
        lambda: counted(bridge_and_mock, "contested_length_command") > 0,
    )
    for publisher in two:
        node.destroy_publisher(publisher)


# Read only.


@pytest.fixture
def reading(world: "Suite") -> "Suite":
    """Let a bridge that may only read watch an arm that nobody commanded yet."""
    world.start_active("mock_driver")
    world.start("bridge", read_only=True)
    world.wait_for_state("bridge", State.PRIMARY_STATE_ACTIVE)
    world.fresh_muscles()
    return world


def test_a_read_only_bridge_publishes_states_and_energises_nothing(reading: "Suite") -> None:
    reading.let_states_pass()
    assert set(reading.fresh_muscles().mode) == {MuscleState.MODE_ZERO_CURRENT}


def test_a_read_only_bridge_says_so(reading: "Suite") -> None:
    reading.until(
        "its word", lambda: getattr(reading.diagnostics.get("bridge"), "message", "") == "read only"
    )


def test_a_read_only_bridge_listens_to_no_command(reading: "Suite") -> None:
    assert reading.node.count_subscribers("length_command") == 1  # this test's own


def test_the_end_of_a_read_only_bridge_trips_no_watchdog(reading: "Suite") -> None:
    reading.processes["bridge"].send(signal.SIGTERM)
    assert reading.processes["bridge"].wait(60.0) == 0
    reading.diagnostics.clear()
    reading.until("diagnostics", lambda: "mock_driver" in reading.diagnostics)
    assert reading.reported("mock_driver", "faulty_boards") == "0"


def test_a_bridge_that_commands_takes_the_boards_from_one_that_reads(reading: "Suite") -> None:
    reading.start_another("bridge")
    reading.until(
        "the reader's frames to be refused",
        lambda: int(reading.reported("mock_driver", "refused_foreign") or 0) > 0,
    )
