"""The bridge's control loop goes on whatever is asked of the node, and may only read."""

import signal
import time
from dataclasses import dataclass
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
    from test.system.suite import Suite


RATE_HZ = 500.0
COUNTED_WITHIN = 2.0
"""Periods: the present one has begun, and may be late."""
ROUNDS = 3
ROUND_SEC = 3.0
PAUSE_SEC = 0.003
"""Between two blows: a few hundred requests and commands per second, and some of this CPU's time
left for the boards, whose answers the bridge waits for."""
PENDING = 20
"""Requests under way at once."""


def counted(suite: "Suite", key: str) -> int:
    return int(suite.reported("bridge", key) or 0)


class Tally:
    """Periods of the bridge, and late ones among them."""

    def __init__(self) -> None:
        self.periods = 0
        self.late = 0

    @property
    def late_share(self) -> float:
        return self.late / self.periods


class Hammer:
    """Asks the bridge for all it has, again and again."""

    def __init__(self, suite: "Suite") -> None:
        self._suite = suite
        self._pending: list[Future] = []
        self._command = suite.node.create_publisher(LengthCommand, "length_command", 10)
        self._hold = suite.node.create_client(Trigger, "hold_posture")
        self._set = suite.node.create_client(SetParameters, "bridge/set_parameters")
        suite.until("the services", self._hold.service_is_ready)
        suite.until("the parameters", self._set.service_is_ready)
        suite.until("the topic", lambda: self._command.get_subscription_count() >= 1)

    @property
    def answered(self) -> int:
        return sum(future.done() for future in self._pending)

    def strike(self) -> None:
        """Ask for a hold and a refused parameter, send a command that is rejected and logged."""
        self._command.publish(LengthCommand(name=["#9"], length=[float("nan")]))
        if sum(not future.done() for future in self._pending[-2 * PENDING :]) > PENDING:
            return
        change = ParameterMessage(
            name="control_rate", value=ParameterValue(type=3, double_value=10.0)
        )
        self._pending.append(self._hold.call_async(Trigger.Request()))
        self._pending.append(self._set.call_async(SetParameters.Request(parameters=[change])))

    def count(self, tally: Tally, strike: bool) -> None:
        """Add some seconds, with blows or without, to a tally."""
        before, began = self._counts(), time.monotonic()
        while time.monotonic() < began + ROUND_SEC:
            if strike:
                self.strike()
            self._suite._executor.spin_once(timeout_sec=PAUSE_SEC)
        after = self._counts()
        tally.periods += after[0] - before[0]
        tally.late += after[1] - before[1]

    def _counts(self) -> tuple[int, int]:
        suite = self._suite
        suite.diagnostics.pop("bridge", None)
        suite.until("diagnostics", lambda: "bridge" in suite.diagnostics)
        periods = counted(suite, "replies") + counted(suite, "misses")
        return periods, counted(suite, "late_periods")

    def close(self) -> None:
        self._suite.node.destroy_client(self._hold)
        self._suite.node.destroy_client(self._set)
        self._suite.node.destroy_publisher(self._command)


@dataclass
class Comparison:
    """A bridge that is left alone, and one that is hammered, taken in turns."""

    alone: Tally
    hammered: Tally
    answered: int


@pytest.fixture(scope="module")
def comparison(bridge_and_mock: "Suite") -> Comparison:
    bridge_and_mock.hold()
    hammer = Hammer(bridge_and_mock)
    alone, hammered = Tally(), Tally()
    for _ in range(ROUNDS):
        hammer.count(alone, strike=False)
        hammer.count(hammered, strike=True)
    hammer.close()
    return Comparison(alone, hammered, hammer.answered)


def test_the_bridge_answers_while_it_is_hammered(comparison: Comparison) -> None:
    assert comparison.answered > 100


def test_every_period_of_a_hammered_bridge_sends_a_frame_or_is_counted(
    comparison: Comparison, bridge_and_mock: "Suite"
) -> None:
    def all_counted() -> bool:
        keys = ("replies", "misses", "unsupervised_periods", "overruns")
        periods = float(bridge_and_mock.reported("bridge", "running_s") or 0.0) * RATE_HZ
        found = sum(counted(bridge_and_mock, key) for key in keys)
        return periods > 0.0 and abs(periods - found) < COUNTED_WITHIN

    # A period that this machine swallowed is counted when the next one begins.
    bridge_and_mock.until("the counts", all_counted)


def test_a_hammered_bridge_is_hardly_later_than_one_that_is_left_alone(
    comparison: Comparison,
) -> None:
    # What other processes take of this machine is in both; a hammer that could hold up the control
    # loop would make most periods late.
    assert comparison.hammered.late_share < 2.0 * comparison.alone.late_share + 0.2


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
