"""Task code asks the planner by plain calls: names and angles in, plans and exceptions out."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import rclpy
from processes import free_domain, isolated_environment
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from fastswing_planner import client as client_module
from fastswing_planner.client import PlannerClient
from fastswing_planner.errors import (
    HoldingInfeasible,
    InvalidLimit,
    InvalidTensionRange,
    InvalidWeight,
    NotFinite,
    OutOfRange,
    PlannerError,
    PlannerUnavailable,
    StartEqualsEnd,
    SwingBlocked,
    UnknownName,
    WrongLength,
)
from fastswing_planner.planning.mask_search import Verdict
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.request import Method, MuscleConstants, Search
from fastswing_planner.planning.swing import SwingSettings
from fastswing_planner.robot.muscle_model import Payload

if TYPE_CHECKING:
    from test.system.suite import Suite


START = {"S-p": -0.7475, "S-r": 0.0, "S-y": 0.0, "E-p": -1.9422, "E-y": 0.0}
END = {"S-p": -0.4108, "S-r": 0.0, "S-y": 0.0, "E-p": -0.5995, "E-y": 0.0}
TIMEOUT_SEC = 60.0


@pytest.fixture(scope="module")
def in_domain(lone_planner: "Suite") -> Iterator[None]:
    """Let new clients meet the planner."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(lone_planner.domain))
        yield


@pytest.fixture(scope="module")
def client(in_domain: None) -> Iterator[PlannerClient]:
    with PlannerClient(timeout_sec=TIMEOUT_SEC) as client:
        yield client


