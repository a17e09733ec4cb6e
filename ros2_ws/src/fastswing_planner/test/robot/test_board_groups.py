"""Which boards share a bus: every muscle and joint in exactly one group."""

import pytest

from fastswing_planner.errors import RobotDescriptionError
from fastswing_planner.robot.board_groups import BoardGroup, board_groups

MUSCLES = ("a", "b", "c")
JOINTS = ("j", "k")


def test_without_the_key_all_boards_are_one_group() -> None:
    assert board_groups(None, MUSCLES, JOINTS) == (BoardGroup((0, 1, 2), (0, 1)),)


def test_a_group_keeps_the_order_of_its_boards() -> None:
    content = [{"muscles": ["c", "a"], "joints": ["k"]}, {"muscles": ["b"], "joints": ["j"]}]
    assert board_groups(content, MUSCLES, JOINTS) == (
        BoardGroup((2, 0), (1,)),
        BoardGroup((1,), (0,)),
    )


def test_a_group_may_measure_no_joint() -> None:
    content = [{"muscles": ["a"]}, {"muscles": ["b", "c"], "joints": ["j", "k"]}]
    assert board_groups(content, MUSCLES, JOINTS)[0] == BoardGroup((0,), ())


@pytest.mark.parametrize(
    ("content", "text"),
    [
        ([{"muscles": ["a", "b"], "joints": ["j", "k"]}], "key 'board_groups' lacks muscle c"),
        ([{"muscles": ["a", "b", "c"], "joints": ["k"]}], "key 'board_groups' lacks joint j"),
        (
            [{"muscles": ["a", "b", "c", "a"], "joints": ["j", "k"]}],
            "key 'board_groups': muscle 'a' is named more than once",
        ),
        (
            [{"muscles": ["a", "b", "d"], "joints": ["j", "k"]}],
            "key 'board_groups': unknown muscle 'd', choose from: a, b, c",
        ),
    ],
)
def test_a_muscle_or_joint_without_its_one_group_is_refused(content: object, text: str) -> None:
    with pytest.raises(RobotDescriptionError) as caught:
        board_groups(content, MUSCLES, JOINTS)
    assert str(caught.value) == text


@pytest.mark.parametrize("content", [[], "a", [["a"]], [{"joints": ["j"]}], [{"muscles": []}]])
def test_another_form_is_refused_saying_which_is_right(content: object) -> None:
    with pytest.raises(RobotDescriptionError) as caught:
        board_groups(content, MUSCLES, JOINTS)
    assert str(caught.value) == (
        f"key 'board_groups' is {content!r}, "
        "expected a list of {muscles: [...], joints: [...]}, one for each bus"
    )
