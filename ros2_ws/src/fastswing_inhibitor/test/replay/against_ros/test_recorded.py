"""What a bag lacks for a replay, or holds in a form that cannot be used, is one line."""

from pathlib import Path
from typing import Any

import pytest
from decided_swing import ARM, LIMIT, Change, replayed, straight, write

from fastswing_inhibitor.replay.recorded import UnusableForReplay
from fastswing_inhibitor.replay.replay import replay
from fastswing_planner.bags import open_bag


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
