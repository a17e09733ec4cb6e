"""A MuJoCo model's statics agree with its geometry, whatever joints and tendons are chosen."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.errors import RobotDescriptionError, UnknownName
from fastswing_planner.planning.speed_index import plain_speed_index
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.mujoco_model import MujocoMuscleModel, load_mjcf
from fastswing_planner.robot.muscle_model import MuscleModel, Payload

# A slider, two hinges that are not in the order of the tendons, a ball that nobody chooses.
MJCF = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="1.5 -0.7 -9.81"/>
  <worldbody>
    <site name="ground" pos="0.3 0 0.4"/>
    <body name="cart" pos="0 0 0.5">
      <joint name="rail" type="slide" axis="1 0 0"/>
      <geom size="0.05" mass="1.3"/>
      <site name="deck" pos="0.05 0.02 0.04"/>
      <body name="head" pos="-0.2 0 0">
        <joint name="neck" type="ball"/>
        <geom size="0.04" mass="0.4" pos="0 0 0.1"/>
        <site name="ear" pos="0 0.04 0.1"/>
      </body>
      <body name="rod">
        <joint name="hinge" axis="0 1 0" limited="true" range="-1 2"/>
        <geom size="0.03" pos="0.1 0 -0.3" mass="0.8"/>
        <site name="side" pos="0.04 0.01 -0.2"/>
        <body name="tip" pos="0 0 -0.5">
          <joint name="twist" axis="0.6 0 0.8"/>
          <geom size="0.03" pos="0.1 0.1 0" mass="0.5"/>
          <site name="end" pos="0.05 0.03 -0.1"/>
        </body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="long"><site site="ground"/><site site="end"/></spatial>
    <spatial name="idle"><site site="deck"/><site site="ear"/></spatial>
    <spatial name="bent"><site site="deck"/><site site="side"/><site site="end"/></spatial>
  </tendon>
</mujoco>
"""
# Two stretched links, with a body and a tendon that have no names and an actuator that drives both.
TWO_LINK = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <site name="origin" pos="0 0 0"/>
    <site name="top" pos="0.01 0 0.1"/>
    <body name="upper_arm">
      <joint name="shoulder" axis="0 -1 0"/>
      <geom size="0.02" pos="0 0 -0.2" mass="1"/>
      <site name="start" pos="0 0 0"/>
      <site name="middle" pos="0.05 0 -0.1"/>
      <body pos="0 0 -0.3">
        <joint name="elbow" axis="0 -1 0"/>
        <geom size="0.02" pos="0 0 -0.2" mass="1"/>
        <site name="ulna" pos="0 0 -0.1"/>
        <site name="wrist_start" pos="0.013 0.021 -0.2"/>
        <site name="wrist_end" pos="-0.017 0.019 -0.37"/>
      </body>
    </body>
  </worldbody>
  <tendon>
    <spatial name="flexor"><site site="top"/><site site="middle"/></spatial>
    <spatial><site site="top"/><site site="ulna"/></spatial>
    <spatial name="long"><site site="start"/><site site="ulna"/></spatial>
    <spatial name="wrist"><site site="wrist_start"/><site site="wrist_end"/></spatial>
    <fixed name="coupled"><joint joint="shoulder" coef="0.03"/></fixed>
  </tendon>
  <actuator><motor joint="elbow"/><motor tendon="long"/></actuator>
  <keyframe><key name="bent" qpos="0.1 1.2"/></keyframe>
</mujoco>
"""
JOINTS, MUSCLES = ("twist", "rail", "hinge"), ("bent", "long")
PAYLOAD = Payload(1.7, "hand", (0.03, -0.02, -0.05))
ANGLE = st.floats(-0.9, 0.9)
SPEED = st.floats(-5.0, 5.0)


def cart_model(joints: tuple[str, ...] = JOINTS, muscles: tuple[str, ...] = MUSCLES) -> MuscleModel:
    return MujocoMuscleModel(mujoco.MjModel.from_xml_string(MJCF), joints, muscles)


def musashi_posture(musashi: Robot, shares: list[float]) -> Vector:
    """Return the posture with the given shares, 0 to 1, of each joint's range."""
    low, high = musashi.model.joint_lower, musashi.model.joint_upper
    return np.asarray(low + np.array(shares) * (high - low))


