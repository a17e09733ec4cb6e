"""Commands print to whoever reads, as long as he reads."""

import subprocess
import sys

PROGRAM = """
from fastswing_planner.printing import say
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
