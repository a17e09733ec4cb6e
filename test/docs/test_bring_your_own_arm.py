"""docs/bring_your_own_arm.md, followed to the letter, ends with a swing of a three-muscle arm."""

import re
from pathlib import Path

import pytest
from followed_page import FollowedPage, read_page

from fastswing_planner.robot.description import load_robot

PAGE = read_page("bring_your_own_arm.md")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("my_arm")
    PAGE.write_files(made)
    return made


@pytest.fixture(scope="module")
def printed(folder: Path) -> str:
    return "\n".join(PAGE.run(folder, number) for number in range(len(PAGE.commands)))


def test_the_page_has_two_files_and_three_commands() -> None:
    assert isinstance(PAGE, FollowedPage)
    assert set(PAGE.files) == {"my_arm.xml", "my_arm.yaml"}
    assert len(PAGE.commands) == 3


def test_the_arm_has_three_muscles_over_one_joint(folder: Path) -> None:
    model = load_robot(folder / "my_arm.yaml").model
    assert model.muscle_names == ("biceps", "brachialis", "triceps")
    assert model.joint_names == ("elbow",)


@pytest.mark.parametrize("block", PAGE.promised)
def test_what_the_page_promises_is_printed(printed: str, block: str) -> None:
    assert block in printed


def test_paying_out_makes_the_simulated_swing_faster(printed: str) -> None:
    measured = {
        method: float(time)
        for method, time in re.findall(r"(\w+): predicted .* measured ([\d.]+) s", printed)
    }
    assert measured["elongate"] < measured["basic"]


def test_the_moment_arm_of_the_text_is_the_models(folder: Path) -> None:
    robot = load_robot(folder / "my_arm.yaml")
    middle = (robot.postures["start"] + robot.postures["end"]) / 2
    biceps = float(robot.model.jacobian(middle)[0, 0])
    assert round(biceps * 1000) == 76
