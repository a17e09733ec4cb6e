"""What a plan costs: in the library, through the service, as arms grow, and beside a plain one."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from growth_picture import Line, draw
from limbed_arm import write_limbed_arm
from machine import AWAKE, wakeful
from plain_planner import PlainPlanner
from processes import Process, free_domain, isolated_environment, stop_all
from rclpy.experimental import EventsExecutor
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions
from rounds import Row, Samples, in_turns, repeated, row

from fastswing_msgs.msg import ErrorCode
from fastswing_msgs.msg import SwingPlan as SwingPlanMessage
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.conversion.plans import plan_to_message
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, Search, SwingRequest
from fastswing_planner.planning.swing import SwingSettings
from fastswing_planner.qp.solvers import SOLVERS, solver_from
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI

QUESTION = "What does a plan cost, through the service too, and how does it grow with the arm?"
PLAIN = "plain planner"
SIZES = ((10, 5), (20, 5), (40, 5), (74, 5), (20, 10), (40, 20), (74, 33))
"""Muscles and joints."""
TIME_STEPS = (0.03, 0.015, 0.0075)
_MOST_MS = {"proxsuite": 10.0, "daqp": 5.0}
_READY_SEC = 60.0
# A plan in a new process, as JSON: what loading the robot and the first plan take [s].
_COLD = """
import json, sys, time
from pathlib import Path
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.qp.solvers import solver_from
from fastswing_planner.planning.request import SwingRequest
from fastswing_planner.robot.description import load_robot
robot = load_robot(Path(sys.argv[1]))
planner = SwingPlanner(robot.model, robot.limits, solver_from(sys.argv[2]))
begin = time.perf_counter()
planner.plan(SwingRequest(robot.postures["start"], robot.postures["end"]))
print(json.dumps(time.perf_counter() - begin))
"""

# A service that answers nothing and works as long as a plan takes [s].
_EMPTY = """
import sys, time
import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.task import Future
from fastswing_msgs.srv import PlanSwing
def answer(request, response):
    end = time.perf_counter() + float(sys.argv[1])
    while time.perf_counter() < end:
        pass
    return response
rclpy.init()
node = rclpy.create_node("empty", enable_rosout=False, start_parameter_services=False)
service = node.create_service(PlanSwing, "plan_swing", answer)
executor = EventsExecutor()
executor.add_node(node)
executor.spin_until_future_complete(Future(), timeout_sec=3600.0)
"""


def library(robot: Robot, solver: str, **options: Any) -> Callable[[], object]:
    """Return a call that plans the robot's own swing; options are fields of SwingRequest."""
    planner = SwingPlanner(robot.model, robot.limits, solver_from(solver))
    request = SwingRequest(robot.postures["start"], robot.postures["end"], **options)
    return lambda: planner.plan(request)


def plain(robot: Robot, elongate: bool, whole: bool = True) -> Callable[[], object]:
    """Return a call of the plain planner."""
    planner = PlainPlanner(robot, whole)
    return lambda: planner.plan(elongate)


def run(scale: float, plots: Path | None = None) -> list[Row]:
    """Measure; 1.0 takes some minutes."""
    rounds, count = max(2, round(10 * scale)), max(1, round(20 * scale))
    robot = load_robot(MUSASHI)
    rows = _library_rows(robot, rounds, count)
    rows += _cold_rows(robot, max(1, round(5 * scale)))
    rows += _service_rows(robot, rounds, max(2, count))
    grown = _growth(scale)
    if plots is not None:
        draw(_panels(grown), "greedy plan [ms]", plots / "performance_planner.png")
    return rows + _growth_rows(grown)


