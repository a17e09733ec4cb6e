"""What the dashboard shows, as a terminal without colours would."""

import io
import math
import re
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from musashi_muscle_bridge.buses.protocol import Fault, Mode
from musashi_muscle_bridge.monitor.dashboard import (
    FEEDBACK,
    INHIBITION,
    OVERRIDE,
    STATE,
    Dashboard,
)
from musashi_muscle_bridge.monitor.keys import KeyPad
from musashi_muscle_bridge.monitor.picture import picture
from musashi_muscle_bridge.monitor.service_calls import ServiceCalls

NAMES = [f"#{number}" for number in range(1, 11)]
LIMIT = 450.0


def state(count: int = 10, **changes: Any) -> SimpleNamespace:
    fields: dict[str, Any] = {
        "name": [f"#{number}" for number in range(1, count + 1)],
        "length": [0.25] * count,
        "tension": [20.0] * count,
        "current": [0.4] * count,
        "temperature": [math.nan] * count,
        "mode": [Mode.LENGTH.value] * count,
        "fault": [Fault.NONE.value] * count,
    }
    return SimpleNamespace(**{**fields, **changes})


def override(*names: str, lease: float = 0.05) -> SimpleNamespace:
    return SimpleNamespace(
        name=list(names), lease=SimpleNamespace(sec=0, nanosec=round(lease * 1e9))
    )


def status(name: str, level: int = 0, text: str = "ok", **values: str) -> SimpleNamespace:
    pairs = [SimpleNamespace(key=key, value=value) for key, value in values.items()]
    return SimpleNamespace(name=name, level=bytes([level]), message=text, values=pairs)


def empty(namespace: str = "") -> Dashboard:
    return Dashboard(namespace, dict.fromkeys(NAMES, LIMIT), stale_after=0.5)


def shown(message: SimpleNamespace) -> Dashboard:
    dashboard = empty()
    dashboard.heard(STATE, message, 0.0, 1)
    return dashboard


def drawn(
    dashboard: Dashboard,
    now: float = 0.0,
    width: int = 80,
    height: int = 24,
    calls: ServiceCalls | None = None,
    keys: KeyPad | None = None,
) -> list[str]:
    """Return the lines without styles."""
    group = picture(
        dashboard, calls or ServiceCalls(), keys or KeyPad(), now, "12:00:00", width, height
    )
    file = io.StringIO()
    Console(file=file, color_system=None, width=width, height=height).print(group, end="")
    return file.getvalue().removesuffix("\n").split("\n")


def row(lines: list[str], muscle: str) -> str:
    (found,) = (line for line in lines if line.startswith(f"{muscle} "))
    return found


def after(lines: list[str], label: str) -> str:
    (found,) = (line for line in lines if line.startswith(label))
    return found.removeprefix(label).strip()


@given(width=st.integers(20, 200), height=st.integers(1, 60), muscles=st.integers(0, 40))
def test_a_picture_fills_the_terminal_exactly(width: int, height: int, muscles: int) -> None:
    lines = drawn(shown(state(muscles)), width=width, height=height)
    assert len(lines) == height
    assert max(map(len, lines)) <= width


@given(height=st.integers(1, 60))
def test_the_keys_are_always_shown(height: int) -> None:
    assert drawn(shown(state()), height=height)[-1].startswith("e EMERGENCY STOP")


def test_ten_muscles_and_all_else_fit_into_80_by_24() -> None:
    dashboard = shown(state(fault=[Fault.OVER_TEMPERATURE.value] * 10))
    lines = drawn(dashboard)
    assert all("! over_temperature" in row(lines, name) for name in NAMES)


def test_names_that_begin_alike_stay_apart() -> None:
    names = ["biceps_brachii_long", "biceps_brachii_short"]
    lines = drawn(shown(state(2, name=names)))
    assert row(lines, "bicep~i_long").split()[1] == "0.2500"
    assert row(lines, "bicep~_short").split()[1] == "0.2500"


def test_a_muscle_is_shown_with_its_numbers() -> None:
    words = row(drawn(shown(state(temperature=[31.4] * 10))), "#3").split()
    assert words == ["#3", "0.2500", "20.0", "[..........]", "450", "0.40", "31", "length"]


