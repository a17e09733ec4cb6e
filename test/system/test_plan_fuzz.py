"""Whatever is asked of the planner, it answers, half-answers nothing, and lives on."""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Point
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from fastswing_msgs.msg import ErrorCode, SwingOptions, SwingPlan
from fastswing_msgs.srv import PlanSwing
from fastswing_planner.conversion.error_codes import error_name

if TYPE_CHECKING:
    from test.system.suite import Suite


COUNT = 10_000
ANSWER_SEC = 60.0
JOINTS = ["S-p", "S-r", "S-y", "E-p", "E-y"]
MUSCLES = [f"#{number}" for number in range(1, 11)]
START = [-0.7475, 0.0, 0.0, -1.9422, 0.0]
END = [-0.7, 0.0, 0.0, -1.8, 0.0]
"""A short swing, so that its plan takes little time."""

TEXTS = st.sampled_from(
    ["", " ", "#9", "#9 ", "＃9", "E-p", "hand", "\n", "%s%n{}", "\u202e#9", "\ufeff", "a" * 3000]
) | st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=4)
EXTREMES = st.sampled_from(
    [math.nan, math.inf, -math.inf, 0.0, -0.0, 5e-324, -5e-324, 1e-310, 1e308, -1e308, 1e16, -1.0]
)
NUMBERS = EXTREMES | st.floats() | st.floats(-3.0, 3.0)
LISTS = st.lists(NUMBERS, max_size=11)


def with_one(values: list[float]) -> st.SearchStrategy[list[float]]:
    """Replace one of the values by any number."""
    return st.builds(
        lambda place, value: [*values[:place], value, *values[place + 1 :]],
        st.integers(0, len(values) - 1),
        NUMBERS,
    )


def names(valid: list[str]) -> st.SearchStrategy[list[str]]:
    """Yield names in any order, some twice, some unknown."""
    return st.permutations(valid) | st.lists(st.sampled_from(valid) | TEXTS, max_size=11)


def posture(near: list[float]) -> st.SearchStrategy[list[float]]:
    nearby = st.lists(st.floats(-0.1, 0.1), min_size=5, max_size=5)
    moved = nearby.map(lambda steps: [a + b for a, b in zip(near, steps, strict=True)])
    return st.just(near) | moved | with_one(near) | LISTS


def spread(low: float, high: float) -> st.SearchStrategy[float]:
    """Yield numbers of any order of magnitude from `low` to `high`."""
    return st.floats(math.log(low), math.log(high)).map(math.exp) | st.sampled_from([low, high])


@st.composite
def constants(draw: st.DrawFn) -> dict[str, Any]:
    """Give some muscles limits and weights that are allowed, however extreme."""
    muscles = draw(st.lists(st.sampled_from(MUSCLES), min_size=1, max_size=10, unique=True))
    count = len(muscles)
    ranges = {
        "velocity_limit": spread(1e-4, 1e3),
        "acceleration_limit": spread(1e-4, 1e6) | st.just(math.inf),
        "tension_min": spread(1e-3, 20.0) | st.just(0.0),
        "tension_max": spread(20.1, 1e5),
        "holding_weight": spread(1e-2, 1e2),
    }
    chosen = draw(st.lists(st.sampled_from(sorted(ranges)), min_size=1, unique=True))
    given_values = {
        what: draw(st.lists(ranges[what], min_size=count, max_size=count)) for what in chosen
    }
    return {"muscle_name": muscles, **given_values}


