"""Joints that equality constraints tie to chosen joints follow them, as MuJoCo itself means it."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.errors import RobotDescriptionError
from fastswing_planner.robot.joint_coupling import JointCoupling, refuse_restrained_joints

# Four links in a row, two of their hinges with a zero that is not where the MJCF draws them.
MJCF = """
<mujoco>
  <compiler angle="radian"/>
  <option jacobian="{jacobian}"><flag equality="{flag}"/></option>
  <worldbody>
    <body name="link_a">
      <joint name="a" axis="0 1 0" ref="0.2"/>
      <geom size="0.02" pos="0.1 0 0"/>
      <body name="link_b" pos="0.2 0 0">
        <joint name="b" axis="0 1 0"/>
        <geom size="0.02" pos="0.1 0 0"/>
        <body name="link_c" pos="0.2 0 0">
          <joint name="c" axis="0 0.6 0.8" ref="-0.1"/>
          <geom size="0.02" pos="0.1 0 0"/>
          <body name="link_d" pos="0.2 0 0">
            <joint name="d" axis="0 0 1"/>
            <geom size="0.02" pos="0.1 0 0"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <equality>{equality}</equality>
</mujoco>
"""
ALL = "abcd"
B_LEADS_C_LEADS_D = """
<joint joint1="d" joint2="c" polycoef="0.1 -0.5 0 0.2 0"/>
<joint joint1="c" joint2="b" polycoef="0.3 1.1 -0.4 0.2 0.1"/>
"""
ANGLE = st.floats(-1.5, 1.5)


def chain(equality: str, jacobian: str = "auto", flag: str = "enable") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        MJCF.format(equality=equality, jacobian=jacobian, flag=flag)
    )


def coupling(
    model: mujoco.MjModel, joints: str, reference: tuple[float, ...] = (0.0,) * 4
) -> JointCoupling:
    return JointCoupling(model, [ALL.index(name) for name in joints], np.array(reference))


def positions(
    model: mujoco.MjModel, joints: str, angles: list[float], **more: tuple[float, ...]
) -> Vector:
    """Return the angles of all four joints."""
    data = mujoco.MjData(model)
    coupling(model, joints, **more).set_positions(data.qpos, np.array(angles))
    return np.array(data.qpos)


def rates(model: mujoco.MjModel, joints: str, angles: list[float]) -> Matrix:
    return coupling(model, joints).set_positions(mujoco.MjData(model).qpos, np.array(angles))


def refusal(model: mujoco.MjModel, joints: str) -> str:
    """Return the text with which the choice of these joints is refused."""
    with pytest.raises(RobotDescriptionError) as caught:
        refuse_restrained_joints(model, coupling(model, joints), np.full(len(joints), 0.3))
    return str(caught.value)


@given(ANGLE, ANGLE)
def test_followers_satisfy_mujocos_own_constraints(first: float, second: float) -> None:
    model = chain(B_LEADS_C_LEADS_D)
    data = mujoco.MjData(model)
    coupling(model, "ab").set_positions(data.qpos, np.array([first, second]))
    mujoco.mj_forward(model, data)
    assert data.efc_pos.tolist() == pytest.approx([0.0, 0.0], abs=1e-12)


@given(ANGLE, ANGLE)
def test_rates_are_the_slope_of_the_positions(first: float, second: float) -> None:
    model, step = chain(B_LEADS_C_LEADS_D), 1e-6
    ahead = positions(model, "ab", [first, second + step])
    behind = positions(model, "ab", [first, second - step])
    slope = (ahead - behind) / (2 * step)
    assert rates(model, "ab", [first, second])[:, 1] == pytest.approx(slope, abs=1e-7)


def test_joints_that_nothing_ties_stay_at_the_reference() -> None:
    assert positions(chain(""), "b", [0.7], reference=(0.4, 0.0, 0.5, -0.6)).tolist() == [
        0.4,
        0.7,
        0.5,
        -0.6,
    ]


def test_a_follower_of_a_joint_left_out_is_where_its_leader_puts_it() -> None:
    model = chain('<joint joint1="d" joint2="b" polycoef="0 2 0 0 0"/>')
    assert positions(model, "a", [0.0], reference=(0.0, 0.4, 0.0, 0.0))[3] == pytest.approx(0.8)


def test_a_locked_joint_stays_at_its_constant() -> None:
    model = chain('<joint joint1="c" polycoef="0.4 0 0 0 0"/>')
    assert positions(model, "ab", [0.1, 0.2])[2] == pytest.approx(-0.1 + 0.4)  # from its ref


def test_a_locked_joint_does_not_move() -> None:
    model = chain('<joint joint1="c" polycoef="0.4 0 0 0 0"/>')
    assert rates(model, "ab", [0.1, 0.2])[2].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    "model",
    [
        chain('<joint joint1="b" joint2="a" active="false"/>'),
        chain('<joint joint1="b" joint2="a"/>', flag="disable"),
    ],
)
def test_an_equality_that_is_switched_off_ties_nothing(model: mujoco.MjModel) -> None:
    assert positions(model, "ab", [0.5, -0.3])[:2].tolist() == [0.5, -0.3]


@pytest.mark.parametrize("switch", ['active="false"', ""])
def test_a_weld_that_is_switched_off_restrains_nothing(switch: str) -> None:
    flag = "enable" if switch else "disable"
    model = chain(f'<weld body1="link_b" {switch}/>', flag=flag)
    refuse_restrained_joints(model, coupling(model, "ab"), np.array([0.1, 0.2]))


def test_a_weld_beyond_the_chosen_joints_restrains_nothing() -> None:
    model = chain('<weld body1="link_c" body2="link_d"/>')
    refuse_restrained_joints(model, coupling(model, "ab"), np.array([0.1, 0.2]))


def test_a_follower_is_refused_and_its_leader_named() -> None:
    text = "joint 'c' follows joint 'b': choose 'b' instead"
    assert refusal(chain(B_LEADS_C_LEADS_D), "ac") == text


def test_two_chosen_joints_tied_together_are_refused() -> None:
    text = "joint 'c' follows joint 'b', which is chosen too: leave 'c' out"
    assert refusal(chain(B_LEADS_C_LEADS_D), "cb") == text


def test_a_locked_joint_is_refused() -> None:
    text = "joint 'b' is locked by an equality constraint: leave it out"
    assert refusal(chain('<joint joint1="b"/>'), "ab") == text


def test_joints_that_follow_each_other_in_a_circle_are_refused() -> None:
    model = chain(
        '<joint joint1="d" joint2="c"/><joint joint1="b" joint2="c"/><joint joint1="c" joint2="b"/>'
    )
    assert refusal(model, "a") == (
        "the joints b, c follow each other in a circle: make one of their equality constraints "
        "inactive in the MJCF"
    )


@pytest.mark.parametrize("jacobian", ["dense", "sparse"])
@pytest.mark.parametrize(
    ("equality", "called"),
    [
        ('<connect name="grip" body1="link_c" anchor="0.1 0 0"/>', "'grip'"),
        ('<joint joint1="d"/><weld body1="link_b"/>', "number 1"),
    ],
)
def test_a_constraint_that_restrains_a_chosen_joint_is_named(
    equality: str, called: str, jacobian: str
) -> None:
    assert refusal(chain(equality, jacobian), "ab") == (
        f"the equality constraint {called} restrains the chosen joints: choose joints that move "
        "freely, or make the constraint inactive in the MJCF"
    )
