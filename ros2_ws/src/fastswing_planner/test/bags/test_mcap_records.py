"""Every complete message of a block is found, however the block ends."""

import struct

import pytest

from fastswing_planner.bags.mcap_records import MESSAGE, PREFIX, message_heads

SCHEMA = 3


def record(code: int, content: bytes) -> bytes:
    return PREFIX.pack(code, len(content)) + content


def message(number: int) -> bytes:
    return record(MESSAGE, struct.pack("<HIQQ", 1, number, number, number) + bytes(8))


@pytest.mark.parametrize("cut", range(1, 59))
@pytest.mark.parametrize("code", [MESSAGE, SCHEMA])
def test_a_cut_record_costs_no_message_before_it(code: int, cut: int) -> None:
    content = message(1) + message(2) + record(code, bytes(50))[:-cut]
    _, heads = message_heads(content)
    assert heads["sequence"].tolist() == [1, 2]