def differences(model: MuscleModel, position: Vector, step: float) -> Matrix:
    """Return d length / d joint by central differences, shape (m, n)."""
    columns = [
        (model.lengths(position + step * axis) - model.lengths(position - step * axis)) / (2 * step)
        for axis in np.eye(position.size)
    ]
    return np.array(columns).T


def potential_energy(model: mujoco.MjModel, joints: dict[str, float], payload: Payload) -> float:
    """Return -sum of m g . x of all bodies and the payload [J], by plain forward kinematics."""
    data = mujoco.MjData(model)
    for name, angle in joints.items():
        data.joint(name).qpos[0] = angle
    mujoco.mj_forward(model, data)
    body = data.body(payload.body)
    point = body.xpos + body.xmat.reshape(3, 3) @ np.array(payload.position)
    gravity = model.opt.gravity
    energy = -sum(
        mass * gravity @ centre for mass, centre in zip(model.body_mass, data.xipos, strict=True)
    )
    return float(energy - payload.mass * gravity @ point)


def energy_slope(
    model: mujoco.MjModel, names: tuple[str, ...], at: Vector, load: Payload
) -> Vector:
    """Return d energy / d joint [N m] by central differences, shape (n,)."""
    step = 1e-5

    def energy(position: Vector) -> float:
        return potential_energy(model, dict(zip(names, position.tolist(), strict=True)), load)

    slopes = [
        (energy(at + step * axis) - energy(at - step * axis)) / (2 * step)
        for axis in np.eye(at.size)
    ]
    return np.array(slopes)


@given(st.lists(ANGLE, min_size=3, max_size=3))
def test_the_jacobian_is_the_slope_of_the_lengths(angles: list[float]) -> None:
    model, position = cart_model(), np.array(angles)
    assert model.jacobian(position) == pytest.approx(differences(model, position, 1e-6), abs=1e-8)


# Right at the end of a wrap the slope jumps; the fit's pulleys are not left within these shares.
@given(st.lists(st.floats(0.3, 0.7), min_size=5, max_size=5))
def test_musashis_jacobian_is_the_slope_of_its_lengths(musashi: Robot, shares: list[float]) -> None:
    position = musashi_posture(musashi, shares)
    slope = differences(musashi.model, position, 1e-6)
    assert musashi.model.jacobian(position) == pytest.approx(slope, abs=1e-6)


@given(st.lists(ANGLE, min_size=3, max_size=3), st.lists(SPEED, min_size=3, max_size=3))
def test_muscles_lengthen_as_the_jacobian_says(angles: list[float], speeds: list[float]) -> None:
    model = cart_model(muscles=("long", "bent", "idle"))
    expected = model.jacobian(np.array(angles)) @ speeds
    assert model.muscle_velocity(angles, speeds) == pytest.approx(expected, abs=1e-8)


@given(st.lists(ANGLE, min_size=2, max_size=2), st.lists(SPEED, min_size=2, max_size=2))
def test_muscles_lengthen_so_too_if_joints_before_the_chosen_are_left_out(
    angles: list[float], speeds: list[float]
) -> None:
    model = cart_model(("hinge", "twist"))
    expected = model.jacobian(np.array(angles)) @ speeds
    assert model.muscle_velocity(angles, speeds) == pytest.approx(expected, abs=1e-8)


