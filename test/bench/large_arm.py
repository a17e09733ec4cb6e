"""An arm with any number of joints and muscles, to see what grows with them."""

from pathlib import Path

_SIDES = ((0.02, 0.0), (0.0, 0.02), (-0.02, 0.0), (0.0, -0.02))
_AXES = ("1 0 0", "0 1 0")
_LINK = 0.1  # [m]
_YAML = """mjcf: arm.xml
joints: [{joints}]
muscles: [{muscles}]
velocity_limit: 0.2
acceleration_limit: 0.5
tension_min: 1
tension_max: 200
tension_limit: 300
current_limit: 2
wire_stiffness: 4000
payload_body: link{last}
postures: {{home: {start}, start: {start}, end: {end}}}
"""


def write_large_arm(folder: Path, joints: int, muscles: int) -> Path:
    """Write a chain of so many joints; return its YAML file.

    Each muscle runs along one side of the chain, over one, two or three joints.
    """
    chain = ""
    for joint in reversed(range(joints)):
        place = _LINK if joint else 0.0
        chain = (
            f'<body name="link{joint}" pos="0 0 {place}">'
            f'<joint name="joint{joint}" axis="{_AXES[joint % 2]}" range="-0.8 0.8" damping="0.1"/>'
            f'<geom type="capsule" fromto="0 0 0 0 0 {_LINK}" size="0.01" mass="0.02"'
            ' contype="0" conaffinity="0"/>'
            f"{_sites(joint + 1, _LINK / 2)}{chain}</body>"
        )
    tendons = "".join(_tendon(muscle, joints) for muscle in range(muscles))
    folder.joinpath("arm.xml").write_text(
        '<mujoco><compiler angle="radian"/><option timestep="0.001" gravity="0 0 0"/>'
        f"<worldbody>{_sites(0, -_LINK / 2)}{chain}</worldbody><tendon>{tendons}</tendon></mujoco>"
    )
    path = folder / "arm.yaml"
    path.write_text(
        _YAML.format(
            joints=", ".join(f"joint{joint}" for joint in range(joints)),
            muscles=", ".join(f"'#{muscle + 1}'" for muscle in range(muscles)),
            last=joints - 1,
            start=[-0.2] * joints,
            end=[0.2] * joints,
        )
    )
    return path


def _sites(link: int, height: float) -> str:
    return "".join(
        f'<site name="s{link}_{side}" pos="{x} {y} {height}"/>'
        for side, (x, y) in enumerate(_SIDES)
    )


def _tendon(muscle: int, joints: int) -> str:
    first = muscle % joints
    last = min(first + 1 + muscle % 3, joints)
    side = (muscle + muscle // joints) % len(_SIDES)
    sites = "".join(f'<site site="s{link}_{side}"/>' for link in range(first, last + 1))
    return f'<spatial name="#{muscle + 1}">{sites}</spatial>'
