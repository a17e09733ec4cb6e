"""An arm of any size, for growth: two muscles across each joint, the rest across two joints."""

from pathlib import Path

_LINK = """
  <body name="link{i}" pos="0 {y} 0">
    <joint name="joint{i}" axis="0 1 0" range="-0.8 0.8" damping="0.05" armature="0.001"/>
    <geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01" mass="0.05"
          contype="0" conaffinity="0"/>
    <site name="upper{i}" pos="0.05 0 0.02"/>
    <site name="lower{i}" pos="0.05 0 -0.02"/>
  </body>
  <site name="above{i}" pos="0 {y} 0.02"/>
  <site name="below{i}" pos="0 {y} -0.02"/>"""
_WIRE = '<spatial name="m{number}">{sites}</spatial>'
_YAML = """mjcf: big_arm.xml
joints: [{joints}]
muscles: [{muscles}]
velocity_limit: 0.2
acceleration_limit: 0.5
tension_min: 1
tension_max: 50
tension_limit: 80
current_limit: 2
wire_stiffness: 4000
payload_body: link0
postures: {{home: {home}, start: {home}, end: {end}}}
"""


def write_big_arm(folder: Path, muscles: int = 74, joints: int = 33) -> Path:
    """Write an arm with `muscles` >= 2 * `joints`; return its YAML file."""
    if muscles < 2 * joints:
        raise ValueError(f"{muscles} muscles for {joints} joints, expected at least {2 * joints}")
    bodies = "".join(_LINK.format(i=i, y=0.03 * i) for i in range(joints))
    ways: list[tuple[str, ...]] = [(f"above{i}", f"upper{i}") for i in range(joints)]
    ways += [(f"below{i}", f"lower{i}") for i in range(joints)]
    for extra in range(muscles - 2 * joints):
        first = extra % (joints - 1)
        ways.append((f"above{first}", f"upper{first}", f"upper{first + 1}"))
    wires = "\n".join(
        _WIRE.format(number=number, sites="".join(f'<site site="{site}"/>' for site in way))
        for number, way in enumerate(ways)
    )
    (folder / "big_arm.xml").write_text(
        '<mujoco><compiler angle="radian"/><option timestep="0.001"/>\n'
        f"<worldbody>{bodies}\n</worldbody>\n<tendon>\n{wires}\n</tendon></mujoco>\n"
    )
    path = folder / "big_arm.yaml"
    path.write_text(
        _YAML.format(
            joints=", ".join(f"joint{i}" for i in range(joints)),
            muscles=", ".join(f"m{number}" for number in range(muscles)),
            home=[0.0] * joints,
            end=[0.3] * joints,
        )
    )
    return path
