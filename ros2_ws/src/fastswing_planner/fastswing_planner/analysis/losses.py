"""What a bag tells of messages that were lost or refused."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from fastswing_planner.bags import Bag, BagError
from fastswing_planner.bags.writer import NOTES

DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_COUNTED = ("rejected", "refused", "lost", "late_", "missed", "overruns", "dropped")
"""What the names of counted losses in the diagnostics begin with."""
_MOST_DIGITS = 20
"""Of a 64-bit count."""


def recorder_losses(records: Sequence[tuple[Path, str, Mapping[str, str]]]) -> list[str]:
    """Return what the recorder itself says it lost, a line for each topic and file.

    records  file, name and content of a bag's metadata
    """
    lines = []
    for path, name, content in records:
        if name != NOTES:
            continue
        try:
            told = json.loads(content.get("lost", "{}"))
            counts = [(str(topic), int(count)) for topic, count in told.items()]
        except (ValueError, TypeError, AttributeError):
            lines.append(f"{path.name}: what the recorder says of its losses cannot be read")
            continue
        lines += [
            f"the recorder lost {count} messages of {topic}" for topic, count in counts if count
        ]
    return lines


def counted_losses(bag: Bag) -> tuple[dict[str, dict[str, int]], list[str]]:
    """Return by how much the nodes' counts of rejections and losses rose, and what went wrong.

    A count that falls belongs to a node that began anew.
    """
    risen: dict[str, dict[str, int]] = {}
    last: dict[tuple[str, str], int] = {}
    warnings: list[str] = []
    for topic in bag.topics_of_type(DIAGNOSTICS):
        try:
            for _, message in bag.messages(topic):
                for status in message.status:
                    counts = {
                        pair.key: int(pair.value)
                        for pair in status.values
                        if pair.key.startswith(_COUNTED) and _is_count(pair.value)
                    }
                    _count(risen, last, status.name, counts)
        except BagError as error:
            warnings.append(str(error))
    return {node: counts for node, counts in risen.items() if counts}, warnings


def _is_count(text: str) -> bool:
    """Return whether a text is a number of 64 bits as nodes write it; '²' is a digit, too."""
    return text.isascii() and text.isdecimal() and len(text) <= _MOST_DIGITS


def _count(
    risen: dict[str, dict[str, int]],
    last: dict[tuple[str, str], int],
    node: str,
    counts: Mapping[str, int],
) -> None:
    """Add what rose since the node's last report; its first one is where counting begins."""
    first = node not in risen
    total = risen.setdefault(node, {})
    for name, value in counts.items():
        # A count that appears later was zero before.
        known = last.get((node, name), value if first else 0)
        rise = value - known if value >= known else value
        last[node, name] = value
        if rise:
            total[name] = total.get(name, 0) + rise
