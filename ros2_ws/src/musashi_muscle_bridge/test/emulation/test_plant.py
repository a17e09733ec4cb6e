"""The plant behaves like winches, wires and weights; mostly on a hoist with a load of 20 N."""

import dataclasses

import mujoco
import numpy as np
import pytest

from fastswing_planner.errors import RobotDescriptionError
from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.emulation.plant import Drive, Plant, arm_mjcf
from musashi_muscle_bridge.emulation.plant_constants import PlantConstants, plant_constants

UP, DOWN = 0, 1
WEIGHT = 20.0
STEP = 0.0005


def drive(count: int, driven: bool, velocity: float = 0.0, current: float = 0.0) -> Drive:
    return Drive(np.full(count, driven), np.full(count, velocity), np.full(count, current))


HELD = drive(2, driven=True)
FREE = drive(2, driven=False)


def lift(velocity: float) -> Drive:
    """Move the wire that carries the load; the tether pays out to stay out of the way."""
    return Drive(np.array([True, True]), np.array([velocity, 0.3]), np.zeros(2))


def run(plant: Plant, what: Drive, seconds: float) -> None:
    for _ in range(round(seconds / plant.time_step)):
        plant.step(what)


def settled(robot: Robot) -> Plant:
    """Return a plant whose load came to rest on held winches."""
    plant = Plant(robot)
    run(plant, HELD, 2.0)
    return plant


def with_constants(robot: Robot, **constants: float) -> Robot:
    return dataclasses.replace(robot, plant={**robot.plant, **constants})


def test_a_hanging_arm_without_current_stays_where_it_hangs(musashi: Robot) -> None:
    plant = Plant(musashi)
    run(plant, drive(10, driven=False), 2.0)
    np.testing.assert_allclose(plant.joint_position, musashi.postures["home"], atol=0.05)
    np.testing.assert_allclose(plant.joint_velocity, 0.0, atol=0.01)


def test_a_hanging_arm_on_held_winches_comes_to_rest(musashi: Robot) -> None:
    plant = Plant(musashi)
    run(plant, drive(10, driven=True), 2.0)
    np.testing.assert_allclose(plant.joint_velocity, 0.0, atol=0.01)


def test_a_plant_starts_at_home_at_rest_with_wires_just_slack(hoist: Robot) -> None:
    plant = Plant(hoist)
    assert plant.joint_position.tolist() == [0.0]
    assert plant.joint_velocity.tolist() == [0.0]
    assert plant.length.tolist() == [1.0, 1.0]
    assert plant.tension.tolist() == [0.0, 0.0]


def test_a_hanging_load_pulls_with_its_weight(hoist: Robot) -> None:
    assert settled(hoist).tension[UP] == pytest.approx(WEIGHT, rel=1e-3)


def test_a_hanging_load_stretches_its_wire_by_weight_over_stiffness(hoist: Robot) -> None:
    assert settled(hoist).joint_position[0] == pytest.approx(WEIGHT / 7000.0, rel=1e-3)


def test_a_load_bouncing_on_a_held_wire_never_gains_energy(hoist: Robot) -> None:
    plant = Plant(hoist)
    energies = []
    for _ in range(2000):
        plant.step(HELD)
        (drop,), (speed,) = plant.joint_position, plant.joint_velocity
        stretch = max(drop, 0.0)
        energies.append(speed**2 + 3500.0 * stretch**2 - WEIGHT * drop)
    # A step of integration is worth a thousandth of a joule.
    assert np.diff(energies).max() < 1e-3
    assert energies[-1] == pytest.approx(-(WEIGHT**2) / 7000.0 / 2.0, rel=1e-2)


# Driven.


def test_a_driven_winch_follows_the_ramp(hoist: Robot) -> None:
    plant = settled(hoist)
    speeds = []
    for _ in range(1000):
        plant.step(lift(0.3))
        speeds.append(plant.velocity[UP])
    np.testing.assert_allclose(speeds, np.minimum(0.5 * STEP * np.arange(1, 1001), 0.3), atol=1e-12)


def test_a_driven_winch_pulls_along_the_same_ramp(hoist: Robot) -> None:
    plant = settled(hoist)
    speeds = []
    for _ in range(1000):
        plant.step(lift(-0.2))
        speeds.append(plant.velocity[UP])
    np.testing.assert_allclose(
        speeds, -np.minimum(0.5 * STEP * np.arange(1, 1001), 0.2), atol=1e-12
    )


