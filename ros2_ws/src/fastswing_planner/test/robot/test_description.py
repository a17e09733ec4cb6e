"""A robot's description is read completely, or the text names file, key and value."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from fastswing_planner.errors import RobotDescriptionError
from fastswing_planner.robot.description import Robot, load_robot

MJCF = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <site name="roof" pos="0.1 0 0.1"/>
    <site name="wall" pos="-0.1 0 0.1"/>
    <body name="rod">
      <joint name="hinge" axis="0 1 0" limited="true" range="-1 2"/>
      <geom size="0.03" pos="0 0 -0.3" mass="0.8"/>
      <site name="end" pos="0 0 -0.2"/>
      <body name="tool" pos="0 0 -0.6">
        <joint name="wrist" axis="0 1 0"/>
        <geom size="0.03" pos="0.1 0 0" mass="0.5"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="left"><site site="roof"/><site site="end"/></spatial>
    <spatial name="right"><site site="wall"/><site site="end"/></spatial>
  </tendon>
  <keyframe><key name="folded" qpos="0 1.5"/></keyframe>
</mujoco>
"""
CONTENT = {
    "mjcf": "arm.xml",
    "joints": ["hinge"],
    "muscles": ["right", "left"],
    "velocity_limit": 0.3,
    "acceleration_limit": [0.4, 0.5],
    "tension_min": 10,
    "tension_max": 200,
    "tension_limit": [300, 400],
    "current_limit": 8,
    "wire_stiffness": 7000,
    "payload_body": "rod",
    "postures": {"home": [0.0], "up": [1.5]},
}
KEYS = ", ".join([*CONTENT, "keyframe", "plant", "board_groups", "learned_muscles"])


def written(folder: Path, **changes: Any) -> Path:
    """Write the description with some keys replaced, or left out if None; return its path."""
    (folder / "arm.xml").write_text(MJCF)
    content = {key: value for key, value in {**CONTENT, **changes}.items() if value is not None}
    path = folder / "robot.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def refusal(path: Path) -> str:
    """Return the text with which a description is refused."""
    with pytest.raises(RobotDescriptionError) as caught:
        load_robot(path)
    return str(caught.value)


def test_names_are_in_the_yamls_order(tmp_path: Path) -> None:
    assert load_robot(written(tmp_path)).model.muscle_names == ("right", "left")


def test_a_single_number_counts_for_every_muscle(tmp_path: Path) -> None:
    assert load_robot(written(tmp_path)).wire_stiffness.tolist() == [7000.0, 7000.0]


def test_a_list_counts_muscle_by_muscle(tmp_path: Path) -> None:
    robot = load_robot(written(tmp_path))
    assert robot.tension_limit.tolist() == [300.0, 400.0]
    assert robot.limits.acceleration.tolist() == [0.4, 0.5]


def test_postures_are_read_by_name(tmp_path: Path) -> None:
    postures = load_robot(written(tmp_path)).postures
    assert {name: angles.tolist() for name, angles in postures.items()} == CONTENT["postures"]


def test_the_mjcf_lies_beside_the_yaml(tmp_path: Path) -> None:
    assert load_robot(written(tmp_path)).mjcf == tmp_path / "arm.xml"


def test_a_robot_without_plant_has_no_plants_constants(tmp_path: Path) -> None:
    assert load_robot(written(tmp_path)).plant == {}


def test_a_plants_constants_are_kept(tmp_path: Path) -> None:
    assert load_robot(written(tmp_path, plant={"friction": 29})).plant == {"friction": 29}


def test_joints_left_out_are_at_zero_without_a_keyframe(tmp_path: Path) -> None:
    torque = load_robot(written(tmp_path)).model.gravity_torque(np.zeros(1))
    assert torque == pytest.approx([-0.1 * 0.5 * 9.81])


def test_joints_left_out_are_where_the_keyframe_has_them(tmp_path: Path) -> None:
    torque = load_robot(written(tmp_path, keyframe="folded")).model.gravity_torque(np.zeros(1))
    assert torque == pytest.approx([-0.1 * np.cos(1.5) * 0.5 * 9.81])