@given(st.floats(0.0, 600.0), st.floats(0.0, 600.0))
def test_the_bar_grows_with_tension(one: float, other: float) -> None:
    low, high = sorted((one, other))
    lines = drawn(shown(state(2, tension=[low, high])))
    assert row(lines, "#1").count("#") <= row(lines, "#2").count("#")


@pytest.mark.parametrize(("tension", "end"), [(450.0, "]"), (451.0, ">")])
def test_a_tension_above_the_limit_leaves_the_bar(tension: float, end: str) -> None:
    assert f"{'#' * 10}{end}" in row(drawn(shown(state(tension=[tension] * 10))), "#1")


def test_a_muscle_that_the_description_does_not_know_has_no_limit() -> None:
    assert "[    ?     ]    -" in row(drawn(shown(state(1, name=["tail"]))), "tail")


def test_an_inhibited_muscle_is_named_so_as_long_as_the_lease_lasts() -> None:
    dashboard = shown(state())
    dashboard.heard(OVERRIDE, override("#3"), 0.0, 1)
    assert "inhibited" in row(drawn(dashboard, 0.04), "#3")
    assert "inhibited" not in row(drawn(dashboard, 0.04), "#2")
    assert "inhibited" not in row(drawn(dashboard, 0.06), "#3")


# Old states.


def test_before_the_first_state_the_picture_says_so() -> None:
    assert any(line.startswith("NO STATE YET") for line in drawn(empty()))


def test_an_old_state_is_called_stale_with_its_age_and_in_every_row() -> None:
    lines = drawn(shown(state()), 12.3)
    assert any(line.startswith("STALE: no state for 12 s") for line in lines)
    assert all("stale" in row(lines, name) for name in NAMES)
    assert all("was length" in row(lines, name) for name in NAMES)


def test_an_old_state_shows_no_bar() -> None:
    assert not re.search(r"\[#+", "\n".join(drawn(shown(state()), 1.0)))


def test_a_fresh_state_is_not_called_stale() -> None:
    assert "stale" not in "\n".join(drawn(shown(state()), 0.4)).lower()


def test_a_state_with_arrays_of_different_length_is_told_and_not_shown() -> None:
    dashboard = shown(state())
    dashboard.heard(STATE, state(tension=[99.0]), 0.1, 2)
    lines = drawn(dashboard, 0.1)
    assert any("tension has 1 values for 10 muscles" in line for line in lines)
    assert "99.0" not in "\n".join(lines)


# Other nodes.


def test_the_emergency_stop_is_told_while_the_bridge_reports_it() -> None:
    dashboard = shown(state())
    dashboard.diagnosed([status("bridge", 2, "emergency stop", emergency_stop="True")], 0.0)
    assert any("EMERGENCY STOP: zero" in line for line in drawn(dashboard, 0.1))
    dashboard.diagnosed([status("bridge", emergency_stop="False")], 1.0)
    assert not any("EMERGENCY STOP: zero" in line for line in drawn(dashboard, 1.1))


def test_the_worst_node_is_shown_with_its_text() -> None:
    dashboard = empty()
    dashboard.diagnosed([status("planner"), status("bridge", 2, "no boards")], 0.0)
    lines = drawn(dashboard, 0.1)
    assert after(lines, "nodes ") == "bridge ERROR: no boards"
    assert any(line.strip() == "ok: planner" for line in lines)


def test_a_long_text_of_the_worst_node_goes_on_in_the_next_line() -> None:
    dashboard = empty()
    dashboard.diagnosed([status("bridge", 1, "rejected " + "word " * 12 + "end")], 0.0)
    lines = drawn(dashboard, 0.1)
    (first,) = (number for number, line in enumerate(lines) if line.startswith("nodes "))
    assert lines[first + 1].endswith(" end")


def test_a_node_that_falls_silent_is_an_error() -> None:
    dashboard = empty()
    dashboard.diagnosed([status("bridge")], 0.0)
    assert after(drawn(dashboard, 5.0), "nodes ") == "bridge ERROR: silent for 5 s"