@given(
    st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5), st.lists(SPEED, min_size=5, max_size=5)
)
def test_musashis_muscles_lengthen_as_its_jacobian_says(
    musashi: Robot, shares: list[float], speeds: list[float]
) -> None:
    position = musashi_posture(musashi, shares)
    expected = musashi.model.jacobian(position) @ speeds
    muscle_velocity = musashi.model.muscle_velocity(position.tolist(), speeds)
    assert muscle_velocity == pytest.approx(expected, abs=1e-8)


def test_a_muscle_that_does_not_move_has_no_speed_index_at_all() -> None:
    model = cart_model(muscles=("long", "idle"))
    moment_arm = model.muscle_velocity([0.1, 0.2, 0.3], [0.6, 0.0, -0.8])
    moved, idle = plain_speed_index(moment_arm, [0.1, 0.1])
    assert moved != 0.0
    assert idle == 0.0


@given(st.lists(ANGLE, min_size=3, max_size=3))
def test_gravity_is_the_slope_of_the_potential_energy(angles: list[float]) -> None:
    slope = energy_slope(
        mujoco.MjModel.from_xml_string(MJCF), JOINTS, np.array(angles), Payload(0.0, "tip")
    )
    assert cart_model().gravity_torque(np.array(angles)) == pytest.approx(slope, abs=1e-6)


@given(st.lists(ANGLE, min_size=3, max_size=3), st.floats(0.1, 5.0))
def test_a_payload_adds_its_potential_energy(angles: list[float], mass: float) -> None:
    load = Payload(mass, "tip", (0.1, -0.2, 0.05))
    slope = energy_slope(mujoco.MjModel.from_xml_string(MJCF), JOINTS, np.array(angles), load)
    assert cart_model().gravity_torque(np.array(angles), load) == pytest.approx(slope, abs=1e-6)


@given(st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5))
def test_musashis_gravity_and_payload_are_the_slope_of_the_energy(
    musashi: Robot, shares: list[float]
) -> None:
    position = musashi_posture(musashi, shares)
    plain = mujoco.MjModel.from_xml_path(str(musashi.mjcf))
    slope = energy_slope(plain, musashi.model.joint_names, position, PAYLOAD)
    assert musashi.model.gravity_torque(position, PAYLOAD) == pytest.approx(slope, abs=1e-6)


def test_a_weightless_payload_changes_nothing(musashi: Robot) -> None:
    start = musashi.postures["start"]
    without = musashi.model.gravity_torque(start)
    assert musashi.model.gravity_torque(start, Payload(0.0, "hand")).tolist() == without.tolist()


def test_the_unknown_body_of_a_payload_lists_the_choices() -> None:
    with pytest.raises(UnknownName) as caught:
        cart_model().gravity_torque(np.zeros(3), Payload(1.0, "foot"))
    text = "unknown body 'foot', choose from: world, cart, head, rod, tip"
    assert str(caught.value) == text


@given(st.permutations(JOINTS), st.permutations(["long", "bent", "idle"]))
def test_rows_and_columns_follow_the_chosen_order(joints: list[str], muscles: list[str]) -> None:
    position = {"twist": 0.3, "rail": -0.2, "hinge": 0.5}
    reference = cart_model(JOINTS, ("long", "bent", "idle")).jacobian(
        np.array([position[name] for name in JOINTS])
    )
    shuffled = cart_model(tuple(joints), tuple(muscles)).jacobian(
        np.array([position[name] for name in joints])
    )
    rows = [("long", "bent", "idle").index(name) for name in muscles]
    columns = [JOINTS.index(name) for name in joints]
    assert shuffled.tolist() == reference[np.ix_(rows, columns)].tolist()


@given(st.permutations(JOINTS), st.permutations(["long", "bent", "idle"]))
def test_speeds_follow_the_chosen_order(joints: list[str], muscles: list[str]) -> None:
    state = {"twist": (0.3, 1.0), "rail": (-0.2, 0.5), "hinge": (0.5, -2.0)}
    speeds = []
    for names, chosen in ((JOINTS, ("long", "bent", "idle")), (joints, muscles)):
        position, velocity = zip(*(state[name] for name in names), strict=True)
        model = cart_model(tuple(names), tuple(chosen))
        speeds.append(dict(zip(chosen, model.muscle_velocity(position, velocity), strict=True)))
    assert speeds[0] == speeds[1]


