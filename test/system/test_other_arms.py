"""Mock driver and bridge come up on arms they have never seen, up to 74 muscles."""

from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from lifecycle_msgs.msg import State
from sensor_msgs.msg import JointState

from fastswing_msgs.msg import LengthCommand, MuscleState
from test.system.other_arms import TWO_LINK_ARM, write_hand

if TYPE_CHECKING:
    from test.system.suite import Suite


def bring_up(world: "Suite", robot: Path, **parameters: object) -> None:
    """Start both nodes and wait until every muscle holds."""
    world.start("mock_driver", robot_description=robot, **parameters)
    # Slow enough for 74 muscles beside everything else on a small machine.
    rates = {"control_rate": 100.0, "watchdog_timeout": 1.0}
    world.start("bridge", robot_description=robot, **rates, **parameters)
    world.wait_for_state("bridge", State.PRIMARY_STATE_ACTIVE)
    world.fresh_muscles()
    world.hold()


def test_the_muscles_are_those_of_the_yaml_in_its_order(world: "Suite") -> None:
    bring_up(world, TWO_LINK_ARM)
    names = ["deltoid", "latissimus", "biceps", "triceps"]
    assert list(world.fresh_muscles().name) == names


def test_the_joints_are_those_of_the_yaml(world: "Suite") -> None:
    found: list[JointState] = []
    world.node.create_subscription(JointState, "joint_states", found.append, 1)
    bring_up(world, TWO_LINK_ARM)
    assert list(found[-1].name) == ["shoulder", "elbow"]


def test_the_other_arm_moves_as_commanded(world: "Suite") -> None:
    bring_up(world, TWO_LINK_ARM)
    publisher = world.node.create_publisher(LengthCommand, "length_command", 10)
    before = world.fresh_posture()[1]
    lengths = dict(zip(world.fresh_muscles().name, world.fresh_muscles().length, strict=True))
    names, change = ["biceps", "triceps"], {"biceps": 0.01, "triceps": -0.01}
    world.publish_until(
        publisher,
        lambda: LengthCommand(
            header=world.now(), name=names, length=[lengths[name] + change[name] for name in names]
        ),
        "the elbow to turn",
        lambda: bool(abs(world.fresh_posture()[1] - before) > 0.1),
    )


@pytest.mark.parametrize("bus", ["udp", "serial"])
def test_74_muscles_come_up_and_hold(world: "Suite", tmp_path: Path, bus: str) -> None:
    parameters = {} if bus == "udp" else {"bus_url": f"serial://{tmp_path}/boards?pty=true"}
    bring_up(world, write_hand(tmp_path, 37), **parameters)
    muscles = world.fresh_muscles()
    assert len(muscles.name) == 74
    assert set(muscles.mode) == {MuscleState.MODE_LENGTH}


def test_a_bridge_for_another_arm_than_the_boards_energises_nothing(world: "Suite") -> None:
    world.start("mock_driver", robot_description=TWO_LINK_ARM)
    world.wait_for_state("mock_driver", State.PRIMARY_STATE_ACTIVE)
    world.start("bridge")
    text = "do robot_description and boards belong together?"
    world.until("the reason", lambda: text in world.reported("bridge", "last_bus_error"))
    assert world.muscles is None