def test_a_driven_winch_stops_at_once(hoist: Robot) -> None:
    plant = settled(hoist)
    run(plant, lift(0.3), 0.5)
    plant.step(HELD)
    assert plant.velocity.tolist() == [0.0, 0.0]


def test_no_driven_winch_exceeds_its_speed_limit(hoist: Robot) -> None:
    plant = settled(hoist)
    run(plant, lift(5.0), 1.0)
    assert plant.velocity[UP] == 0.3


def test_a_winch_that_pulls_lifts_the_load(hoist: Robot) -> None:
    plant = settled(hoist)
    before = plant.joint_position[0]
    run(plant, lift(-0.1), 1.0)
    # 0.1 m/s for a second, less what the ramp cost.
    assert before - plant.joint_position[0] == pytest.approx(0.1 - 0.1**2 / 0.5 / 2.0, abs=1e-3)


def test_length_is_the_sum_of_the_velocities(hoist: Robot) -> None:
    plant = settled(hoist)
    length, total = plant.length[UP], 0.0
    for _ in range(500):
        plant.step(lift(-0.1))
        total += plant.velocity[UP] * STEP
    assert plant.length[UP] - length == pytest.approx(total)


def test_a_driven_winch_draws_the_current_its_tension_needs(hoist: Robot) -> None:
    assert settled(hoist).current[UP] == pytest.approx(WEIGHT / 50.0, rel=1e-3)


def test_a_winch_at_its_current_limit_stalls(hoist: Robot) -> None:
    # 0.2 A pull 10 N: too little for 20 N.
    plant = settled(dataclasses.replace(hoist, current_limit=np.array([0.2, 8.0])))
    before = plant.length[UP]
    run(plant, lift(-0.1), 0.5)
    assert plant.length[UP] == before
    assert plant.current[UP] == 0.2


def test_a_winch_at_its_current_limit_still_pays_out(hoist: Robot) -> None:
    plant = settled(dataclasses.replace(hoist, current_limit=np.array([0.2, 8.0])))
    before = plant.length[UP]
    run(plant, lift(0.1), 0.5)
    assert plant.length[UP] > before + 0.03


# Slack.


def test_a_slack_wire_pulls_nothing(hoist: Robot) -> None:
    plant = settled(hoist)
    assert plant.length[DOWN] > 1.0 - plant.joint_position[0]
    assert plant.tension[DOWN] == 0.0


def test_a_load_on_slack_wires_falls_freely(hoist: Robot) -> None:
    plant = Plant(hoist)
    for _ in range(200):
        plant.step(Drive(np.array([False, False]), np.zeros(2), np.array([-100.0, 0.0])))
    assert plant.tension.tolist() == [0.0, 0.0]
    assert plant.joint_velocity[0] == pytest.approx(10.0 * 200 * STEP, rel=1e-6)


def test_no_wire_ever_pushes(hoist: Robot) -> None:
    plant = Plant(hoist)
    rng = np.random.default_rng(1)
    lowest = 0.0
    for _ in range(100):
        run(plant, drive(2, driven=True, velocity=rng.uniform(-0.3, 0.3)), 0.02)
        lowest = min(lowest, plant.tension.min())
    assert lowest == 0.0


# Back-driven.


def test_a_back_driven_winch_stays_put_below_its_friction(hoist: Robot) -> None:
    plant = settled(with_constants(hoist, winch_friction=WEIGHT + 1.0))
    before = plant.length[UP]
    run(plant, FREE, 1.0)
    assert plant.length[UP] == before


def test_a_back_driven_winch_moves_above_its_friction(hoist: Robot) -> None:
    plant = settled(with_constants(hoist, winch_friction=WEIGHT - 1.0))
    before = plant.length[UP]
    run(plant, FREE, 0.5)
    assert plant.length[UP] > before + 0.001


def test_a_back_driven_winch_ends_where_damping_and_friction_carry_the_load(hoist: Robot) -> None:
    # 20 N - 10 N of friction = 100 N s/m times 0.1 m/s
    plant = settled(with_constants(hoist, winch_damping=100.0))
    run(plant, FREE, 1.0)
    assert plant.velocity[UP] == pytest.approx(0.1, rel=0.01)


