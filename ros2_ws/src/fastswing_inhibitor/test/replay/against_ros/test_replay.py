"""A replay agrees with what the rule decided, decision for decision, and names what differs."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from fastswing_inhibitor.inhibition import (
    Arming,
    Decision,
    Inhibition,
    InhibitionSettings,
    JointNumbers,
    Reason,
)
from fastswing_inhibitor.replay import command as replay_command
from fastswing_inhibitor.replay.recorded import UnusableForReplay
from fastswing_inhibitor.replay.replay import replay
from fastswing_inhibitor.replay.result import Replay, WhatIf
from fastswing_inhibitor.replay.text import replay_text
from fastswing_msgs.msg import CurrentOverride, InhibitionStatus, SwingPlan
from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.bags import open_bag
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagWriter
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.robot.limits import muscle_limits
from fastswing_planner.testing.arms import BentArm

LIMIT = frozen([0.3, 0.25, 0.2])
LIMITS = muscle_limits(("m0", "m1", "m2"), LIMIT, 1.0, 0.0, 100.0)
START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 5_000_000
TYPES = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/inhibition_status": "fastswing_msgs/msg/InhibitionStatus",
    "/current_override": "fastswing_msgs/msg/CurrentOverride",
    "/swing_plan": "fastswing_msgs/msg/SwingPlan",
}


def moment_arms(joint_position: Vector) -> ArrayLike:
    """Return G(theta) [m/rad] of two joints and three muscles; it changes with the posture."""
    a, b = joint_position
    return [[np.cos(a), 0.1], [-0.5, np.sin(b)], [0.3 * b, -np.cos(a + b)]]


# Replay needs the Jacobian alone.
ARM = BentArm(lambda _: np.zeros(3), moment_arms, joint_count=2, joint_range=10.0)


def stamp(time_ns: int) -> Header:
    header = Header()
    header.stamp.sec, header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
    return header


@dataclass
class Case:
    """A swing: what is in the bag, and what is done to it before it is written."""

    positions: Sequence[Sequence[float]]
    velocities: Sequence[Sequence[float]]
    goal: Sequence[float] = (2.0, 1.0)
    threshold: float = 0.0
    protected: Sequence[bool] = (False, False, False)
    mask: Sequence[int] = (1, 1, 1)
    prefix: str = ""


Change = Callable[[int, str, Any], Any]
"""Takes the number of a decision, a topic and a message; returns the message, None: left out."""


def write(path: Path, case: Case, change: Change = lambda number, topic, message: message) -> Path:
    """Write the bag of a swing on which the rule has decided."""
    bag = BagWriter(path)
    for name, kind in TYPES.items():
        bag.add_topic(BagTopic(case.prefix + name, kind, definition_text(kind)))

    def put(number: int, topic: str, message: Any, time_ns: int) -> None:
        message = change(number, topic, message)
        if message is not None:
            data = bytes(serialize_message(message))
            bag.write(case.prefix + topic, data, time_ns, time_ns)

    plan = SwingPlan(
        joint_name=ARM.joint_names,
        end_position=list(case.goal),
        muscle_name=ARM.muscle_names,
        mask=case.mask,
    )
    put(0, "/swing_plan", plan, START_NS - 1000)
    inhibition = Inhibition(ARM, LIMIT, InhibitionSettings())
    inhibition.see(0.0)
    protected = np.array(case.protected)
    inhibition.arm(Arming(frozen(case.goal), case.threshold, protected, 100.0, 0.0))
    nothing = Decision((False,) * 3, (math.nan,) * 3, False, Reason.NONE)
    put(0, "/inhibition_status", status(START_NS, inhibition, nothing), START_NS)
    for number, (position, velocity) in enumerate(
        zip(case.positions, case.velocities, strict=True), 1
    ):
        time_ns = START_NS + number * PERIOD_NS
        state = JointState(
            header=stamp(time_ns),
            name=["j1", "other", "j0"],  # the bag's own order
            position=[position[1], 0.0, position[0]],
            velocity=[velocity[1], 0.0, velocity[0]],
        )
        put(number, "/joint_states", state, time_ns)
        time = (time_ns - START_NS) * 1e-9
        made = inhibition.decide(JointNumbers(time, position, velocity))
        message = status(time_ns, inhibition, made)
        put(number, "/inhibition_status", message, time_ns + 1000)
        override = CurrentOverride(header=stamp(time_ns), name=message.inhibited)
        put(number, "/current_override", override, time_ns + 1000)
        if not inhibition.armed:
            break
    bag.close()
    return path


def status(time_ns: int, inhibition: Inhibition, made: Decision) -> InhibitionStatus:
    return InhibitionStatus(
        header=stamp(time_ns),
        armed=inhibition.armed,
        reason=int(made.reason),
        threshold=inhibition.threshold,
        name=ARM.muscle_names,
        speed_index=list(inhibition.speed_index(made)),
        inhibited=list(compress(ARM.muscle_names, made.inhibited)),
        direction_from_goal=made.direction_from_goal,
        decisions=inhibition.decisions,
    )


def straight(count: int = 20) -> Case:
    """Return a swing along the way to the goal, slow at first."""
    way = np.linspace(0.0, 0.8, count)[:, None] * np.array([2.0, 1.0])
    speed = np.linspace(0.0, 4.0, count)[:, None] * np.array([2.0, 1.0])
    return Case(way.tolist(), speed.tolist())


def replayed(path: Path, **options: Any) -> Replay:
    return replay(open_bag(path), ARM, LIMIT, **options)


numbers = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2)
rows = st.lists(st.tuples(numbers, numbers), min_size=1, max_size=12)


@settings(deadline=None)
@given(rows, st.floats(0.0, 5.0), st.lists(st.booleans(), min_size=3, max_size=3))
def test_every_decision_is_made_again_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory,
    states: list[tuple[list[float], list[float]]],
    threshold: float,
    protected: list[bool],
) -> None:
    case = Case([p for p, _ in states], [v for _, v in states], (2.0, 1.0), threshold, protected)
    path = write(tmp_path_factory.mktemp("bag") / "a.mcap", case)
    found = replayed(path)
    assert found.agrees, replay_text(found, START_NS)
    (swing,) = found.swings
    assert 1 <= len(swing.decisions) <= len(states)


def test_a_swing_is_replayed_with_its_end(tmp_path: Path) -> None:
    case = straight()
    case.goal = (1.65, 0.825)
    case.positions = [*case.positions, [1.65, 0.825]]
    case.velocities = [*case.velocities, [1.0, 0.5]]
    (swing,) = replayed(write(tmp_path / "a.mcap", case)).swings
    assert (swing.end, len(swing.decisions), swing.agreed) == (Reason.GOAL_REACHED, 21, 21)


def test_protected_muscles_are_found(tmp_path: Path) -> None:
    case = straight()
    free = replayed(write(tmp_path / "free.mcap", case)).swings[0]
    assert free.protected == ()
    case.protected = (True, False, False)
    (swing,) = replayed(write(tmp_path / "a.mcap", case)).swings
    assert swing.protected == ("m0",)
    assert swing.agreed == 20


def test_a_muscle_that_the_plan_masks_is_not_taken_for_kept(tmp_path: Path) -> None:
    case = straight()
    case.protected, case.mask = (True, False, False), (0, 1, 1)
    found = replayed(write(tmp_path / "a.mcap", case))
    (swing,) = found.swings
    assert (swing.protected, found.agrees) == ((), False)
    assert swing.first_difference is not None
    assert swing.first_difference.difference == "same q, but inhibited differ: m0"


def test_a_bit_of_q_is_a_difference(tmp_path: Path) -> None:
    def nudge(number: int, topic: str, message: Any) -> Any:
        if (number, topic) == (5, "/inhibition_status"):
            message.speed_index[0] = float(np.nextafter(message.speed_index[0], np.inf))
        return message

    found = replayed(write(tmp_path / "a.mcap", straight(), nudge))
    (swing,) = found.swings
    assert (swing.agreed, found.agrees) == (19, False)
    assert swing.first_difference is not None
    assert swing.first_difference.stamp_ns == START_NS + 5 * PERIOD_NS
    assert swing.first_difference.difference.startswith("q of m0 published ")


def test_a_muscle_left_out_is_a_difference(tmp_path: Path) -> None:
    def forget(number: int, topic: str, message: Any) -> Any:
        if number == 7 and topic != "/joint_states":
            names = "inhibited" if topic == "/inhibition_status" else "name"
            setattr(message, names, [])
        return message

    (swing,) = replayed(write(tmp_path / "a.mcap", straight(), forget)).swings
    assert swing.first_difference is not None
    assert swing.first_difference.difference == "same q, but inhibited differ: m0"


def test_an_override_that_is_not_the_decision_is_named(tmp_path: Path) -> None:
    def forget(number: int, topic: str, message: Any) -> Any:
        if (number, topic) == (7, "/current_override"):
            message.name = []
        return message

    found = replayed(write(tmp_path / "a.mcap", straight(), forget))
    assert not found.agrees
    assert found.override_differences == (
        f"the override of stamp {START_NS + 7 * PERIOD_NS} ns names nothing, its status m0",
    )


def test_an_override_that_is_not_in_the_bag_is_named(tmp_path: Path) -> None:
    def lose(number: int, topic: str, message: Any) -> Any:
        return None if (number, topic) == (7, "/current_override") else message

    found = replayed(write(tmp_path / "a.mcap", straight(), lose))
    assert not found.agrees
    assert found.override_differences == (
        f"the override of stamp {START_NS + 7 * PERIOD_NS} ns is not in the bag, its status names "
        "m0",
    )


def lose_statuses(number: int, topic: str, message: Any) -> Any:
    """Lose decisions 5 to 18: for longer than state_timeout."""
    return None if 5 <= number <= 18 and topic != "/joint_states" else message


def test_decisions_that_are_not_in_the_bag_are_counted(tmp_path: Path) -> None:
    found = replayed(write(tmp_path / "a.mcap", straight(), lose_statuses))
    assert not found.agrees
    assert found.swings[0].missing == (
        f"14 decisions after stamp {START_NS + 4 * PERIOD_NS} ns are not in the bag",
    )


def test_the_joint_states_of_missing_decisions_are_decided_on(tmp_path: Path) -> None:
    (swing,) = replayed(write(tmp_path / "a.mcap", straight(), lose_statuses)).swings
    assert swing.first_difference is None


def test_a_text_names_what_is_missing(tmp_path: Path) -> None:
    found = replayed(write(tmp_path / "a.mcap", straight(), lose_statuses))
    assert f"  {found.swings[0].missing[0]}" in replay_text(found, START_NS).splitlines()


def test_statuses_that_stop_while_joint_states_go_on_are_named(tmp_path: Path) -> None:
    def stop(number: int, topic: str, message: Any) -> Any:
        return message if number < 5 or topic == "/joint_states" else None

    found = replayed(write(tmp_path / "a.mcap", straight(), stop))
    assert not found.agrees
    assert found.swings[0].missing == (
        f"no status after stamp {START_NS + 4 * PERIOD_NS} ns is in the bag, though joint states "
        "go on for 0.080 s",
    )


def test_state_timeout_is_not_blamed_if_joint_states_were_passed_over(tmp_path: Path) -> None:
    def uncounted(number: int, topic: str, message: Any) -> Any:
        message = lose_statuses(number, topic, message)
        if message is not None and number > 18 and topic == "/inhibition_status":
            message.decisions -= 14
        return message

    (swing,) = replayed(write(tmp_path / "a.mcap", straight(), uncounted)).swings
    assert swing.first_difference is not None
    assert swing.first_difference.difference == (
        "published a decision, replayed the end STALE_STATE: it had not decided on the joint "
        "states before it, which are in the bag"
    )


def test_a_lease_shorter_than_the_states_age_changes_no_decision(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", straight())
    assert replayed(path, settings=InhibitionSettings(lease=0.002)).agrees


def spoil_reason(number: int, topic: str, message: Any) -> Any:
    if topic == "/inhibition_status":
        message.reason = 99
    return message


def spoil_speed_index(number: int, topic: str, message: Any) -> Any:
    if topic == "/inhibition_status":
        message.speed_index = message.speed_index[:2]
    return message


def spoil_position(number: int, topic: str, message: Any) -> Any:
    if topic == "/joint_states":
        message.position, message.velocity = [], []
    return message


def spoil_end_position(number: int, topic: str, message: Any) -> Any:
    if topic == "/swing_plan":
        message.end_position = message.end_position[:1]
    return message


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (spoil_reason, "/inhibition_status has the reason 99, which is not known"),
        (spoil_speed_index, "speed_index of /inhibition_status has not one value for each name"),
        (spoil_position, "position of /joint_states has not one value for each name"),
        (
            spoil_end_position,
            "a plan of /swing_plan does not fit: end_position has 1 values for 2 names",
        ),
    ],
)
def test_a_message_that_cannot_be_used_is_one_line(
    tmp_path: Path, change: Change, complaint: str
) -> None:
    with pytest.raises(UnusableForReplay) as caught:
        replayed(write(tmp_path / "a.mcap", straight(), change))
    assert str(caught.value) == complaint


def test_a_joint_state_that_was_not_recorded_is_named(tmp_path: Path) -> None:
    def lose(number: int, topic: str, message: Any) -> Any:
        return None if (number, topic) == (3, "/joint_states") else message

    (swing,) = replayed(write(tmp_path / "a.mcap", straight(), lose)).swings
    assert swing.first_difference is not None
    assert swing.first_difference.difference == "its joint state is not in the bag"


def test_a_shorter_state_timeout_than_the_nodes_is_suspected(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", straight())
    shorter = InhibitionSettings(state_timeout=0.001)
    (swing,) = replayed(path, settings=shorter).swings
    assert swing.first_difference is not None
    assert swing.first_difference.difference == (
        "published a decision, replayed the end STALE_STATE: is state_timeout the node's?"
    )


def test_without_a_plan_the_reason_is_said(tmp_path: Path) -> None:
    def lose(number: int, topic: str, message: Any) -> Any:
        return None if topic == "/swing_plan" else message

    found = replayed(write(tmp_path / "a.mcap", straight(), lose))
    assert found.swings[0].complaint == "no plan before it, so its goal is not known"
    assert not found.agrees


def test_half_a_swing_is_replayed(tmp_path: Path) -> None:
    def late(number: int, topic: str, message: Any) -> Any:
        return message if number > 4 or topic == "/swing_plan" else None

    (swing,) = replayed(write(tmp_path / "a.mcap", straight(), late)).swings
    assert (len(swing.decisions), swing.agreed, swing.end) == (16, 16, None)


def test_another_threshold_changes_the_decisions(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", straight())
    (swing,) = replayed(path, what_if=WhatIf(threshold=1e6)).swings
    assert all(one.replayed is not None for one in swing.decisions)
    assert not any(any(one.replayed.inhibited) for one in swing.decisions if one.replayed)


def test_another_velocity_limit_scales_q(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", straight())
    (half,) = replayed(path, what_if=WhatIf(velocity_limit=0.15)).swings
    one = half.decisions[-1]
    assert one.replayed is not None
    expected = np.array(one.published.speed_index) * LIMIT / 0.15
    np.testing.assert_allclose(one.replayed.speed_index, expected, rtol=1e-12)


def test_a_robot_is_chosen_by_its_namespace(tmp_path: Path) -> None:
    left = straight()
    left.prefix = "/left"
    right = straight()
    right.prefix = "/right"
    bag = open_bag(write(tmp_path / "a.mcap", left), write(tmp_path / "b.mcap", right))
    with pytest.raises(UnusableForReplay) as caught:
        replay(bag, ARM, LIMIT)
    assert str(caught.value) == (
        "nothing to replay: more than one topic of type sensor_msgs/msg/JointState: "
        "/left/joint_states, /right/joint_states; choose with --prefix"
    )
    assert replay(bag, ARM, LIMIT, prefix="/left").agrees


def test_a_bag_without_an_inhibitor_is_named(tmp_path: Path) -> None:
    def lose(number: int, topic: str, message: Any) -> Any:
        return None if topic == "/inhibition_status" else message

    with pytest.raises(UnusableForReplay) as caught:
        replayed(write(tmp_path / "a.mcap", straight(), lose))
    assert str(caught.value) == (
        "nothing to replay: no messages of type fastswing_msgs/msg/InhibitionStatus; "
        "only swings by Method 1 or the hybrid have them"
    )


def test_the_text_says_what_agreed_and_who_was_inhibited(tmp_path: Path) -> None:
    found = replayed(write(tmp_path / "a.mcap", straight()))
    assert replay_text(found, START_NS).splitlines() == [
        "swing 1 at 0.000 s, C 0 s/rad: 20 decisions, 20 as published, q bit for bit",
        "  end the bag ends before it, 0 joint states rejected",
        "  m0: inhibited in 20 decisions as published, 20 replayed",
        "  m2: inhibited in 9 decisions as published, 9 replayed",
    ]


# The command: a verification can fail for any arm, a what-if cannot.


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Let every description be that of the bent arm; return the names of those loaded."""
    names: list[str] = []

    def load(uri: str) -> Any:
        names.append(Path(uri).name)
        return SimpleNamespace(model=ARM, limits=LIMITS)

    monkeypatch.setattr(replay_command, "load_robot", load)
    return names


