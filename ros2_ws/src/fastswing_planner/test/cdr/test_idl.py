"""Both encodings of a definition say the same: tried on every message that is installed."""

from pathlib import Path

import pytest
from ament_index_python.packages import get_package_share_directory, get_packages_with_prefixes

from fastswing_planner.cdr.idl import parse_ros2idl
from fastswing_planner.cdr.schema import Field, Repeat, parse_ros2msg
from fastswing_planner.conversion.definitions import definition_text
from fastswing_planner.errors import UndecodableMessage

NAME = "lab_msgs/msg/Odd"


def installed_messages() -> list[str]:
    """Return all messages whose packages are installed as .msg and as .idl."""
    found = []
    for package in sorted(get_packages_with_prefixes()):
        share = Path(get_package_share_directory(package)) / "msg"
        found += [
            f"{package}/msg/{path.stem}"
            for path in sorted(share.glob("*.msg"))
            if path.with_suffix(".idl").exists()
        ]
    return found


def idl_text(type_name: str) -> str:
    """Return what rosbag2 stores: each .idl that the type needs, below a line that names it."""
    parts = []
    for name in parse_ros2msg(type_name, definition_text(type_name)).types:
        package, _, short = name.split("/")
        text = (Path(get_package_share_directory(package)) / "msg" / f"{short}.idl").read_text()
        parts.append(f"{'=' * 80}\nIDL: {name}\n{text}")
    return "".join(parts)


MESSAGES = installed_messages()


def test_many_messages_are_installed() -> None:
    assert len(MESSAGES) > 100
    assert "fastswing_msgs/msg/SwingPlan" in MESSAGES


@pytest.mark.parametrize("type_name", MESSAGES)
def test_idl_and_msg_define_the_same_fields(type_name: str) -> None:
    from_msg = parse_ros2msg(type_name, definition_text(type_name))
    assert parse_ros2idl(type_name, idl_text(type_name)).types == from_msg.types


def fields_of(body: str, before: str = "") -> tuple[Field, ...]:
    text = f"module lab_msgs {{ module msg {{ {before} struct Odd {{ {body} }}; }}; }};"
    return parse_ros2idl(NAME, text).fields


def test_bounds_do_not_change_a_type() -> None:
    assert fields_of("sequence<string<5>, 3> a; string<7> b;") == (
        Field("a", "string", Repeat.SEQUENCE, 0),
        Field("b", "string"),
    )


def test_an_array_may_stand_in_the_member() -> None:
    assert fields_of("double a[3];") == (Field("a", "float64", Repeat.ARRAY, 3),)


def test_annotations_comments_and_constants_are_skipped() -> None:
    before = 'module Odd_Constants { const octet A = 1; }; @verbatim (language="c", text="a (b")'
    assert fields_of('@key @unit(value="m") long a; // b\n /* c */', before) == (
        Field("a", "int32"),
    )


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("union Odd {};", "the IDL definition of lab_msgs/msg/Odd has 'union'"),
        (
            "struct Odd { long",
            "the IDL definition of lab_msgs/msg/Odd has its end where more is expected",
        ),
        (
            "struct Odd { long a b;",
            "the IDL definition of lab_msgs/msg/Odd has 'b' where ';' is expected",
        ),
        ("struct Odd { long `a; };", "the IDL definition of lab_msgs/msg/Odd has '`a; };'"),
    ],
)
def test_what_is_not_understood_is_named(text: str, complaint: str) -> None:
    with pytest.raises(UndecodableMessage) as caught:
        parse_ros2idl(NAME, text)
    assert str(caught.value) == complaint