def test_a_back_driven_winch_is_not_bound_by_the_speed_limit(hoist: Robot) -> None:
    plant = settled(with_constants(hoist, winch_damping=10.0))
    run(plant, FREE, 0.8)
    assert plant.velocity[UP] > 0.3


def test_a_heavier_winch_gains_speed_more_slowly(hoist: Robot) -> None:
    light = settled(with_constants(hoist, winch_mass=2.0))
    heavy = settled(with_constants(hoist, winch_mass=8.0))
    run(light, FREE, 0.1)
    run(heavy, FREE, 0.1)
    assert 0.0 < heavy.velocity[UP] < light.velocity[UP]


def test_without_current_there_is_no_current(hoist: Robot) -> None:
    plant = settled(hoist)
    plant.step(FREE)
    assert plant.current.tolist() == [0.0, 0.0]


def test_a_current_that_balances_the_weight_holds_it(hoist: Robot) -> None:
    plant = settled(hoist)
    before = plant.length[UP]
    run(plant, Drive(np.zeros(2, bool), np.zeros(2), np.array([WEIGHT / 50.0, 0.0])), 1.0)
    assert plant.length[UP] == before


def test_a_current_beyond_weight_and_friction_lifts(hoist: Robot) -> None:
    plant = settled(hoist)
    before = plant.joint_position[0]
    run(plant, Drive(np.zeros(2, bool), np.zeros(2), np.array([0.7, -0.3])), 0.5)
    assert plant.joint_position[0] < before - 0.01


def test_the_harder_the_pull_the_slower_a_winch_winds_in(hoist: Robot) -> None:
    # Half of the stall force is left: half of the 0.3 m/s is reached.
    plant = settled(with_constants(hoist, stall_force=2 * WEIGHT))
    run(plant, lift(-0.3), 1.0)
    assert plant.velocity[UP] == pytest.approx(-0.15, rel=0.02)


def test_the_load_does_not_slow_paying_out(hoist: Robot) -> None:
    plant = settled(with_constants(hoist, stall_force=2 * WEIGHT))
    run(plant, lift(0.3), 0.7)
    assert plant.velocity[UP] == 0.3


def test_a_winch_at_its_stall_force_still_pays_out(hoist: Robot) -> None:
    plant = settled(with_constants(hoist, stall_force=WEIGHT / 2))
    run(plant, lift(-0.3), 0.5)
    assert plant.velocity[UP] == 0.0
    run(plant, lift(0.1), 0.3)
    assert plant.velocity[UP] == pytest.approx(0.1)


# Broken wires.


def test_a_broken_wire_pulls_nothing_and_drops_the_load(hoist: Robot) -> None:
    plant = settled(hoist)
    plant.wire_broken[UP] = True
    run(plant, HELD, 0.2)
    assert plant.tension[UP] == 0.0
    assert plant.joint_position[0] == pytest.approx(0.5 * 10.0 * 0.2**2, rel=0.05)


def test_breaking_one_wire_leaves_the_other_whole(hoist: Robot) -> None:
    plant = settled(hoist)
    plant.wire_broken[DOWN] = True
    run(plant, HELD, 0.2)
    assert plant.tension[UP] == pytest.approx(WEIGHT, rel=1e-3)


def test_a_mended_wire_pulls_again(hoist: Robot) -> None:
    plant = settled(hoist)
    plant.wire_broken[UP] = True
    plant.step(HELD)
    plant.wire_broken[UP] = False
    run(plant, HELD, 2.0)
    assert plant.tension[UP] == pytest.approx(WEIGHT, rel=1e-2)


# Sensors.


def test_an_encoder_reads_multiples_of_its_step(hoist: Robot) -> None:
    plant = settled(with_constants(hoist, encoder_step=0.01))
    for _ in range(200):
        plant.step(lift(-0.1))
        np.testing.assert_allclose(plant.length, np.round(plant.length / 0.01) * 0.01)


def test_quantisation_does_not_move_the_winch(hoist: Robot) -> None:
    exact, coarse = settled(hoist), settled(with_constants(hoist, encoder_step=0.01))
    run(exact, lift(-0.1), 0.5)
    run(coarse, lift(-0.1), 0.5)
    assert coarse.joint_position.tobytes() == exact.joint_position.tobytes()
    assert abs(coarse.length[UP] - exact.length[UP]) <= 0.005