def test_a_misspelt_key_is_named_as_it_stands(tmp_path: Path) -> None:
    path = written(tmp_path, velocity_limit=None, velocty_limit=0.2)
    assert refusal(path).startswith(f"{path}: unknown key 'velocty_limit', choose from: mjcf, ")


@pytest.mark.parametrize("key", list(CONTENT))
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    path = written(tmp_path, **{key: None})
    assert refusal(path) == f"{path}: key '{key}' is missing"


def test_an_unknown_key_lists_the_choices(tmp_path: Path) -> None:
    path = written(tmp_path, colour="red")
    assert refusal(path) == f"{path}: unknown key 'colour', choose from: {KEYS}"


def test_a_missing_file_says_what_to_set(tmp_path: Path) -> None:
    path = tmp_path / "none.yaml"
    assert refusal(path) == (
        f"{path}: no such file; give the YAML file of your robot: robot_description, --robot"
    )


def test_an_mjcf_in_place_of_the_yaml_is_told_so(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text("<mujoco/>")
    assert refusal(path) == f"{path}: give the YAML file beside this MJCF, not itself"


@pytest.mark.parametrize("content", ["", "- a", "42"])
def test_a_file_that_is_no_mapping_says_what_is_expected(tmp_path: Path, content: str) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(content)
    expected = ", ".join(CONTENT)
    assert refusal(path) == f"{path}: expected a mapping with {expected}"


@pytest.mark.parametrize("content", [b"{", b"\xff\xfe\xfa", b"mjcf: \x00"])
def test_a_file_that_is_no_yaml_is_named(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "robot.yaml"
    path.write_bytes(content)
    assert refusal(path).startswith(f"{path}: not a readable YAML file: ")
    assert "\n" not in refusal(path)


def test_a_folder_is_no_description(tmp_path: Path) -> None:
    assert refusal(tmp_path).startswith(f"{tmp_path}: not a readable YAML file: ")


def test_a_missing_mjcf_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, mjcf="other.xml")
    assert refusal(path) == (
        f"{path}: key 'mjcf' is 'other.xml': {tmp_path / 'other.xml'} is no file; "
        "write the MJCF's path, seen from this file's folder"
    )


@pytest.mark.parametrize(
    "broken",
    [
        MJCF.replace("</mujoco>", ""),
        MJCF.replace("tendon>", "tendons>"),
        MJCF.replace('site="end"/></spatial>', 'site="tip"/></spatial>'),
    ],
    ids=["unclosed", "element", "site"],
)
def test_a_broken_mjcf_is_named_in_one_line(tmp_path: Path, broken: str) -> None:
    path = written(tmp_path)
    (tmp_path / "arm.xml").write_text(broken)
    text = refusal(path)
    assert text.startswith(f"{path}: {tmp_path / 'arm.xml'}: not a usable MJCF: ")
    assert "\n" not in text


def test_a_range_in_the_wrong_order_is_named(tmp_path: Path) -> None:
    path = written(tmp_path)
    reversed_range = MJCF.replace('limited="true" range="-1 2"', 'range="2 -1"')
    (tmp_path / "arm.xml").write_text(reversed_range)
    assert refusal(path) == (
        f"{path}: joint 'hinge' has the range 2 to -1 in the MJCF, the lower end comes first"
    )


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"joints": "hinge"}, "key 'joints' is 'hinge', expected a list of names"),
        ({"muscles": [1, 2]}, "key 'muscles' is [1, 2], expected a list of names"),
        (
            {"joints": ["elbow"]},
            "the MJCF does not fit: unknown joint 'elbow', choose from: hinge, wrist",
        ),
        (
            {"muscles": ["left", "middle"]},
            "the MJCF does not fit: unknown muscle 'middle', choose from: left, right",
        ),
        (
            {"muscles": ["left", "left"]},
            "the MJCF does not fit: muscle 'left' is named more than once",
        ),
        ({"velocity_limit": [0.3, -1]}, "velocity_limit of left is -1 m/s, must be positive"),
        (
            {"velocity_limit": "fast"},
            "key 'velocity_limit' is 'fast', expected one number, or 2 for right, left",
        ),
        (
            {"tension_limit": True},
            "key 'tension_limit' is True, expected one number, or 2 for right, left",
        ),
        (
            {"wire_stiffness": [[1, 2], [3, 4]]},
            "key 'wire_stiffness' is [[1, 2], [3, 4]], expected one number, or 2 for right, left",
        ),
        (
            {"current_limit": 10**400},
            "key 'current_limit' of right is inf, expected a finite number",
        ),
        (
            {"tension_max": 350},
            "key 'tension_limit' of right is 300 N, must not be below its tension_max 350 N: "
            "the boards would pay out what a plan asks for",
        ),
        ({"joints": []}, "key 'joints' is [], expected a list of names"),
        ({"muscles": []}, "key 'muscles' is [], expected a list of names"),
        ({"plant": [5]}, "key 'plant' is [5], expected a mapping of constants"),
        (
            {"postures": {"up": [0.0]}},
            "key 'postures' lacks 'home', the posture of an arm at rest",
        ),
        (
            {"postures": {"home": [0.0], "up": [2.5]}},
            "posture 'up' of hinge is 2.5 rad, the MJCF allows -1 to 2",
        ),
        (
            {"tension_min": 250},
            "tension_max of right is 200 N, must be above its tension_min 250 N",
        ),
        ({"wire_stiffness": 0}, "key 'wire_stiffness' is 0, must be positive"),
        (
            {"current_limit": [8]},
            "key 'current_limit' is [8], expected one number, or 2 for right, left",
        ),
        (
            {"payload_body": "hand"},
            "key 'payload_body': unknown body 'hand', choose from: world, rod, tool",
        ),
        ({"payload_body": ["rod"]}, "key 'payload_body' is ['rod'], expected a name"),
        ({"keyframe": "up"}, "unknown keyframe 'up', choose from: folded"),
        ({"keyframe": 3}, "key 'keyframe' is 3, expected a name"),
        ({"postures": [0.0]}, "key 'postures' must map names to lists of angles [rad]"),
        (
            {"postures": {"home": [0.0, 1.0]}},
            "posture 'home' has 2 values, expected 1: hinge",
        ),
        (
            {"postures": {"home": [float("nan")]}},
            "posture 'home' of hinge is nan, expected a finite number",
        ),
    ],
)
def test_a_wrong_value_is_named(tmp_path: Path, change: dict[str, Any], text: str) -> None:
    path = written(tmp_path, **change)
    assert refusal(path) == f"{path}: {text}"


