"""Two arms in one ROS domain, each launched into a namespace: neither notices the other."""

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from ament_index_python.packages import get_package_share_directory
from lifecycle_msgs.msg import State
from processes import free_udp_port

from fastswing_msgs.msg import CurrentOverride, ErrorCode, LengthCommand, MuscleState, SwingOptions
from fastswing_planner.bags import open_bag

if TYPE_CHECKING:
    from test.system.suite import Suite


LAUNCH = Path(get_package_share_directory("musashi_muscle_bridge")) / "launch/mock.launch.xml"
NODES = ("mock_driver", "bridge", "planner", "swing_executor", "inhibitor", "show_arm")
# Twelve nodes share the machine, and stalls are not what is tried here.
PATIENCE = {
    "bridge": {"watchdog_timeout": 0.5},
    "swing_executor": {"state_timeout": 0.5},
    "inhibitor": {"state_timeout": 0.5, "lease": 0.2},
}
RATE = "200.0"
# Of ROS itself or, by convention, of all robots together.
SHARED = {"/diagnostics", "/parameter_events", "/rosout"}
STILL_RAD = 0.02


class Arm:
    """One of the two, and what is said on its command topics."""

    def __init__(self, suite: "Suite") -> None:
        self.suite = suite
        self.lengths: list[LengthCommand] = []
        self.overridden: list[CurrentOverride] = []
        suite.node.create_subscription(LengthCommand, "length_command", self.lengths.append, 100)
        suite.node.create_subscription(
            CurrentOverride, "current_override", self.overridden.append, 100
        )

    def come_up(self) -> None:
        for name in NODES:
            self.suite.wait_for_state(name, State.PRIMARY_STATE_ACTIVE)
        self.suite.hold()
        self.suite.wait_until_swings_are_judged()

    def modes(self) -> set[int]:
        return set(self.suite.fresh_muscles().mode)


@pytest.fixture(scope="module")
def arms(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Arm, Arm]]:
    from test.system.suite import Suite

    suites: list[Suite] = []
    try:
        for side in ("left", "right"):
            domain = suites[0].domain if suites else None
            suite = Suite(tmp_path_factory.mktemp(side), f"/{side}", domain)
            suites.append(suite)
            bus = f"udp://127.0.0.1:{free_udp_port()}"
            values = {"namespace": f"/{side}", "bus_url": bus, "control_rate": RATE}
            suite.launch(LAUNCH, PATIENCE, **values)
        left, right = map(Arm, suites)
        left.come_up()
        right.come_up()
        yield left, right
    finally:
        for suite in suites:
            suite.close()


def test_every_topic_and_service_is_in_the_namespace_of_its_arm(arms: tuple[Arm, Arm]) -> None:
    node = arms[0].suite.node

    def names(side: str) -> set[str]:
        found = dict([*node.get_topic_names_and_types(), *node.get_service_names_and_types()])
        assert {name for name in found if not name.startswith(("/left/", "/right/"))} == SHARED
        return {name.removeprefix(side) for name in found if name.startswith(side)}

    arms[0].suite.until("the same names on both sides", lambda: names("/left") == names("/right"))
    assert {"/muscle_state", "/plan_swing", "/execute_swing/_action/send_goal"} <= names("/left")


def test_diagnostics_name_the_arm(arms: tuple[Arm, Arm]) -> None:
    suite = arms[0].suite
    wanted = {f"{side}/{name}" for side in ("left", "right") for name in NODES}
    suite.until("twelve nodes in /diagnostics", lambda: wanted <= suite.diagnostics.keys())
    assert suite.diagnostics.keys() == wanted


def test_a_swing_on_the_left_leaves_the_right_arm_held_where_it_is(arms: tuple[Arm, Arm]) -> None:
    left, right = arms
    before = right.suite.fresh_posture()
    said = len(right.lengths), len(right.overridden)
    options = SwingOptions(method=SwingOptions.METHOD_INHIBIT)
    result = left.suite.execute(left.suite.goal(options=options))
    assert (result.error_code, result.error_string) == (ErrorCode.SUCCESS, "")
    assert any(message.name for message in left.overridden)
    assert float(np.abs(right.suite.fresh_posture() - before).max()) < STILL_RAD
    assert right.modes() == {MuscleState.MODE_LENGTH}
    assert (len(right.lengths), len(right.overridden)) == said


def test_no_bridge_believes_that_two_nodes_command_its_arm(arms: tuple[Arm, Arm]) -> None:
    suite = arms[0].suite
    suite.diagnostics.clear()
    bridges = {"left/bridge", "right/bridge"}
    suite.until("diagnostics after the swing", lambda: bridges <= suite.diagnostics.keys())
    told = {row.key for name in bridges for row in suite.diagnostics[name].values}
    assert "rate_hz" in told
    assert {key for key in told if key.startswith("contested")} == set()


def test_a_recorder_in_a_namespace_records_that_arm(arms: tuple[Arm, Arm], tmp_path: Path) -> None:
    left, _ = arms
    suite = left.suite
    recorder = suite.start("record", output=tmp_path / "left.mcap")
    suite.wait_for_state("record", State.PRIMARY_STATE_ACTIVE)
    # Discovery takes the recorder as long as it likes, whatever this test's own node hears.
    states = "messages /left/muscle_state"
    suite.until("recorded states", lambda: suite.reported("left/recorder", states) not in ("", "0"))
    recorder.send(signal.SIGINT)
    assert recorder.wait(30.0) == 0
    del suite.processes["record"]
    topics = open_bag(tmp_path / "left.mcap").topics
    assert topics["/left/muscle_state"].message_count > 0
    assert {name for name in topics if not name.startswith("/left/")} <= {"/diagnostics"}


def test_an_emergency_stop_on_the_left_stops_the_left_arm_alone(arms: tuple[Arm, Arm]) -> None:
    left, right = arms
    left.suite.trigger("emergency_stop")
    left.suite.wait_for_modes(MuscleState.MODE_ZERO_CURRENT)
    right.suite.let_states_pass()
    assert right.modes() == {MuscleState.MODE_LENGTH}
    assert not any(right.suite.fresh_muscles().fault)
