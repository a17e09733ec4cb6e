"""The table of policies permits exactly what the running nodes open: names as DDS has them."""

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rclpy
from dds_names import (
    DISCOVERY_TOPIC,
    EVERY_PARTICIPANT,
    Access,
    access_of,
    enclave_access,
)
from policy_table import (
    CLOCK,
    COMMAND_LINE,
    COMMANDS,
    ENCLAVES,
    NODES,
    PLANNER_CLIENT,
    TASK,
    WATCHED,
    Policy,
)
from processes import (
    Process,
    free_domain,
    free_udp_port,
    isolated_environment,
    stop_all,
)
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from fastswing_msgs.action import ExecuteSwing
from fastswing_msgs.msg import LengthCommand
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.client import PlannerClient
from fastswing_planner.nodes.recorded_topics import TYPES, message_class

ROOT = Path(__file__).parents[2]

NAMESPACE = "/left"
EXECUTABLES = {
    "mock_driver": ("musashi_muscle_bridge", "mock_driver"),
    "bridge": ("musashi_muscle_bridge", "bridge"),
    "planner": ("fastswing_planner", "planner"),
    "swing_executor": ("fastswing_planner", "swing_executor"),
    "inhibitor": ("fastswing_inhibitor", "inhibitor"),
    "monitor": ("musashi_muscle_bridge", "monitor"),
    "show_arm": ("musashi_muscle_bridge", "show_arm"),
    "recorder": ("fastswing_planner", "record"),
}
IN_A_TERMINAL = (sys.executable, "-c", "import pty, sys; pty.spawn(sys.argv[1:])")
TIMEOUT_SEC = 60.0
SETTLED_SEC = 2.0
NOTHING = Access(frozenset(), frozenset())


class Observer:
    """Reads from a domain's node graph what each node opens."""

    def __init__(self, domain: int) -> None:
        """Join a domain as a `ros2` command would."""
        self._context = rclpy.Context()
        rclpy.init(
            context=self._context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self._joined: list[Node] = []
        self.node = self.join("_ros2cli_1", enable_rosout=False, start_parameter_services=False)

    def join(self, name: str, **options: bool) -> Node:
        """Return another node of this process."""
        node = Node(
            name,
            namespace=NAMESPACE,
            context=self._context,
            use_global_arguments=False,
            **options,
        )
        self._joined.append(node)
        return node

    def close(self) -> None:
        """Leave the domain."""
        for node in self._joined:
            node.destroy_node()
        rclpy.shutdown(context=self._context)

    def opened(self, node: str) -> Access:
        """Return what is known now of a node."""
        if (node, NAMESPACE) not in self.node.get_node_names_and_namespaces():
            return NOTHING
        written = self.node.get_publisher_names_and_types_by_node(node, NAMESPACE, True)
        read = self.node.get_subscriber_names_and_types_by_node(node, NAMESPACE, True)
        return Access(
            frozenset(name for name, _ in written),
            frozenset(name for name, _ in read),
        )

    def dds_topics(self) -> set[str]:
        """Return every DDS topic in the domain."""
        return {name for name, _ in self.node.get_topic_names_and_types(no_demangle=True)}

    def settled(self, node: str, expected: Access) -> Access:
        """Return what a node opens, once it is all there and has not changed for a while."""
        deadline = time.monotonic() + TIMEOUT_SEC
        seen, since = NOTHING, time.monotonic()
        while time.monotonic() < deadline:
            now = self.opened(node)
            if now != seen:
                seen, since = now, time.monotonic()
            complete = expected.publish <= now.publish and expected.subscribe <= now.subscribe
            if complete and time.monotonic() - since > SETTLED_SEC:
                break
            time.sleep(0.05)
        return seen


class Fleet:
    """The suite's nodes in a namespace, each a process, and an observer beside them."""

    def __init__(self, folder: Path) -> None:
        self.domain = free_domain()
        self.observer = Observer(self.domain)
        self.processes: list[Process] = []
        self._folder = folder
        self._bus = f"udp://127.0.0.1:{free_udp_port()}"
        self._seen: dict[str, Access] = {}

    def opened(self, policy: Policy) -> Access:
        """Return what a node opens; it is looked at once."""
        if policy.node not in self._seen:
            permitted = access_of(policy, NAMESPACE)
            self._seen[policy.node] = self.observer.settled(policy.node, permitted)
        return self._seen[policy.node]

    def start(self, node: str, *ros_arguments: str) -> None:
        package, name = EXECUTABLES[node]
        parameters: dict[str, object] = {}
        if node == "recorder":
            parameters = {"output": self._folder / "bag.mcap"}
        elif node in ("bridge", "mock_driver"):
            parameters = {"bus_url": self._bus}
        environment = {**isolated_environment(self.domain), "TERM": "xterm"}
        self.processes.append(
            Process(
                package,
                name,
                parameters,
                environment,
                self._folder / f"{node}.log",
                ros_arguments=["-r", f"__ns:={NAMESPACE}", *ros_arguments],
                prefix=IN_A_TERMINAL if node == "monitor" else (),
            )
        )

    def close(self) -> None:
        stop_all(self.processes, TIMEOUT_SEC)
        self.observer.close()


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fleet]:
    started = Fleet(tmp_path_factory.mktemp("fleet"))
    try:
        for policy in NODES:
            started.start(policy.node)
        yield started
    finally:
        started.close()


