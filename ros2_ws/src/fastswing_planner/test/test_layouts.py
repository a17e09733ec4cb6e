"""Every topic, field, joint and muscle that the layouts name exists."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from ament_index_python.packages import get_package_share_directory

from fastswing_planner.nodes.recorded_topics import TYPES, message_class
from fastswing_planner.robot.description import Robot

LAYOUTS = Path(get_package_share_directory("fastswing_planner")) / "layouts"
FIELD = re.compile(r"/(?P<topic>\w+)(?:[./](?P<field>\w+)(?:\[(?P<index>\d+)\])?)?")
JOINT_CURVE = re.compile(r"/joint_states/(?P<joint>[^/]+)/(?P<field>position|velocity|effort)")
NUMBER = re.compile(r"-?\d+\.\d+")


@dataclass(frozen=True)
class Named:
    """A field of a topic as a layout names it; index -1: the whole field."""

    text: str
    topic: str
    field: str
    index: int
    label: str


def named(text: str, label: str = "") -> Named:
    found = FIELD.fullmatch(text)
    assert found is not None, f"'{text}' names no field"
    index = found["index"]
    return Named(
        text, found["topic"], found["field"] or "", -1 if index is None else int(index), label
    )


def foxglove() -> Any:
    return json.loads((LAYOUTS / "foxglove.json").read_text())


def foxglove_fields() -> list[Named]:
    fields = []
    for panel in foxglove()["configById"].values():
        paths = panel.get("paths", [])
        fields += [
            named(path["value"], path["label"])
            for path in paths
            if not NUMBER.fullmatch(path["value"])
        ]
        fields += [named(panel[key]) for key in ("topicPath", "topicToRender") if key in panel]
    return fields


def curves() -> list[str]:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    return [curve.attrib["name"] for curve in root.iter("curve")]


def plotjuggler_fields() -> list[Named]:
    # PlotJuggler shows joint states by the names in the message, other arrays by their indices.
    return [named(name) for name in curves() if not JOINT_CURVE.fullmatch(name)]


def leaves(tree: Any) -> Iterator[str]:
    if isinstance(tree, str):
        yield tree
    else:
        yield from leaves(tree["first"])
        yield from leaves(tree["second"])


FIELDS = [*foxglove_fields(), *plotjuggler_fields()]


@pytest.mark.parametrize("field", FIELDS, ids=[field.text for field in FIELDS])
def test_topic_and_field_exist_and_an_index_is_one_of_the_robots(
    field: Named, musashi: Robot
) -> None:
    types = message_class(TYPES[field.topic]).get_fields_and_field_types()  # type: ignore[attr-defined]
    if not field.field:
        return
    kind = types[field.field]
    assert kind.startswith("sequence") == (field.index >= 0)
    if field.index >= 0:
        model = musashi.model
        names = model.joint_names if field.topic == "joint_states" else model.muscle_names
        assert field.index < len(names)
        assert field.label in ("", names[field.index])


def test_plotjuggler_draws_every_joint_of_the_robot(musashi: Robot) -> None:
    drawn = [found["joint"] for found in map(JOINT_CURVE.fullmatch, curves()) if found]
    assert drawn == list(musashi.model.joint_names)


@pytest.mark.parametrize("field", ["velocity", "tension", "current", "mode"])
def test_both_draw_every_muscle(field: str, musashi: Robot) -> None:
    for fields in (foxglove_fields(), plotjuggler_fields()):
        drawn = [one.index for one in fields if (one.topic, one.field) == ("muscle_state", field)]
        assert drawn == list(range(len(musashi.model.muscle_names)))


def test_foxglove_places_every_panel_once() -> None:
    layout = foxglove()
    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


def test_the_speed_limit_in_the_layout_is_the_robots(musashi: Robot) -> None:
    paths = foxglove()["configById"]["Plot!musclespeed"]["paths"]
    lines = {float(path["value"]) for path in paths if NUMBER.fullmatch(path["value"])}
    (limit,) = set(musashi.limits.velocity.tolist())
    assert lines == {-limit, limit}
