"""A plan for people, and for programs."""

import enum
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from fastswing_planner.command_line import text_table
from fastswing_planner.planning.plan import Outcome, SwingPlan


def plan_text(plan: SwingPlan, comparison: Sequence[Outcome]) -> str:
    """Return tables of a plan, the masks that were tried, and all methods side by side."""
    parts = [
        text_table(["joint", "start [rad]", "end [rad]"], _posture_rows(plan)),
        text_table(
            ["method", "time [s]", "peak speed [rad/s]", "elongated", "inhibited"],
            [_outcome_row(outcome) for outcome in comparison],
        ),
        f"{plan.method.name.lower()}, {plan.time_cost:.2f} s "
        f"instead of {plan.time_cost_basic:.2f} s:",
        text_table(
            [
                "muscle",
                "q [s/rad]",
                "mask",
                "elongation [mm]",
                "start, all [N]",
                "start [N]",
                "rise [N]",
                "end [N]",
            ],
            _muscle_rows(plan),
        ),
        f"The start can be held with {plan.holding_margin:.2f} N m more in any direction.",
        text_table(
            ["masks tried", "time [s]", "torque missing [N m]", "verdict"],
            [
                [
                    _names(plan.muscles(~trial.kept)),
                    f"{trial.time_cost:.2f}" if trial.time_cost else "",
                    "" if trial.time_cost else f"{trial.holding_residual:.3g}",
                    trial.verdict.value,
                ]
                for trial in plan.trials
            ],
        ),
        *_proof(plan),
        *(f"Warning: {text}" for text in plan.warnings),
    ]
    return "\n\n".join(parts)


def _proof(plan: SwingPlan) -> list[str]:
    if not plan.method.elongates:
        return []
    if plan.proven:
        return ["No other set of antagonists is better."]
    return ["Not every set of antagonists was tried: --search exhaustive does."]


def plan_record(plan: SwingPlan) -> dict[str, Any]:
    """Return a plan as plain numbers, texts, lists and dictionaries, named as its fields."""
    record = {field.name: _plain(getattr(plan, field.name)) for field in fields(plan)}
    record["time_cost"] = plan.time_cost
    record["tension_rise"] = plan.tension_rise.tolist()
    return record


def comparison_record(comparison: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return what each method came to, as plain numbers, texts and lists."""
    records = []
    for outcome in comparison:
        record: dict[str, Any] = {"method": outcome.method.name.lower()}
        if outcome.plan is not None:
            plan = outcome.plan
            record["time_cost"] = plan.time_cost
            record["peak_joint_velocity"] = _peaks(plan).tolist()
            record["elongated"] = list(plan.muscles(plan.elongated))
            record["inhibited"] = list(plan.muscles(plan.inhibited))
        if outcome.error is not None:
            record["error_code"] = outcome.error.code_name
            record["error_string"] = str(outcome.error)
        records.append(record)
    return records


def _plain(value: Any) -> Any:
    if isinstance(value, enum.Enum):
        return value.name.lower()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    if is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    return value


def _posture_rows(plan: SwingPlan) -> list[list[str]]:
    return [
        [name, f"{start:.4f}", f"{end:.4f}"]
        for name, start, end in zip(plan.joint_names, plan.start, plan.end, strict=True)
    ]


def _outcome_row(outcome: Outcome) -> list[str]:
    name = outcome.method.name.lower()
    if outcome.plan is None:
        return [name, "", "", f"{outcome.error}", ""]
    plan = outcome.plan
    peaks = _peaks(plan)
    fastest = int(np.argmax(peaks))
    return [
        name,
        f"{plan.time_cost:.2f}",
        f"{peaks[fastest]:.2f} ({plan.joint_names[fastest]})",
        _names(plan.muscles(plan.elongated)),
        _names(plan.muscles(plan.inhibited)),
    ]


def _muscle_rows(plan: SwingPlan) -> list[list[str]]:
    state: Mapping[tuple[bool, bool], str] = {
        (True, False): "kept",
        (False, True): "inhibited",
        (False, False): "elongated",
    }
    return [
        [
            name,
            f"{plan.speed_index[i]:+.3f}",
            state[bool(plan.kept[i]), bool(plan.inhibited[i])],
            f"{plan.elongation[i] * 1e3:.1f}",
            f"{plan.basic_tension[i]:.0f}",
            f"{plan.holding_tension[i]:.0f}",
            f"{round(plan.tension_rise[i]) or 0:+d}",
            f"{plan.final_tension[i]:.0f}",
        ]
        for i, name in enumerate(plan.muscle_names)
    ]


def _peaks(plan: SwingPlan) -> Any:
    return np.abs(plan.trajectory.joint_velocity).max(axis=0)


def _names(names: Sequence[str]) -> str:
    return " ".join(names) or "none"