def _library_rows(robot: Robot, rounds: int, count: int) -> list[Row]:
    rows = []
    for title, method in (("plan", Method.BASIC), ("Method 2, greedy", Method.ELONGATE)):
        elongate = method is Method.ELONGATE
        calls = {solver: library(robot, solver, method=method) for solver in SOLVERS}
        calls[PLAIN] = plain(robot, elongate)
        calls[f"{PLAIN}, paper only"] = plain(robot, elongate, whole=False)
        found = _in_turns(calls, rounds, count)
        for name, samples in found.items():
            judged = not elongate and name in SOLVERS
            rows.append(
                row(
                    f"{title}, {name}",
                    samples,
                    against=None if name == PLAIN else (PLAIN, found[PLAIN]),
                    at_most=_MOST_MS[name] if judged else None,
                    ratio_at_most=0.5 if judged else None,
                )
            )
    calls = {
        solver: library(robot, solver, method=Method.ELONGATE, search=Search.EXHAUSTIVE)
        for solver in SOLVERS
    }
    calls[PLAIN] = plain(robot, elongate=False)
    found = _in_turns(calls, rounds, max(1, count // 4))
    for solver in SOLVERS:
        title = f"exhaustive over 4 antagonists, {solver}"
        rows.append(
            row(title, found[solver], against=(f"plan, {PLAIN}", found[PLAIN]), at_most=60.0)
        )
    return rows


def _in_turns(
    calls: dict[str, Callable[[], object]], rounds: int, count: int
) -> dict[str, list[Samples]]:
    for call in calls.values():
        call()  # the first one is measured as `cold`
    return in_turns({name: repeated(call, count) for name, call in calls.items()}, rounds)


def _cold_rows(robot: Robot, count: int) -> list[Row]:
    rows = []
    for solver in SOLVERS:
        command = [sys.executable, "-c", _COLD, str(robot.path), solver]
        samples = [
            float(json.loads(subprocess.run(command, capture_output=True, check=True).stdout))
            for _ in range(count)
        ]
        title = f"first plan of a process, {solver}"
        rows.append(row(title, [np.array(samples)], at_most=300.0))
    return rows


# Through the service.


@contextmanager
def _planner(environment: Mapping[str, str]) -> Iterator[None]:
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "planner.log"
        planner = Process("fastswing_planner", "planner", {}, environment, log)
        try:
            yield
        finally:
            stop_all([planner])


@contextmanager
def _empty_service(seconds: float, environment: Mapping[str, str]) -> Iterator[None]:
    command = [sys.executable, "-c", _EMPTY, str(seconds)]
    with subprocess.Popen(command, env=dict(environment)) as service:
        try:
            yield
        finally:
            service.kill()


@contextmanager
def _asking(
    robot: Robot, server: Callable[[Mapping[str, str]], AbstractContextManager[None]]
) -> Iterator[Callable[[], object]]:
    """Yield a call that asks a server of `plan_swing` for the robot's own swing."""
    domain = free_domain()
    os.environ.update(isolated_environment(domain))
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(
        "asking", context=context, enable_rosout=False, start_parameter_services=False
    )
    client = node.create_client(PlanSwing, "plan_swing")
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    request = PlanSwing.Request(
        start_position=robot.postures["start"].tolist(),
        end_position=robot.postures["end"].tolist(),
    )

    def ask(timeout: float = _READY_SEC) -> object:
        answer = client.call_async(request)
        executor.spin_until_future_complete(answer, timeout_sec=timeout)
        response = answer.result()
        if response is None:
            client.remove_pending_request(answer)
            raise TimeoutError("plan_swing does not answer")
        if response.error_code != ErrorCode.SUCCESS:
            raise ValueError(response.error_string)
        return response

    try:
        with server(isolated_environment(domain)):
            if not client.wait_for_service(_READY_SEC):
                raise TimeoutError("no plan_swing")
            _first_answer(ask)
            yield ask
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)


def _first_answer(ask: Callable[[float], object]) -> None:
    for _ in range(10):
        try:
            ask(3.0)
            return
        except TimeoutError:
            continue  # the first answers after discovery can get lost
    raise TimeoutError("the planner does not answer")


def _service_rows(robot: Robot, rounds: int, count: int) -> list[Row]:
    solver = next(iter(SOLVERS))
    plan = library(robot, solver)
    plan()
    as_long = float(np.median(repeated(plan, count)()))
    with (
        _asking(robot, _planner) as ask,
        _asking(robot, partial(_empty_service, as_long)) as ask_nothing,
    ):
        calls = {"service": ask, "library": plan, "empty": ask_nothing}
        programs = {name: repeated(call, count) for name, call in calls.items()}
        awake = {f"{name}{AWAKE}": partial(wakeful, program) for name, program in programs.items()}
        found = in_turns({**programs, **awake}, rounds)
    rows = []
    for state in ("", AWAKE):
        asked, inside = found[f"service{state}"], found[f"library{state}"]
        against = (f"plan, {solver}{state}", inside)
        added = [one - float(np.median(other)) for one, other in zip(asked, inside, strict=True)]
        floor = [one - as_long for one in found[f"empty{state}"]]
        rows += [
            row(f"plan through the service, {solver}{state}", asked, against=against),
            row(f"what the service adds{state}", added, at_most=None if state else 1.0),
            row(f"what a service adds that works as long and answers nothing{state}", floor),
        ]
    title = "what a plan costs as a message, there and back"
    return [*rows, row(title, _converted(robot, rounds, count))]


def _converted(robot: Robot, rounds: int, count: int) -> list[Samples]:
    """Return what planner and client spend on a plan's message, without the middleware's ways."""
    request = SwingRequest(robot.postures["start"], robot.postures["end"])
    planned = SwingPlanner(robot.model, robot.limits, solver_from("daqp")).plan(request)

    def convert() -> None:
        deserialize_message(serialize_message(plan_to_message(planned)), SwingPlanMessage)

    return in_turns({"converted": repeated(convert, count)}, rounds)["converted"]


# Growth.

Grown = dict[str, dict[tuple[int, int, float], list[Samples]]]
"""Rounds by program, and muscles, joints, time step [s]."""


def _growth(scale: float) -> Grown:
    grown: Grown = {name: {} for name in (*SOLVERS, PLAIN)}
    rounds = max(1, round(5 * scale))
    with tempfile.TemporaryDirectory() as folder:
        cases = [(*size, TIME_STEPS[0]) for size in SIZES]
        cases += [(*SIZES[0], step) for step in TIME_STEPS[1:]]
        for muscles, joints, step in cases if scale >= 0.1 else (cases[0], cases[6], cases[-1]):
            robot = load_robot(write_limbed_arm(Path(folder), muscles, joints))
            settings = SwingSettings(time_step=step, max_steps=2000)
            calls = {
                solver: library(robot, solver, method=Method.ELONGATE, settings=settings)
                for solver in SOLVERS
            }
            peer = PlainPlanner(robot, time_step=step)
            calls[PLAIN] = partial(peer.plan, True)
            for name, samples in _in_turns(calls, rounds, 1).items():
                grown[name][muscles, joints, step] = samples
    return grown


def _growth_rows(grown: Grown) -> list[Row]:
    rows = []
    for case, samples in grown[PLAIN].items():
        muscles, joints, step = case
        title = f"greedy, {muscles} muscles, {joints} joints"
        title += f", steps of {step * 1e3:g} ms" if step != TIME_STEPS[0] else ""
        rows.append(row(f"{title}, {PLAIN}", samples))
        for solver in SOLVERS:
            at_most = 300.0 if (muscles, joints) == (74, 33) else None
            rows.append(
                row(
                    f"{title}, {solver}",
                    grown[solver][case],
                    against=(PLAIN, samples),
                    at_most=at_most,
                )
            )
    return rows


def _panels(grown: Grown) -> dict[str, dict[str, Line]]:
    def cost(samples: list[Samples]) -> float:
        return float(np.median(np.concatenate(samples))) * 1e3

    def lines(chosen: Callable[[int, int, float], float | None]) -> dict[str, Line]:
        return {
            name: [
                (size, cost(samples))
                for case, samples in cases.items()
                if (size := chosen(*case)) is not None
            ]
            for name, cases in grown.items()
        }

    usual, (least, fewest) = TIME_STEPS[0], SIZES[0]
    return {
        f"muscles, {fewest} joints": lines(
            lambda m, n, dt: m if (n, dt) == (fewest, usual) else None
        ),
        "joints, about two muscles each": lines(
            lambda m, n, dt: n if m < 2 * n + 9 and dt == usual else None
        ),
        f"steps per second, {least} muscles": lines(
            lambda m, n, dt: 1.0 / dt if (m, n) == SIZES[0] else None
        ),
    }