def test_nodes_of_another_arm_are_not_shown() -> None:
    dashboard = empty("left")
    dashboard.diagnosed([status("right/bridge", 2, "no boards")], 0.0)
    assert after(drawn(dashboard), "nodes ") == "no node heard in /diagnostics"


def test_the_executors_phase_comes_from_its_feedback_while_it_swings() -> None:
    dashboard = empty()
    dashboard.diagnosed([status("swing_executor", phase="idle")], 0.0)
    feedback = SimpleNamespace(feedback=SimpleNamespace(phase=4, distance_to_end=0.5))
    dashboard.heard(FEEDBACK, feedback, 0.1, 1)
    assert after(drawn(dashboard, 0.2), "executor ") == "swing, 0.50 rad to go"
    assert after(drawn(dashboard, 1.0), "executor ") == "idle"


def test_the_inhibitor_tells_what_it_inhibits_and_why_it_ended() -> None:
    dashboard = empty()
    dashboard.diagnosed([status("inhibitor", armed="True")], 0.0)
    armed = SimpleNamespace(armed=True, inhibited=["#3", "#9"], reason_text="")
    dashboard.heard(INHIBITION, armed, 0.0, 1)
    assert after(drawn(dashboard, 0.1), "inhibitor ") == "ARMED, inhibits #3 #9"
    assert after(drawn(dashboard, 2.0), "inhibitor ") == "was armed, silent for 2.0 s"
    ended = SimpleNamespace(armed=False, inhibited=[], reason_text="goal reached")
    dashboard.heard(INHIBITION, ended, 2.0, 2)
    assert after(drawn(dashboard, 2.5), "inhibitor ") == "not armed: goal reached"


def test_what_a_terminal_would_obey_is_not_passed_on() -> None:
    dashboard = empty()
    dashboard.diagnosed([status("bridge", 2, "\x1b[2Jgone\nand more")], 0.0)
    text = "\n".join(drawn(dashboard))
    assert "\x1b" not in text
    assert "gone and more" in text


def test_two_publishers_of_states_are_told() -> None:
    dashboard = shown(state())
    dashboard.publishers[STATE] = 2
    assert "muscle_state ? Hz (2 PUBLISHERS)" in "\n".join(drawn(dashboard))


# What was asked for.


def test_an_answer_is_shown_with_its_text() -> None:
    calls = ServiceCalls()
    calls.asked("hold_posture", 0.0)
    calls.answered("hold_posture", True, "holding measured lengths", 0.1)
    lines = drawn(empty(), 2.1, calls=calls)
    assert "hold_posture 2 s ago, done: holding measured lengths" in lines


def test_a_refusal_is_shown_as_failed() -> None:
    calls = ServiceCalls()
    calls.asked("clear_faults", 0.0)
    calls.answered("clear_faults", False, "the control process died", 0.1)
    assert "clear_faults 0 s ago, FAILED: the control process died" in drawn(
        empty(), 0.2, calls=calls
    )


def test_a_request_without_an_answer_is_not_called_done() -> None:
    calls = ServiceCalls()
    calls.asked("emergency_stop", 0.0)
    assert "emergency_stop asked 3 s ago, NO ANSWER yet" in drawn(empty(), 3.0, calls=calls)


def test_a_missing_service_is_told() -> None:
    calls = ServiceCalls()
    calls.missing("emergency_stop", 0.0)
    assert any("emergency_stop 0 s ago, NOT SENT" in line for line in drawn(empty(), calls=calls))


def test_the_question_whether_to_clear_is_shown_instead_of_the_keys() -> None:
    keys = KeyPad()
    keys.press("c", 0.0)
    assert drawn(empty(), 0.1, keys=keys)[-1].startswith("y clears faults")


def test_muscles_that_do_not_fit_are_counted_and_their_faults_named() -> None:
    faults = [0] * 39 + [Fault.ENCODER.value]
    lines = drawn(shown(state(40, fault=faults)))
    assert "and 31 more: make the window higher, FAULTS at #40" in lines