@pytest.fixture
def simulated(tmp_path: Path) -> Iterator[Fleet]:
    """Start a planner on simulated time."""
    started = Fleet(tmp_path)
    try:
        started.start("planner", "-p", "use_sim_time:=true")
        yield started
    finally:
        started.close()


@pytest.fixture
def observer() -> Iterator[Observer]:
    made = Observer(free_domain())
    yield made
    made.close()


@pytest.fixture(params=NODES, ids=lambda policy: policy.node)
def policy(request: pytest.FixtureRequest) -> Policy:
    found: Policy = request.param
    return found


# The table beside the running nodes.


def test_a_node_opens_nothing_that_the_table_does_not_permit(fleet: Fleet, policy: Policy) -> None:
    permitted = access_of(policy, NAMESPACE)
    opened = fleet.opened(policy)
    assert (opened.publish - permitted.publish, opened.subscribe - permitted.subscribe) == (
        frozenset(),
        frozenset(),
    )


def test_a_node_is_permitted_nothing_that_it_does_not_open(fleet: Fleet, policy: Policy) -> None:
    permitted = access_of(policy, NAMESPACE)
    opened = fleet.opened(policy)
    assert (permitted.publish - opened.publish, permitted.subscribe - opened.subscribe) == (
        frozenset(),
        frozenset(),
    )


def test_every_dds_topic_of_the_domain_is_in_the_table(fleet: Fleet) -> None:
    for policy in NODES:
        fleet.opened(policy)
    known = enclave_access([*NODES, COMMAND_LINE], NAMESPACE)
    own = access_of(Policy("_ros2cli_1", serves=("~/get_type_description",)), NAMESPACE)
    permitted = known.publish | known.subscribe | own.publish | own.subscribe
    assert fleet.observer.dds_topics() - permitted == set()


def test_participants_exchange_the_discovery_topic(fleet: Fleet) -> None:
    assert DISCOVERY_TOPIC in fleet.observer.dds_topics()


def test_on_simulated_time_a_node_reads_the_clock_and_nothing_else_more(simulated: Fleet) -> None:
    (planner,) = (policy for policy in NODES if policy.node == "planner")
    permitted = access_of(planner, NAMESPACE, sim_time=True)
    assert simulated.observer.settled("planner", permitted) == permitted


def test_the_planner_client_opens_exactly_what_the_table_says(
    observer: Observer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(observer.node.context.get_domain_id()))
    permitted = access_of(PLANNER_CLIENT, NAMESPACE)
    with PlannerClient(namespace=NAMESPACE):
        assert observer.settled(PLANNER_CLIENT.node, permitted) == permitted