def test_a_call_leaves_nothing_behind_for_the_next() -> None:
    model, first, second = cart_model(), np.array([0.1, 0.2, 0.3]), np.array([-0.5, 0.4, 0.9])
    alone = [model.lengths(first).tolist(), model.gravity_torque(first).tolist()]
    model.jacobian(second)
    model.gravity_torque(second)
    model.muscle_velocity(second.tolist(), [3.0, -2.0, 1.0])
    assert [model.lengths(first).tolist(), model.gravity_torque(first).tolist()] == alone


def test_a_muscle_of_other_joints_has_no_moment_arm() -> None:
    model = cart_model(muscles=("long", "idle"))
    assert model.jacobian(np.ones(3))[1].tolist() == [0.0, 0.0, 0.0]


def test_joint_ranges_come_from_the_mjcf() -> None:
    model = cart_model()
    assert model.joint_lower.tolist() == [-np.inf, -np.inf, -1.0]
    assert model.joint_upper.tolist() == [np.inf, np.inf, 2.0]


@pytest.mark.parametrize(
    ("joints", "muscles", "text"),
    [
        (
            ("knee",),
            MUSCLES,
            "the MJCF does not fit: unknown joint 'knee', choose from: rail, neck, hinge, twist",
        ),
        (
            JOINTS,
            ("short",),
            "the MJCF does not fit: unknown muscle 'short', choose from: long, idle, bent",
        ),
        (
            ("rail", "rail"),
            MUSCLES,
            "the MJCF does not fit: joint 'rail' is named more than once",
        ),
        (("neck",), MUSCLES, "joint 'neck' is not a hinge or slide joint"),
    ],
)
def test_a_choice_that_does_not_fit_is_named(
    joints: tuple[str, ...], muscles: tuple[str, ...], text: str
) -> None:
    with pytest.raises(RobotDescriptionError) as caught:
        cart_model(joints, muscles)
    assert str(caught.value) == text


def two_link(**changes: Any) -> MujocoMuscleModel:
    """Return the arm below, its MJCF changed by the texts that replace others."""
    text = TWO_LINK
    for old, new in changes.get("replaced", {}).items():
        text = text.replace(old, new)
    return MujocoMuscleModel(
        mujoco.MjModel.from_xml_string(text),
        changes.get("joints", ("shoulder",)),
        changes.get("muscles", ("flexor",)),
        changes.get("keyframe", ""),
    )


def two_link_refusal(**changes: Any) -> str:
    with pytest.raises(RobotDescriptionError) as caught:
        two_link(**changes)
    return str(caught.value)


def test_joints_left_out_are_at_zero() -> None:
    length = two_link(muscles=("flexor", "long")).lengths(np.array([0.3]))
    both = two_link(joints=("shoulder", "elbow"), muscles=("flexor", "long"))
    assert length.tolist() == both.lengths(np.array([0.3, 0.0])).tolist()


def test_joints_left_out_are_where_the_keyframe_has_them() -> None:
    length = two_link(muscles=("flexor", "long"), keyframe="bent").lengths(np.array([0.3]))
    both = two_link(joints=("shoulder", "elbow"), muscles=("flexor", "long"))
    assert length.tolist() == both.lengths(np.array([0.3, 1.2])).tolist()


def test_the_full_position_holds_the_joints_left_out_too() -> None:
    model = two_link(muscles=("flexor", "long"), keyframe="bent")
    assert model.full_position(np.array([0.3])).tolist() == [0.3, 1.2]


def test_the_joints_left_out_are_named_with_where_they_stay() -> None:
    assert two_link(muscles=("flexor", "long"), keyframe="bent").held_joints() == {"elbow": 1.2}