@pytest.fixture
def lonely_client(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., PlannerClient]]:
    """Build a client that no planner hears."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(free_domain()))
    clients: list[PlannerClient] = []

    def build(**arguments: Any) -> PlannerClient:
        clients.append(PlannerClient(**arguments))
        return clients[-1]

    yield build
    for client in clients:
        client.close()


def test_names_and_angles_are_enough(client: PlannerClient) -> None:
    plan = client.plan(START, END)
    assert (plan.method, plan.time_cost) == (Method.BASIC, pytest.approx(0.99))


def test_a_plan_comes_back_as_the_planner_made_it(client: PlannerClient) -> None:
    plan = client.plan(START, END, Method.ELONGATE, search=Search.EXHAUSTIVE)
    assert plan.muscles(plan.elongated) == ("#9",)
    assert plan.proven
    assert [trial.verdict for trial in plan.trials].count(Verdict.TAKEN) == 1


def test_the_order_of_the_names_does_not_matter(client: PlannerClient) -> None:
    turned = client.plan(dict(reversed(START.items())), END)
    assert turned.joint_names == tuple(START)
    assert turned.start.tolist() == list(START.values())


def test_options_reach_the_planner(client: PlannerClient) -> None:
    plan = client.plan(START, END, Method.INHIBIT, kept_muscles=["#9"], threshold=0.03)
    assert plan.muscles(plan.inhibited) == ("#3", "#10")


def test_a_comparison_has_an_outcome_for_each_method(client: PlannerClient) -> None:
    outcomes = client.compare(START, END)
    costs = {one.method: one.plan.time_cost for one in outcomes if one.plan is not None}
    assert costs == pytest.approx(dict(zip(Method, [0.99, 0.60, 0.78, 0.60], strict=True)))


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"threshold": np.nan}, NotFinite, "threshold is nan, expected a finite number"),
        (
            {"swing_weight": [1.0] * 4},
            WrongLength,
            "swing_weight has 4 values, expected none, 5 (the diagonal) or 25 (all of it, row by "
            "row)",
        ),
        (
            {"swing_weight": [0.0] * 5},
            InvalidWeight,
            "swing_weight is not positive definite: its eigenvalues reach from 0 to 0, the "
            "smallest must be above 1e-06 of the largest",
        ),
        (
            {"end": {**END, "E-p": 2.5}},
            OutOfRange,
            "end_position of E-p is 2.5000 rad, its range is -2.2000 to 0.1000 rad",
        ),
        (
            {"end": START},
            StartEqualsEnd,
            "start_position and end_position are the same (-0.7475, 0, 0, -1.9422, 0 rad): "
            "nothing to swing",
        ),
        (
            {"constants": MuscleConstants(["#9"], tension_min=[250.0])},
            InvalidTensionRange,
            "tension_max of #9 is 200 N, must be above its tension_min 250 N",
        ),
        (
            {"payload": Payload(50.0, "hand")},
            HoldingInfeasible,
            "the start posture cannot be held even with all muscles: 116 N m are missing; choose "
            "another start posture, less payload or a wider tension range",
        ),
    ],
)
def test_an_error_comes_back_as_its_own_class(
    client: PlannerClient, changes: dict[str, Any], error: type[PlannerError], text: str
) -> None:
    with pytest.raises(error) as caught:
        client.plan(**{"start": START, "end": END, **changes})
    assert (type(caught.value), str(caught.value)) == (error, text)


def test_a_comparison_of_what_the_arm_cannot_do_is_an_error(client: PlannerClient) -> None:
    with pytest.raises(SwingBlocked, match=r"^the swing stops short of its end after 5 steps: "):
        client.compare(START, END, settings=SwingSettings(max_steps=5))


def test_start_and_end_must_name_the_same_joints(client: PlannerClient) -> None:
    with pytest.raises(UnknownName) as caught:
        client.plan({**START, "W-p": 0.0}, END)
    assert str(caught.value) == "start and end name different joints: W-p"


@pytest.mark.parametrize(
    ("limit", "error", "text"),
    [
        (0.0, InvalidLimit, "search_time_limit is 0 s, must be positive"),
        (-5.0, InvalidLimit, "search_time_limit is -5 s, must be positive"),
        (np.nan, NotFinite, "search_time_limit is nan, expected a number of seconds"),
    ],
)
def test_a_time_limit_without_sense_is_refused_before_asking(
    lonely_client: Callable[..., PlannerClient],
    limit: float,
    error: type[PlannerError],
    text: str,
) -> None:
    with pytest.raises(error) as caught:
        lonely_client().plan(START, END, time_limit=limit)
    assert str(caught.value) == text


def test_without_a_planner_the_call_ends_in_time(
    lonely_client: Callable[..., PlannerClient],
) -> None:
    client = lonely_client(timeout_sec=1.0, namespace="left")
    began = time.monotonic()
    with pytest.raises(PlannerUnavailable) as caught:
        client.plan(START, END, time_limit=0.5)
    assert str(caught.value) == (
        "/left/plan_swing does not answer within 1.5 s: is the planner running?"
    )
    assert 1.4 < time.monotonic() - began < 30.0


def test_a_missing_planner_is_a_timeout(lonely_client: Callable[..., PlannerClient]) -> None:
    with pytest.raises(TimeoutError):
        lonely_client(timeout_sec=0.1).plan(START, END)


def test_an_answer_that_takes_longer_than_asking_again_still_arrives(
    client: PlannerClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client_module, "_ASK_AGAIN_SEC", 0.05)
    settings = SwingSettings(time_step=2e-3, max_steps=10_000)
    assert client.plan(START, END, settings=settings).time_cost == pytest.approx(0.98)


def test_asking_again_and_again_leaves_nothing_pending(client: PlannerClient) -> None:
    for _ in range(3):
        client.plan(START, END)
    assert client._client._pending_requests == {}


def test_a_callback_of_a_running_node_may_ask(in_domain: None) -> None:
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node("task", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    plans: list[SwingPlan] = []

    def on_timer() -> None:
        with PlannerClient(timeout_sec=TIMEOUT_SEC) as client:
            plans.append(client.plan(START, END))

    node.create_timer(0.01, on_timer)
    deadline = time.monotonic() + TIMEOUT_SEC
    while not plans and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)
    assert plans[0].time_cost == pytest.approx(0.99)


def test_a_closed_client_leaves_no_thread(in_domain: None) -> None:
    before = set(threading.enumerate())
    with PlannerClient(timeout_sec=TIMEOUT_SEC) as client:
        client.plan(START, END)
    assert set(threading.enumerate()) == before


def test_a_client_may_be_closed_twice(in_domain: None) -> None:
    client = PlannerClient()
    client.close()
    client.close()


PROGRAM = """
import rclpy
from fastswing_planner.client import PlannerClient
from fastswing_planner.planning.request import Method

rclpy.init()
node = rclpy.create_node("task")
with PlannerClient() as client:
    plan = client.plan({start}, {end}, Method.ELONGATE)
print(plan.muscles(plan.elongated), f"{{plan.time_cost:.2f}} s", node.get_name(), rclpy.ok())
again = PlannerClient()
print(f"{{again.plan({start}, {end}).time_cost:.2f}} s")
"""


def test_a_program_that_uses_rclpy_itself_asks_and_ends(lone_planner: "Suite") -> None:
    # The second client is not even closed.
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(start=START, end=END)],
        env=isolated_environment(lone_planner.domain),
        capture_output=True,
        text=True,
        timeout=TIMEOUT_SEC,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "('#9',) 0.78 s task True\n0.99 s\n"
