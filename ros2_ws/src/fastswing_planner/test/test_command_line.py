"""What commands print: to whoever reads, as long as he reads, and in columns."""

import subprocess
import sys

from fastswing_planner.command_line import text_table

PROGRAM = """
from fastswing_planner.command_line import say
for _ in range(100_000):
    say("a line")
"""


def test_a_reader_that_has_seen_enough_is_no_error() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as command:
        assert command.stdout is not None
        assert command.stderr is not None
        assert command.stdout.readline() == b"a line\n"
        command.stdout.close()
        assert command.stderr.read() == b""
    assert command.returncode == 0


def test_columns_are_as_wide_as_their_widest_cell_and_lines_end_without_spaces() -> None:
    assert text_table(["muscle", "q"], [["#9", "+0.400"], ["#10", ""]]).splitlines() == [
        "muscle  q",
        "--------------",
        "#9      +0.400",
        "#10",
    ]