def test_an_unknown_keyframe_lists_the_choices() -> None:
    text = "unknown keyframe 'relaxed', choose from: bent"
    assert two_link_refusal(keyframe="relaxed") == text


def test_a_keyframe_of_a_model_that_has_none_is_refused() -> None:
    text = "unknown keyframe 'bent', choose from: none: the MJCF names no keyframe"
    assert two_link_refusal(keyframe="bent", replaced={' name="bent"': ""}) == text


def test_a_model_without_tendons_is_refused() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    with pytest.raises(RobotDescriptionError) as caught:
        MujocoMuscleModel(model, ("shoulder",), ("flexor",))
    assert str(caught.value) == "the MJCF has no tendons: give each muscle a <tendon>"


def test_a_model_whose_tendons_move_nothing_is_refused() -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><site name='a'/><site name='b' pos='1 0 0'/><body><joint name='j'/>"
        "<geom size='0.1'/></body></worldbody><tendon><spatial name='m'><site site='a'/>"
        "<site site='b'/></spatial></tendon></mujoco>"
    )
    with pytest.raises(RobotDescriptionError):
        MujocoMuscleModel(model, ("j",), ("m",))


def test_a_posture_that_is_no_number_has_no_moment_arms(musashi: Robot) -> None:
    nowhere = np.full(len(musashi.model.joint_names), np.nan)
    arms = musashi.model.jacobian(nowhere)
    assert np.isnan(arms).any()


def test_no_joint_is_no_arm() -> None:
    assert two_link_refusal(joints=()) == "no joint is chosen: name at least one"


def test_no_muscle_is_no_arm() -> None:
    assert two_link_refusal(muscles=()) == "no muscle is chosen: name at least one"


def test_what_has_no_name_is_no_choice() -> None:
    text = "the MJCF does not fit: unknown muscle '', choose from: flexor, long, wrist, coupled"
    assert two_link_refusal(muscles=("",)) == text


def test_a_body_without_a_name_carries_no_payload() -> None:
    assert two_link().body_names == ("world", "upper_arm")


def test_a_muscle_without_length_is_refused() -> None:
    assert two_link_refusal(
        replaced={'"top"/><site site="middle"': '"origin"/><site site="start"'}
    ) == ("muscle 'flexor' has a length of 0 m: its sites coincide")


def test_a_fixed_tendon_may_have_no_length() -> None:
    assert two_link(muscles=("coupled",)).lengths(np.zeros(1)).tolist() == [0.0]


def test_a_joint_that_no_muscle_moves_is_refused() -> None:
    assert two_link_refusal(joints=("shoulder", "elbow")) == (
        "the muscle Jacobian is singular: no chosen muscle moves joint 'elbow'; leave the joint "
        "out or add its muscles"
    )


def test_a_muscle_without_moment_arm_at_zero_only_is_a_muscle() -> None:
    model = two_link(joints=("elbow",), muscles=("long",))
    assert model.jacobian(np.zeros(1)).tolist() == [[0.0]]


def test_a_muscle_beyond_the_chosen_joints_does_not_move_at_all() -> None:
    model = two_link(muscles=("flexor", "wrist"))
    for angle in np.linspace(-1.0, 1.0, 9):
        assert model.jacobian(np.array([angle]))[1].tolist() == [0.0]


def test_springs_count_in_what_holds_the_arm() -> None:
    plain = two_link().gravity_torque(np.array([0.5]))
    sprung = two_link(replaced={'name="shoulder"': 'name="shoulder" stiffness="3"'})
    assert sprung.gravity_torque(np.array([0.5])) == pytest.approx(plain + 3 * 0.5)


def test_a_file_that_is_no_mjcf_is_named(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text("<arm/>")
    with pytest.raises(RobotDescriptionError) as caught:
        load_mjcf(path)
    assert str(caught.value).startswith(f"{path}: not a usable MJCF: ")