def one(field: str, values: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    return values.map(lambda value: {field: value})


BLOCK = [2.0, 1.0, 1.0, 2.0]
# Few steps, so that an allowed swing takes little time, or far too many.
STEPS = st.integers(1, 30) | st.integers(100_001, 2**32 - 1)
CHANGES = st.one_of(
    one("joint_name", names(JOINTS)),
    one("start_position", posture(START)),
    one("end_position", posture(END)),
    one("compare", st.just(True)),
    one("method", st.integers(0, 3) | st.integers(0, 255)),
    one("search", st.integers(0, 1) | st.integers(0, 255)),
    one("search_time_limit", NUMBERS),
    one("kept_muscle", names(MUSCLES)),
    one("muscle_name", names(MUSCLES)),
    one("velocity_limit", with_one([0.3] * 10) | LISTS),
    one("acceleration_limit", with_one([0.46] * 10) | LISTS),
    one("tension_min", with_one([10.0] * 10) | LISTS),
    one("tension_max", with_one([200.0] * 10) | LISTS),
    one("holding_weight", with_one([1.0] * 10) | LISTS),
    with_one(BLOCK).map(lambda block: {"muscle_name": ["#9", "#3"], "holding_weight": block}),
    one("swing_weight", with_one([1.0] * 5) | with_one(np.eye(5).ravel().tolist()) | LISTS),
    one("threshold", NUMBERS | st.floats(0.0, 1.0)),
    one("time_step", NUMBERS | spread(1e-4, 1.0)),
    one("epsilon", NUMBERS | spread(1e-3, 1.0)),
    one("max_steps", STEPS),
    one("payload_mass", NUMBERS | st.floats(0.0, 60.0)),
    one("payload_body", TEXTS),
    one("payload_position", st.builds(Point, x=NUMBERS, y=NUMBERS, z=NUMBERS)),
    constants(),
)
_OF_THE_REQUEST = ("joint_name", "start_position", "end_position", "compare")


def request_of(method: int, changes: list[dict[str, Any]]) -> PlanSwing.Request:
    """Return the short swing with some fields changed."""
    fields = {"start_position": START, "end_position": END, "method": method, "max_steps": 30}
    for change in changes:
        fields |= change
    return PlanSwing.Request(
        **{name: fields.pop(name) for name in _OF_THE_REQUEST if name in fields},
        options=SwingOptions(**fields),
    )


REQUESTS = st.builds(request_of, st.integers(0, 3), st.lists(CHANGES, max_size=3))


class Asker:
    """One service client for all requests; EventsExecutor does not slow down over them."""

    def __init__(self, domain: int) -> None:
        """Connect in a ROS domain."""
        self._context = rclpy.Context()
        rclpy.init(
            context=self._context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO
        )
        self._node = rclpy.create_node(
            "asker", context=self._context, enable_rosout=False, start_parameter_services=False
        )
        self._client = self._node.create_client(PlanSwing, "plan_swing")
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._wait_until(self._client.service_is_ready)
        # The first answer after discovery can get lost.
        while not self._answer(PlanSwing.Request(), 3.0):
            pass

    def _wait_until(self, done: Callable[[], bool], timeout_sec: float = ANSWER_SEC) -> None:
        deadline = time.monotonic() + timeout_sec
        while not done() and time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.1)

    def _answer(self, request: PlanSwing.Request, timeout_sec: float) -> Any:
        future = self._client.call_async(request)
        self._wait_until(future.done, timeout_sec)
        return future.result()

    def ask(self, request: PlanSwing.Request) -> PlanSwing.Response:
        """Return the answer, which must come."""
        answer = self._answer(request, ANSWER_SEC)
        assert answer is not None, "no answer"
        return answer

    def close(self) -> None:
        """Disconnect."""
        self._node.destroy_node()
        self._context.try_shutdown()


@pytest.fixture(scope="module")
def asker(lone_planner: "Suite") -> Iterator[Asker]:
    asker = Asker(lone_planner.domain)
    yield asker
    asker.close()


def all_finite(message: Any) -> bool:
    """Return whether every number in a message, or in a list of messages, is finite."""
    if hasattr(message, "get_fields_and_field_types"):
        return all(all_finite(getattr(message, name)) for name in message.__slots__)
    if isinstance(message, (str, bytes, bool)):
        return True
    if isinstance(message, (int, float)):
        return math.isfinite(message)
    if len(message) and isinstance(message[0], (int, float)):
        return bool(np.isfinite(message).all())
    return all(all_finite(item) for item in message)


def check_outcome(outcome: Any) -> None:
    """Fail unless a response or a method's outcome is a whole plan or nothing but an error."""
    if outcome.error_code == ErrorCode.SUCCESS:
        assert outcome.error_string == ""
        assert all_finite(outcome.plan)
        assert len(outcome.plan.trajectory.time_from_start) >= 2
        assert set(outcome.plan.joint_name) == set(JOINTS)
    else:
        assert outcome.error_string != ""
        assert outcome.plan == SwingPlan()
        assert error_name(outcome.error_code) not in ("INTERNAL", "INVALID_REQUEST")


def test_ten_thousand_requests_are_answered_wholly(
    lone_planner: "Suite", asker: Asker, record_testsuite_property: Callable[[str, object], None]
) -> None:
    codes: Counter[str] = Counter()

    @settings(
        max_examples=COUNT,
        deadline=None,
        derandomize=True,
        database=None,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    @given(REQUESTS)
    def ask(request: PlanSwing.Request) -> None:
        answer = asker.ask(request)
        codes[error_name(answer.error_code)] += 1
        check_outcome(answer)
        assert len(answer.comparison) in ((0, 4) if request.compare else (0,))
        for outcome in answer.comparison:
            check_outcome(outcome)
        assert lone_planner.processes["planner"].running

    began = time.monotonic()
    ask()
    print(f"{codes.total()} requests in {time.monotonic() - began:.0f} s: {codes.most_common()}")
    record_testsuite_property("fuzz", dict(codes))
    assert codes.total() >= COUNT
    # Neither all right nor all wrong.
    assert COUNT / 10 < codes["SUCCESS"] < COUNT * 9 / 10
    assert len(codes) > 10
    assert lone_planner.processes["planner"].running
    last = lone_planner.plan(options=SwingOptions(method=SwingOptions.METHOD_ELONGATE))
    assert last.error_string == ""
    assert last.plan.time_cost == pytest.approx(0.78)
    assert "defect" not in lone_planner.processes["planner"].log.read_text()
