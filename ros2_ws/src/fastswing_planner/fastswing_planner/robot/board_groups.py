"""Which motor boards share a bus: the optional key `board_groups` of a robot's description."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fastswing_planner.arrays import unique_known
from fastswing_planner.errors import InvalidRequest, RobotDescriptionError

_EXPECTED = "expected a list of {muscles: [...], joints: [...]}, one for each bus"


@dataclass(frozen=True)
class BoardGroup:
    """The boards on one bus, by index into the robot's muscles and joints.

    muscles  in the order of the boards' ids, at least one
    joints   those that these boards measure, in the order of their answer
    """

    muscles: tuple[int, ...]
    joints: tuple[int, ...]


def whole_robot(muscles: int, joints: int) -> tuple[BoardGroup, ...]:
    """Return the single group of a robot whose boards are all on one bus."""
    return (BoardGroup(tuple(range(muscles)), tuple(range(joints))),)


def board_groups(
    content: Any, muscles: Sequence[str], joints: Sequence[str]
) -> tuple[BoardGroup, ...]:
    """Read the key's content; None means one group of everything.

    Raises RobotDescriptionError unless each muscle and each joint is in exactly one group.
    """
    if content is None:
        return whole_robot(len(muscles), len(joints))
    if not isinstance(content, list) or not content or not all(map(_is_group, content)):
        raise RobotDescriptionError(f"key 'board_groups' is {content!r}, {_EXPECTED}")
    _check_all_named("muscle", [name for group in content for name in group["muscles"]], muscles)
    _check_all_named("joint", [name for group in content for name in _joints(group)], joints)
    return tuple(
        BoardGroup(
            tuple(muscles.index(name) for name in group["muscles"]),
            tuple(joints.index(name) for name in _joints(group)),
        )
        for group in content
    )


def _is_group(group: Any) -> bool:
    if not isinstance(group, dict) or not {"muscles"} <= group.keys() <= {"muscles", "joints"}:
        return False
    lists = isinstance(group["muscles"], list) and isinstance(_joints(group), list)
    return lists and len(group["muscles"]) > 0


def _joints(group: dict[str, Any]) -> Any:
    return group.get("joints", [])


def _check_all_named(kind: str, names: list[Any], valid: Sequence[str]) -> None:
    try:
        unique_known(kind, names, valid)
    except InvalidRequest as error:
        raise RobotDescriptionError(f"key 'board_groups': {error}") from error
    missing = [name for name in valid if name not in names]
    if missing:
        raise RobotDescriptionError(f"key 'board_groups' lacks {kind} {', '.join(missing)}")
