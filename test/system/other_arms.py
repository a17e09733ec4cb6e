"""Arms that are not Musashi's, for tests."""

from pathlib import Path

TWO_LINK_ARM = Path(__file__).parents[1] / "data" / "two_link_arm.yaml"

_FINGER = """
    <site name="above{i}" pos="0 {y} 0.02"/>
    <site name="below{i}" pos="0 {y} -0.02"/>
    <body name="finger{i}" pos="0 {y} 0">
      <joint name="joint{i}" axis="0 1 0" range="-0.8 0.8" damping="0.05" armature="0.001"/>
      <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01" mass="0.05"
            contype="0" conaffinity="0"/>
      <site name="upper{i}" pos="0.05 0 0.02"/>
      <site name="lower{i}" pos="0.05 0 -0.02"/>
    </body>"""
_PAIR = """
    <spatial name="lift{i}"><site site="above{i}"/><site site="upper{i}"/></spatial>
    <spatial name="sink{i}"><site site="below{i}"/><site site="lower{i}"/></spatial>"""
_YAML = """mjcf: hand.xml
joints: [{joints}]
muscles: [{muscles}]
velocity_limit: 0.2
acceleration_limit: 0.5
tension_min: 1
tension_max: 50
tension_limit: 80
current_limit: 2
wire_stiffness: 4000
payload_body: finger0
postures: {{home: {home}}}
"""


def write_hand(folder: Path, fingers: int) -> Path:
    """Write a hand of so many fingers, one joint and two muscles each; return its YAML file."""
    numbers = range(fingers)
    bodies = "".join(_FINGER.format(i=i, y=0.03 * i) for i in numbers)
    pairs = "".join(_PAIR.format(i=i) for i in numbers)
    (folder / "hand.xml").write_text(
        '<mujoco><compiler angle="radian"/><option timestep="0.001"/>\n'
        f"  <worldbody>{bodies}\n  </worldbody>\n"
        f"  <tendon>{pairs}\n  </tendon></mujoco>\n"
    )
    path = folder / "hand.yaml"
    path.write_text(
        _YAML.format(
            joints=", ".join(f"joint{i}" for i in numbers),
            muscles=", ".join(f"{way}{i}" for i in numbers for way in ("lift", "sink")),
            home=[0.0] * fingers,
        )
    )
    return path
