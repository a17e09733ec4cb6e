"""A replay agrees with what the rule decided, decision for decision, and names what differs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from decided_swing import LIMIT, PERIOD_NS, START_NS, Case, replayed, straight, write
from hypothesis import given, settings
from hypothesis import strategies as st

from fastswing_inhibitor.inhibition import (
    InhibitionSettings,
    Reason,
)
from fastswing_inhibitor.replay.result import WhatIf
from fastswing_inhibitor.replay.text import replay_text

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


def test_the_text_says_what_agreed_and_who_was_inhibited(tmp_path: Path) -> None:
    found = replayed(write(tmp_path / "a.mcap", straight()))
    assert replay_text(found, START_NS).splitlines() == [
        "swing 1 at 0.000 s, C 0 s/rad: 20 decisions, 20 as published, q bit for bit",
        "  end the bag ends before it, 0 joint states rejected",
        "  m0: inhibited in 20 decisions as published, 20 replayed",
        "  m2: inhibited in 9 decisions as published, 9 replayed",
    ]
