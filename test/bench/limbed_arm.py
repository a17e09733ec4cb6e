"""Arms of any size: limbs of up to three joints, with muscles across one and two."""

from pathlib import Path

_LIMB = 3  # joints
_ROOM = 0.08  # [m] between limbs
_SITE = 0.03  # [m] from a joint to where its muscles begin and end
_SWING = 0.3  # [rad] from rest, both ways
_YAML = """mjcf: limbed_arm.xml
joints: [{joints}]
muscles: [{muscles}]
velocity_limit: 0.015
acceleration_limit: 0.05
tension_min: 1
tension_max: 100
tension_limit: 120
current_limit: 2
wire_stiffness: 4000
payload_body: link0
postures: {{home: {home}, start: {start}, end: {end}}}
"""


def write_limbed_arm(folder: Path, muscles: int, joints: int) -> Path:
    """Write an arm with at least two muscles for each joint; return its YAML file.

    Muscles 0 and 1 lift and sink joint 0, and so on; the rest lift two joints at once. The swing
    from `start` to `end` takes about 33 steps with all muscles.
    """
    if muscles < 2 * joints or joints < 2:
        raise ValueError(f"{muscles} muscles for {joints} joints, expected two for each")
    wires = [wire for joint in range(joints) for wire in _pair(joint)]
    followed = [joint for joint in range(joints - 1) if joint % _LIMB < _LIMB - 1]
    for extra in range(muscles - 2 * joints):
        first = followed[extra % len(followed)]
        height = 0.02 + 0.0005 * (extra // len(followed) + 1)
        wires.append((first, first + 1, height))
    firsts = range(0, joints, _LIMB)
    limbs = "".join(_limb(range(j, min(j + _LIMB, joints)), wires) for j in firsts)
    tendons = "".join(
        f'<spatial name="m{number}"><site site="from{number}"/><site site="to{number}"/></spatial>'
        for number in range(len(wires))
    )
    (folder / "limbed_arm.xml").write_text(
        '<mujoco><compiler angle="radian"/><option timestep="0.001"/>'
        f"<worldbody>{limbs}</worldbody><tendon>{tendons}</tendon></mujoco>\n"
    )
    path = folder / "limbed_arm.yaml"
    path.write_text(
        _YAML.format(
            joints=", ".join(f"joint{joint}" for joint in range(joints)),
            muscles=", ".join(f"m{number}" for number in range(muscles)),
            home=[0.0] * joints,
            start=[-_SWING] * joints,
            end=[_SWING] * joints,
        )
    )
    return path


Wire = tuple[int, int, float]
"""From the body before a joint to the one behind a joint, at a height [m]."""


def _pair(joint: int) -> list[Wire]:
    return [(joint, joint, 0.02), (joint, joint, -0.02)]


def _limb(joints: range, wires: list[Wire]) -> str:
    """Return a limb as bodies in each other, and the sites before its first joint."""
    inner = ""
    for joint in reversed(joints):
        inside = joint > joints[0]
        x, y = (0.1, 0.0) if inside else (0.0, _ROOM * joint / _LIMB)
        ends = "".join(
            f'<site name="to{number}" pos="{_SITE} 0 {height}"/>'
            for number, (_, last, height) in enumerate(wires)
            if last == joint
        )
        origins = "".join(
            f'<site name="from{number}" pos="{x - _SITE} {y} {height}"/>'
            for number, (first, _, height) in enumerate(wires)
            if first == joint
        )
        inner = (
            f'{origins}<body name="link{joint}" pos="{x} {y} 0">'
            f'<joint name="joint{joint}" axis="0 1 0" range="-0.8 0.8" damping="0.05" '
            'armature="0.001"/><geom type="capsule" fromto="0 0 0 0.1 0 0" size="0.01" '
            f'mass="0.02" contype="0" conaffinity="0"/>{ends}{inner}</body>'
        )
    return inner