@pytest.mark.parametrize(
    "postures", [{"home": ["up"]}, {"home": {"hinge": 0.0}}, {"home": [[0.0], [0.0, 1.0]]}]
)
def test_a_posture_that_is_no_list_of_numbers_is_named(tmp_path: Path, postures: object) -> None:
    path = written(tmp_path, postures=postures)
    assert refusal(path).startswith(f"{path}: posture 'home' ")


def test_the_musashi_description_names_joints_and_muscles_as_the_paper(musashi: Robot) -> None:
    assert musashi.model.joint_names == ("S-p", "S-r", "S-y", "E-p", "E-y")
    assert musashi.model.muscle_names == tuple(f"#{number}" for number in range(1, 11))


@pytest.mark.parametrize(
    ("limit", "value"),
    [("velocity", 0.30), ("acceleration", 0.46), ("tension_min", 10.0), ("tension_max", 200.0)],
)
def test_the_musashi_description_has_the_papers_limits(
    musashi: Robot, limit: str, value: float
) -> None:
    assert getattr(musashi.limits, limit).tolist() == [value] * 10


def test_the_musashi_postures_are_within_the_joints_ranges(musashi: Robot) -> None:
    for angles in musashi.postures.values():
        assert np.all(angles >= musashi.model.joint_lower)
        assert np.all(angles <= musashi.model.joint_upper)
