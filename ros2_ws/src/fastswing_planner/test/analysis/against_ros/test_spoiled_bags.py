"""Messages that make no sense end in unknown figures or in a line, never in a traceback."""

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from bag_of_swings import TYPES, BagOfSwings
from sensor_msgs.msg import JointState

from fastswing_msgs.msg import CurrentOverride, LengthCommand, MuscleState, SwingPlan
from fastswing_planner.analysis.recording import Recording
from fastswing_planner.commands.analyse import PASSED, UNUSABLE, VIOLATED, main

ROBOT = Path(__file__).parents[5] / "src/musashi_muscle_bridge/description/musashi_left_arm.yaml"
ROUNDS = 24
"""Bags, each spoiled in its own way."""
DRAWN_EVERY = 6
"""Drawing takes most of the time."""
BAD_NUMBERS = [math.nan, math.inf, -math.inf, 1e300, -1e300]


def spoil(message: Any, chance: random.Random) -> None:
    """Change one field of a message into something that no node would send."""
    fields = message.get_fields_and_field_types()
    name = chance.choice([one for one in fields if one != "lease"])
    kind = fields[name]
    value = getattr(message, name)
    if name == "header":
        message.header.stamp.sec = chance.choice([0, 2**31 - 1, 1_600_000_000])
    elif name == "trajectory":
        spoil(message.trajectory, chance)
    elif kind.startswith("sequence"):
        values = list(value)
        change = chance.randrange(4)
        if change == 0 or not values:
            values = []
        elif change == 1:
            values = values[:-1]
        elif change == 2:
            values = [*values, values[0]]
        elif kind == "sequence<double>":
            values[chance.randrange(len(values))] = chance.choice(BAD_NUMBERS)
        else:
            values[-1] = values[0]
        setattr(message, name, values)
    elif kind == "double":
        setattr(message, name, chance.choice(BAD_NUMBERS))
    elif kind.startswith("uint8"):
        setattr(message, name, 77)


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_a_spoiled_bag_is_analysed_or_refused_in_a_line(
    seed: int,
    recorded: Callable[..., Recording],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    chance = random.Random(seed)
    bag = BagOfSwings(tmp_path / "spoiled.mcap")
    bag.add_recording(recorded(rate=50.0))
    kinds = chance.sample(
        [JointState, MuscleState, LengthCommand, CurrentOverride, SwingPlan], chance.randint(1, 5)
    )
    share = chance.choice([0.02, 0.3, 1.0])
    for message in bag.messages(tuple(kinds)):
        if chance.random() < share:
            spoil(message, chance)
    output = tmp_path / "out"
    limits = tmp_path / "limits.yaml"
    limits.write_text("each_swing: {time: {max: 9}, tension: {max: 900}, state_to_zero: {max: 50}}")
    arguments: list[object] = [bag.write(), "--robot", ROBOT, "--check", limits]
    drawn = seed % DRAWN_EVERY == 0
    if drawn:
        arguments += ["--output", output]
    code = main([str(argument) for argument in arguments])
    printed = capsys.readouterr()
    assert code in (PASSED, VIOLATED, UNUSABLE)
    if code == UNUSABLE:
        assert len(printed.err.splitlines()) == 1
    else:
        assert (output / "report.html").exists() == drawn


def test_every_recorded_type_can_be_spoiled() -> None:
    assert {JointState, MuscleState, LengthCommand, CurrentOverride, SwingPlan} <= set(TYPES)
