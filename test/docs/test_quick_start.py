"""docs/quick_start.md: its commands run, and its goal is one that the action takes."""

import re

import pytest
import yaml
from followed_page import DOCS, read_page

from fastswing_msgs.action import ExecuteSwing
from fastswing_planner.planning.request import Method
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI

PAGE = read_page("quick_start.md")


@pytest.mark.parametrize("number", range(len(PAGE.commands)))
def test_each_command_runs(number: int, tmp_path_factory: pytest.TempPathFactory) -> None:
    assert PAGE.run(tmp_path_factory.mktemp("quick_start"), number)


def test_the_goal_of_the_page_is_method_1_between_the_robots_postures() -> None:
    text = (DOCS / "quick_start.md").read_text()
    (goal,) = re.findall(r'"(\{stamp: .*?\})"', text, re.DOTALL)
    fields = yaml.safe_load(re.sub(r"\$\(date [^)]*\)", "1", goal))
    made = ExecuteSwing.Goal()
    assert set(fields) <= set(made.get_fields_and_field_types())
    assert fields["options"] == {"method": Method.INHIBIT.value}
    postures = load_robot(MUSASHI).postures
    assert fields["start_position"] == pytest.approx(postures["start"])
    assert fields["end_position"] == pytest.approx(postures["end"])
