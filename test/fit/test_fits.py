"""The fits judge, and say what the written arm reaches; the fits themselves take minutes."""

from pathlib import Path

import kinematic_fit
import numpy as np
import plant_fit
import pytest
from evolution import Fitted


def test_the_first_guess_of_the_arm_is_judged() -> None:
    robot = kinematic_fit.load_robot(kinematic_fit.ROBOT_YAML)
    judge = kinematic_fit.candidate_cost(robot, kinematic_fit.ROBOT_MJCF.read_text())
    assert np.isfinite(judge(np.zeros(len(kinematic_fit.PARAMETERS))))


def test_the_arm_that_is_written_is_reported_beside_the_paper() -> None:
    robot = kinematic_fit.load_robot(kinematic_fit.ROBOT_YAML)
    guess = Fitted(0, np.zeros(len(kinematic_fit.PARAMETERS)), np.inf)
    reached = kinematic_fit.summarise(robot, guess, seed=1)["reached"]
    rows = [line.split() for line in kinematic_fit.report_lines(reached)[1:]]
    assert [row[0] for row in rows] == ["basic", "inhibit", "elongate"]
    assert [float(row[1]) for row in rows] == pytest.approx([2.408, 4.390, 3.298], abs=0.002)


def test_the_first_guess_of_the_winches_is_judged(tmp_path: Path) -> None:
    robot = plant_fit.load_robot(plant_fit.ROBOT_YAML)
    judge = plant_fit.candidate_cost(robot, plant_fit.ROBOT_MJCF.read_text(), tmp_path)
    assert judge(plant_fit.first_guess()) < plant_fit.NEVER_BEGUN


def test_another_arm_begins_a_fit_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    before = plant_fit.description_digest()
    heavier = plant_fit.ROBOT_MJCF.read_text().replace('mass="12"', 'mass="13"')
    monkeypatch.setattr(plant_fit, "edited_mjcf", lambda _text, _values: heavier)
    assert plant_fit.description_digest() != before


@pytest.mark.parametrize("muscle", ["#1", "#6", "#8", "#9", "#10"])
def test_a_moment_arm_of_the_swing_is_smooth_and_keeps_its_sign(muscle: str) -> None:
    robot = kinematic_fit.load_robot(kinematic_fit.ROBOT_YAML)
    start, end = robot.postures["start"], robot.postures["end"]
    row = robot.model.muscle_names.index(muscle)
    way = [start + part * (end - start) for part in np.linspace(0.0, 1.0, 201)]
    joints = [0, 3] if muscle == "#9" else [0] if muscle == "#1" else [3]
    for joint in joints:
        arms = np.array([robot.model.jacobian(posture)[row, joint] for posture in way])
        assert np.isfinite(arms).all()
        assert abs(np.sign(arms).sum()) == arms.size
        # 201 postures: a jump would be many times the largest step of a smooth curve.
        assert np.abs(np.diff(arms)).max() < 0.002
