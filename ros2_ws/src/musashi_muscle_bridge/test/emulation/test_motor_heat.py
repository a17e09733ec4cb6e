"""Motors warm up and cool down as two thermal resistances say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from musashi_muscle_bridge.emulation.motor_heat import MotorHeat
from musashi_muscle_bridge.emulation.plant_constants import PlantConstants

CONSTANTS = PlantConstants()
CURRENT = 2.0
HEAT = CONSTANTS.winding_resistance * CURRENT**2


def heated(seconds: float, current: float = CURRENT, step: float = 0.05) -> MotorHeat:
    heat = MotorHeat(CONSTANTS, 1)
    for _ in range(round(seconds / step)):
        heat.add(np.array([current]), step)
    return heat


def test_motors_start_at_ambient_temperature() -> None:
    heat = MotorHeat(CONSTANTS, 3)
    assert heat.winding.tolist() == heat.housing.tolist() == [25.0, 25.0, 25.0]


def test_without_current_nothing_warms_up() -> None:
    assert heated(60.0, current=0.0).winding[0] == 25.0


def test_in_the_end_a_motor_is_as_warm_as_its_resistances_say() -> None:
    heat = heated(6000.0)
    assert heat.housing[0] - 25.0 == pytest.approx(
        HEAT * CONSTANTS.housing_thermal_resistance, rel=1e-3
    )
    assert heat.winding[0] - heat.housing[0] == pytest.approx(
        HEAT * CONSTANTS.winding_thermal_resistance, rel=1e-3
    )


def test_at_first_all_heat_stays_in_the_winding() -> None:
    heat = heated(0.1, step=0.01)
    assert heat.winding[0] - 25.0 == pytest.approx(
        HEAT * 0.1 / CONSTANTS.winding_heat_capacity, rel=0.05
    )


def test_the_housing_follows_later_than_the_winding() -> None:
    heat = heated(5.0)
    assert 25.0 < heat.housing[0] < heat.winding[0]


@given(current=st.floats(-10.0, 10.0), seconds=st.floats(0.1, 60.0))
def test_the_direction_of_the_current_does_not_matter(current: float, seconds: float) -> None:
    assert heated(seconds, current).winding[0] == heated(seconds, -current).winding[0]


@given(current=st.floats(-10.0, 10.0), seconds=st.floats(0.1, 60.0))
def test_no_motor_is_ever_colder_than_ambient(current: float, seconds: float) -> None:
    heat = heated(seconds, current)
    assert heat.housing[0] >= 25.0
    assert heat.winding[0] >= heat.housing[0]
