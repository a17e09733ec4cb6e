"""What learn_model writes depends on the MJCF and the bag alone, and replaces nothing."""

from pathlib import Path

import numpy as np
import pytest

from fastswing_planner.commands.learn_model import learned, main, report, write_description
from fastswing_planner.learning.samples import MuscleSamples
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.learned_model import mjcf_hash
from fastswing_planner.robot.length_correction import save_correction

OFFSET = 0.004
"""[m] by which every muscle of the robot is longer than the MJCF says."""


def recorded(robot: Robot, count: int = 200) -> MuscleSamples:
    """Return samples of a motion around the start posture."""
    time = np.linspace(0.0, 20.0, count)
    rates = 0.5 + 0.3 * np.arange(len(robot.model.joint_names))
    position = robot.postures["start"] + 0.1 * np.sin(np.outer(time, rates))
    length = np.array([robot.model.lengths(row) for row in position]) + OFFSET
    return MuscleSamples(position, length, np.ones(length.shape, dtype=bool))


def test_learning_again_on_a_learned_robot_keeps_what_was_learned(
    description_path: Path, tmp_path: Path
) -> None:
    plain = load_robot(description_path)
    samples = recorded(plain)
    correction, _ = learned(plain, samples)
    save_correction(correction, tmp_path / "once.npz", mjcf_hash(plain.mjcf))
    write_description(plain, tmp_path / "once.yaml")
    again, _ = learned(load_robot(tmp_path / "once.yaml"), samples)
    at = samples.joint_position[50]
    np.testing.assert_array_equal(again.lengths(at), correction.lengths(at))


def test_a_constant_offset_is_an_error_of_the_mjcf(description_path: Path) -> None:
    robot = load_robot(description_path)
    samples = recorded(robot)
    table = report(*learned(robot, samples), samples).splitlines()
    assert [float(row.split()[1]) for row in table[-10:]] == [4.0] * 10


@pytest.mark.parametrize("suffix", [".yaml", ".npz"])
def test_what_exists_is_not_overwritten(
    tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]
) -> None:
    precious = tmp_path / f"arm{suffix}"
    precious.write_text("precious")
    assert main(["run.mcap", "-o", str(tmp_path / "arm.yaml")]) == 2
    assert capsys.readouterr().err == (
        f"learn_model: {precious} exists and is never overwritten; choose another --output\n"
    )
    assert precious.read_text() == "precious"


def test_an_included_file_is_a_part_of_the_mjcf(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text('<mujoco><include file="body.xml"/></mujoco>')
    (tmp_path / "body.xml").write_text("<mujoco/>")
    before = mjcf_hash(tmp_path / "arm.xml")
    (tmp_path / "body.xml").write_text("<mujoco><worldbody/></mujoco>")
    assert mjcf_hash(tmp_path / "arm.xml") != before