def test_tension_noise_scatters_as_much_as_asked_for(hoist: Robot) -> None:
    plant = settled(with_constants(hoist, tension_noise=0.5))
    tensions = []
    for _ in range(2000):
        plant.step(HELD)
        tensions.append(plant.tension[UP])
    assert np.std(tensions) == pytest.approx(0.5, rel=0.1)
    assert np.mean(tensions) == pytest.approx(WEIGHT, abs=0.1)


def test_a_noisy_tension_is_never_negative(hoist: Robot) -> None:
    plant = Plant(with_constants(hoist, tension_noise=5.0))
    for _ in range(200):
        plant.step(HELD)
        assert plant.tension.min() >= 0.0


def test_angle_noise_scatters_as_much_as_asked_for(hoist: Robot) -> None:
    plant = settled(with_constants(hoist, angle_noise=0.002))
    angles = []
    for _ in range(2000):
        plant.step(HELD)
        angles.append(plant.joint_position[0])
    assert np.std(angles) == pytest.approx(0.002, rel=0.1)


def test_noise_repeats_with_its_seed_and_only_with_it(hoist: Robot) -> None:
    def tensions(seed: int) -> bytes:
        plant = Plant(with_constants(hoist, tension_noise=1.0, noise_seed=seed))
        run(plant, HELD, 0.05)
        return plant.tension.tobytes()

    assert tensions(1) == tensions(1)
    assert tensions(1) != tensions(2)


def test_what_a_plant_measured_cannot_be_written_to(hoist: Robot) -> None:
    plant = settled(hoist)
    for measured in (plant.length, plant.velocity, plant.tension, plant.current):
        with pytest.raises(ValueError, match="read-only"):
            measured[0] = 1.0


# Constants.


@pytest.mark.parametrize("key", ["tension_noise", "encoder_step", "angle_noise"])
def test_a_noise_may_be_zero_but_not_negative(key: str) -> None:
    plant_constants({key: 0.0})
    with pytest.raises(RobotDescriptionError) as caught:
        plant_constants({key: -1.0})
    assert str(caught.value) == f"plant: {key} is -1.0, expected a positive number or 0"


@pytest.mark.parametrize("seed", [-1, 0.5, "dice"])
def test_a_seed_is_a_whole_number(seed: object) -> None:
    with pytest.raises(RobotDescriptionError) as caught:
        plant_constants({"noise_seed": seed})
    assert str(caught.value) == f"plant: noise_seed is {seed!r}, expected a whole number from 0"


def test_no_constants_mean_the_defaults() -> None:
    assert plant_constants({}) == PlantConstants()


def test_an_unknown_constant_is_refused_with_the_choices() -> None:
    choices = ", ".join(field.name for field in dataclasses.fields(PlantConstants))
    with pytest.raises(RobotDescriptionError) as caught:
        plant_constants({"winch_colour": 1.0})
    assert str(caught.value) == f"plant: unknown key 'winch_colour', choose from: {choices}"


@pytest.mark.parametrize("value", [0, -1.0, float("nan"), float("inf"), "heavy", None])
def test_a_constant_that_is_not_positive_is_refused(value: object) -> None:
    with pytest.raises(RobotDescriptionError) as caught:
        plant_constants({"winch_mass": value})
    assert str(caught.value) == f"plant: winch_mass is {value!r}, expected a positive number"


def test_two_plants_with_the_same_orders_agree_to_the_bit(hoist: Robot) -> None:
    first, second = Plant(hoist), Plant(hoist)
    run(first, lift(-0.1), 0.5)
    run(second, lift(-0.1), 0.5)
    assert first.joint_position.tobytes() == second.joint_position.tobytes()
    assert first.tension.tobytes() == second.tension.tobytes()


def test_a_joint_that_is_left_out_stays_where_the_planner_has_it(crane: Robot) -> None:
    mjcf = arm_mjcf(crane)
    data = mujoco.MjData(mjcf)
    data.qpos[:] = crane.model.full_position(crane.postures["home"])
    for _ in range(500):
        mujoco.mj_step(mjcf, data)
    assert float(data.joint("sway").qpos[0]) == pytest.approx(0.4, abs=0.01)
