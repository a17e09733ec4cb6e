"""Faults of boards, motors, wires and bus are rehearsed while everything runs."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter

from fastswing_msgs.msg import MuscleState

if TYPE_CHECKING:
    from test.system.suite import Suite


ARM_FAULTS = ("stuck_encoder", "dead_board", "hot_motor", "broken_wire")
LINE_FAULTS = ("latency", "jitter", "loss", "corruption")
MUSCLE, INDEX = "#9", 8


def reason(suite: "Suite", values: dict[str, object]) -> str:
    """Set parameters of the mock driver; return why it refused, empty if it did not."""
    # An empty list has no element that tells its type.
    parameters = [
        Parameter(name, Parameter.Type.STRING_ARRAY if value == [] else None, value)
        for name, value in values.items()
    ]
    request = SetParametersAtomically.Request(
        parameters=[parameter.to_parameter_msg() for parameter in parameters]
    )
    result = suite.ask(
        SetParametersAtomically, "mock_driver/set_parameters_atomically", request
    ).result
    return "" if result.successful else str(result.reason)


def let(suite: "Suite", **values: object) -> None:
    assert reason(suite, values) == ""


def fault_of(suite: "Suite") -> int:
    return int(suite.fresh_muscles().fault[INDEX])


@pytest.fixture
def sound(bridge_and_mock: "Suite") -> Iterator["Suite"]:
    """Let the bridge hold a sound arm, before the test and after it."""
    bridge_and_mock.hold()
    yield bridge_and_mock
    let(bridge_and_mock, **{name: [] for name in ARM_FAULTS}, **dict.fromkeys(LINE_FAULTS, 0.0))
    # The bridge must have seen a board start again before that is cleared.
    bridge_and_mock.let_states_pass(50)
    bridge_and_mock.hold()


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("hot_motor", MuscleState.FAULT_OVER_TEMPERATURE),
        ("dead_board", MuscleState.FAULT_BUS),
    ],
)
def test_a_fault_is_seen_in_the_muscle_state_of_its_muscle(
    sound: "Suite", name: str, fault: int
) -> None:
    let(sound, **{name: [MUSCLE]})
    sound.until(f"fault {fault}", lambda: fault_of(sound) == fault)
    assert sound.muscles is not None
    assert sum(map(bool, sound.muscles.fault)) == 1


def test_a_fault_stays_until_it_is_cleared(sound: "Suite") -> None:
    let(sound, hot_motor=[MUSCLE])
    sound.until("the fault", lambda: fault_of(sound) != 0)
    let(sound, hot_motor=[])
    sound.let_states_pass()
    assert fault_of(sound) == MuscleState.FAULT_OVER_TEMPERATURE


def test_a_muscle_holds_again_when_its_fault_is_mended_and_cleared(sound: "Suite") -> None:
    let(sound, hot_motor=[MUSCLE])
    sound.until("the fault", lambda: fault_of(sound) != 0)
    let(sound, hot_motor=[])
    sound.hold()


def test_a_broken_wire_has_no_tension(sound: "Suite") -> None:
    sound.until("tension", lambda: sound.fresh_muscles().tension[INDEX] > 0.0)
    let(sound, broken_wire=[MUSCLE])
    sound.until("slack", lambda: sound.fresh_muscles().tension[INDEX] == 0.0)


def test_a_stuck_encoder_shows_no_motion_when_the_muscle_is_let_go(sound: "Suite") -> None:
    let(sound, stuck_encoder=[MUSCLE])
    sound.let_states_pass(50)
    before = sound.fresh_muscles().length[INDEX]
    sound.trigger("emergency_stop")
    sound.let_states_pass()
    assert sound.fresh_muscles().length[INDEX] == before


def test_a_board_that_lives_again_is_named_by_the_bridge(sound: "Suite") -> None:
    let(sound, dead_board=[MUSCLE])
    sound.until("the fault", lambda: fault_of(sound) == MuscleState.FAULT_BUS)
    let(sound, dead_board=[])
    sound.until("its name", lambda: sound.reported("bridge", "rebooted") == MUSCLE)


def test_with_every_frame_lost_the_watchdogs_act(sound: "Suite") -> None:
    let(sound, loss=1.0)
    sound.until("the watchdogs", lambda: sound.reported("mock_driver", "faulty_boards") == "10")


def test_with_every_frame_lost_the_bridge_says_that_nobody_answers(sound: "Suite") -> None:
    let(sound, loss=1.0)
    sound.until(
        "the bridge to say so",
        lambda: "do not answer" in getattr(sound.diagnostics.get("bridge"), "message", ""),
    )


def test_boards_that_do_not_answer_and_answer_again_are_in_the_bridges_log(sound: "Suite") -> None:
    bridge = sound.processes["bridge"]
    let(sound, loss=1.0)
    text = f"the boards do not answer on {sound.bus_url}"
    sound.until("the log", lambda: text in bridge.log.read_text())
    let(sound, loss=0.0)
    sound.until("the end", lambda: "the boards answer again" in bridge.log.read_text())


def test_damaged_commands_are_counted_by_the_boards(sound: "Suite") -> None:
    let(sound, corruption=0.3)
    sound.until("a count", lambda: int(sound.reported("mock_driver", "refused_damaged") or 0) > 0)


def test_damaged_answers_are_counted_by_the_bridge(sound: "Suite") -> None:
    let(sound, corruption=0.3)
    sound.until("a count", lambda: int(sound.reported("bridge", "dropped_damaged") or 0) > 0)


def test_late_answers_are_still_published(sound: "Suite") -> None:
    let(sound, latency=0.01, jitter=0.005)
    sound.let_states_pass()


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"hot_motor": ["#11"]}, "hot_motor: unknown muscle '#11', choose from: #1, #2, "),
        ({"broken_wire": ["#1", "#1"]}, "broken_wire: muscle '#1' is named more than once"),
        ({"dead_board": "#1"}, "dead_board is '#1', expected a list of texts"),
        ({"stuck_encoder": [1, 2]}, "expected a list of texts"),
        ({"loss": 1.5}, "loss is 1.5, expected 0 to 1"),
        ({"jitter": float("nan")}, "jitter is nan, expected 0 to 1 s"),
        ({"seed": 5}, "seed takes effect at configuration: deactivate and clean up first"),
    ],
    ids=lambda value: "" if isinstance(value, str) else next(iter(value)),
)
def test_a_wrong_value_is_refused_saying_what_would_be_right(
    sound: "Suite", values: dict[str, object], text: str
) -> None:
    assert text in reason(sound, values)


def test_after_a_refused_value_nothing_is_broken(sound: "Suite") -> None:
    reason(sound, {"hot_motor": ["#9", "#11"]})
    sound.let_states_pass()
    assert not any(sound.fresh_muscles().fault)


def test_a_fault_can_be_there_from_the_start(world: "Suite") -> None:
    world.start("mock_driver", hot_motor=[MUSCLE])
    world.start("bridge")
    world.until(
        "the fault",
        lambda: (
            world.muscles is not None
            and world.muscles.fault[INDEX] == MuscleState.FAULT_OVER_TEMPERATURE
        ),
    )


def test_an_unknown_muscle_at_the_start_ends_the_mock_driver_with_2(world: "Suite") -> None:
    process = world.start("mock_driver", hot_motor=["#11"])
    assert process.wait(60.0) == 2
    (line,) = process.log.read_text().splitlines()
    assert "cannot configure: hot_motor: unknown muscle '#11', choose from: #1, #2, " in line