def spoilt(folder: Path) -> str:
    """Write a bag in which one override is missing."""

    def lose(number: int, topic: str, message: Any) -> Any:
        return None if (number, topic) == (7, "/current_override") else message

    return str(write(folder / "a.mcap", straight(), lose))


def test_a_difference_fails_the_verification_of_any_robot(
    tmp_path: Path, loaded: list[str]
) -> None:
    assert replay_command.main([spoilt(tmp_path), "--robot", "/other.yaml"]) == 1
    assert loaded == ["other.yaml"]


def test_a_difference_is_the_answer_of_a_what_if(tmp_path: Path, loaded: list[str]) -> None:
    assert replay_command.main([spoilt(tmp_path), "--model", "/other.yaml"]) == 0
    assert loaded == ["other.yaml"]


@pytest.mark.parametrize(
    ("option", "value", "changed", "same"),
    [
        ("--threshold", "0.5", "C 0.5 s/rad", 17),
        ("--velocity-limit", "0.1", "velocity limit 0.1 m/s", 0),
    ],
)
def test_a_what_if_with_another_number_tells_how_many_decisions_stay(
    tmp_path: Path,
    loaded: list[str],
    capsys: pytest.CaptureFixture[str],
    option: str,
    value: str,
    changed: str,
    same: int,
) -> None:
    path = write(tmp_path / "a.mcap", straight())
    assert replay_command.main([str(path), "--robot", "/other.yaml", option, value]) == 0
    assert capsys.readouterr().out.splitlines()[:2] == [
        f"what if: {changed}",
        f"swing 1 at 0.000 s, C 0 s/rad: 20 decisions, {same} as published",
    ]


def test_a_bag_that_agrees_passes(tmp_path: Path, loaded: list[str]) -> None:
    path = write(tmp_path / "a.mcap", straight())
    assert replay_command.main([str(path), "--robot", "/other.yaml"]) == 0


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        (
            "--threshold",
            "1e300",
            "threshold is 1e+300 s/rad, must be 0 to 1e+06: below 0 agonists would be inhibited",
        ),
        ("--threshold", "nan", "threshold is nan, expected a finite number"),
        (
            "--velocity-limit",
            "0",
            "velocity_limit of #1 is 0 m/s, must be positive",
        ),
        (
            "--velocity-limit",
            "1e300",
            "velocity_limit of #1 is 1e+300 m/s, must be 0.0001 to 1000",
        ),
    ],
)
def test_a_what_if_that_no_arm_could_have_is_refused(
    capsys: pytest.CaptureFixture[str], option: str, value: str, expected: str
) -> None:
    assert replay_command.main(["any.mcap", option, value]) == 2
    assert capsys.readouterr().err == f"replay: {expected}\n"