def connect_task(node: Node) -> ActionClient:
    """Open what the table lets task code open; return what would vanish if nobody kept it."""
    for name in (*WATCHED, "/diagnostics"):
        kind = message_class(TYPES[name.lstrip("/")])
        node.create_subscription(kind, name, lambda _message: None, 1)
    for name in ("emergency_stop", "hold_posture"):
        node.create_client(Trigger, name)
    node.create_client(PlanSwing, "plan_swing")
    return ActionClient(node, ExecuteSwing, "execute_swing")


def test_task_code_that_watches_plans_and_swings_stays_within_the_table(
    observer: Observer,
) -> None:
    swings = connect_task(observer.join("task"))
    permitted = access_of(TASK, NAMESPACE)
    assert observer.settled("task", permitted) == permitted
    swings.destroy()


def test_a_publisher_beyond_the_table_is_noticed(observer: Observer) -> None:
    task = observer.join("task")
    swings = connect_task(task)
    task.create_publisher(LengthCommand, "length_command", 1)
    permitted = access_of(TASK, NAMESPACE)
    opened = observer.settled("task", permitted)
    assert opened.publish - permitted.publish == {"rt/left/length_command"}
    swings.destroy()


# What the table says, without a node.


def enclaves_that(topic: str, way: Callable[[Access], frozenset[str]]) -> set[str]:
    """Return the enclaves that may write or read a DDS topic."""
    return {name for name, policies in ENCLAVES.items() if topic in way(enclave_access(policies))}


@pytest.mark.parametrize("command", COMMANDS)
def test_only_the_bridge_reads_commands_to_act_on_them(command: str) -> None:
    readers = enclaves_that(f"rt/{command}", lambda access: access.subscribe)
    # The executor reads its own, to notice somebody else's; the monitor shows overrides.
    listening = {"length_command": {"swing_executor"}, "current_override": {"monitor"}}
    assert readers == {"bridge", "recorder", "operator"} | listening.get(command, set())


@pytest.mark.parametrize(
    ("topic", "writers"),
    [
        ("rt/length_command", {"swing_executor"}),
        ("rt/current_override", {"inhibitor"}),
        ("rt/tension_command", set()),
        ("rt/current_command", set()),
        ("rt/joint_states", {"bridge"}),
        ("rt/muscle_state", {"bridge"}),
        ("rq/arm_inhibitorRequest", {"swing_executor"}),
        ("rq/clear_faultsRequest", {"operator", "monitor"}),
        ("rq/execute_swing/_action/send_goalRequest", {"task"}),
        ("rr/emergency_stopReply", {"bridge"}),
    ],
)
def test_what_moves_the_arm_has_no_other_writer(topic: str, writers: set[str]) -> None:
    assert enclaves_that(topic, lambda access: access.publish) == writers


@pytest.mark.parametrize("enclave", ["task", "operator", "monitor"])
def test_task_code_operator_and_monitor_can_stop_the_arm(enclave: str) -> None:
    assert {"rq/emergency_stopRequest", "rq/hold_postureRequest"} <= (
        enclave_access(ENCLAVES[enclave]).publish
    )


def test_the_recorder_writes_no_topic_of_the_robot() -> None:
    own = {"rt/rosout", "rt/parameter_events", "rt/diagnostics", "rt/recorder/transition_event"}
    written = enclave_access(ENCLAVES["recorder"]).publish - EVERY_PARTICIPANT.publish
    assert {name for name in written if name.startswith("rt/")} == own


def test_no_enclave_of_one_arm_reaches_a_service_of_another() -> None:
    left = frozenset().union(
        *(enclave_access(policies, "/left").publish for policies in ENCLAVES.values())
    )
    right = frozenset().union(
        *(enclave_access(policies, "/right").publish for policies in ENCLAVES.values())
    )
    assert left & right == {
        DISCOVERY_TOPIC,
        "rt/rosout",
        "rt/parameter_events",
        "rt/diagnostics",
    }


def test_simulated_time_is_permitted_only_when_asked_for() -> None:
    for policies in ENCLAVES.values():
        assert f"rt{CLOCK}" not in enclave_access(policies).subscribe
