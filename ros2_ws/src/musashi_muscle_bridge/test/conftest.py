"""Robots of the tests: Musashi's description, and a hoist that can be computed by hand."""

from pathlib import Path

import pytest

from fastswing_planner.robot.description import Robot, load_robot

DESCRIPTION = Path(__file__).parents[1] / "description" / "musashi_left_arm.yaml"

HOIST_MJCF = """
<mujoco>
  <option timestep="0.0005" gravity="0 0 -10"/>
  <worldbody>
    <site name="ceiling" pos="0 0 2"/>
    <site name="floor" pos="0 0 0"/>
    <body name="load" pos="0 0 1">
      <joint name="drop" type="slide" axis="0 0 -1" range="-0.5 0.9"/>
      <geom type="sphere" size="0.02" mass="2" contype="0" conaffinity="0"/>
      <site name="hook"/>
    </body>
  </worldbody>
  <tendon>
    <spatial name="up"><site site="ceiling"/><site site="hook"/></spatial>
    <spatial name="down"><site site="hook"/><site site="floor"/></spatial>
  </tendon>
</mujoco>
"""

HOIST_YAML = """
mjcf: hoist.xml
joints: [drop]
muscles: [up, down]
velocity_limit: 0.3
acceleration_limit: 0.5
tension_min: 1
tension_max: 50
tension_limit: 60
current_limit: 8
wire_stiffness: 7000
payload_body: load
postures: {home: [0.0], start: [-0.1], end: [0.1]}
plant: {wire_damping: 60, winch_mass: 4, winch_friction: 10, winch_damping: 40, \
force_per_current: 50}
"""


@pytest.fixture(scope="session")
def musashi() -> Robot:
    """Load the Musashi-like left arm as it is delivered."""
    return load_robot(DESCRIPTION)


@pytest.fixture(scope="session")
def hoist(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Build a hoist: `up` carries 2 kg, 20 N, `down` tethers it; both 1 m long at home."""
    folder = tmp_path_factory.mktemp("hoist")
    (folder / "hoist.xml").write_text(HOIST_MJCF)
    (folder / "hoist.yaml").write_text(HOIST_YAML)
    return load_robot(folder / "hoist.yaml")


@pytest.fixture(scope="session")
def crane(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Build the hoist with a hook that sways, which the description leaves out, in a keyframe."""
    folder = tmp_path_factory.mktemp("crane")
    swaying = (
        '<body name="block"><joint name="sway" axis="0 1 0"/>'
        '<geom size="0.02" pos="0 0 -0.1" mass="0.5" contype="0" conaffinity="0"/></body></body>'
    )
    mjcf = HOIST_MJCF.replace("</body>", swaying).replace(
        "</mujoco>", '<keyframe><key name="swung" qpos="0 0.4"/></keyframe></mujoco>'
    )
    (folder / "hoist.xml").write_text(mjcf)
    (folder / "hoist.yaml").write_text(HOIST_YAML + "keyframe: swung\n")
    return load_robot(folder / "hoist.yaml")
