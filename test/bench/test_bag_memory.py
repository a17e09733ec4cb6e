"""Reading columns takes memory that does not grow with the bag."""

import subprocess
import sys
from pathlib import Path

from bag_reading import write_bag

# The last lines of the program: peak memory [MB] after streaming a bag.
STREAM = """
import resource, sys
from fastswing_planner.bags import open_bag
count = 0
for part in open_bag(sys.argv[1]).stream("/joint_states"):
    count += part["position"].shape[0]
print(count, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
"""


def streamed(path: Path) -> tuple[int, float]:
    """Stream a bag in a process of its own; returns messages and peak memory [MB]."""
    command = [sys.executable, "-c", STREAM, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300)
    count, memory = done.stdout.split()
    return int(count), float(memory)


def test_memory_is_flat_from_a_hundred_thousand_to_a_million_messages(tmp_path: Path) -> None:
    memory = {}
    for count in (100_000, 1_000_000):
        path = write_bag(tmp_path / f"{count}.mcap", count, ("/joint_states",))
        found, memory[count] = streamed(path)
        path.unlink()
        assert found == count
    assert memory[1_000_000] < 1.2 * memory[100_000]
