"""The recorder's parameters."""

from fastswing_planner.bags.writer import COMPRESSIONS
from fastswing_planner.lifecycle.parameters import Parameter
from fastswing_planner.nodes.recorded_topics import TYPES

TABLE = (
    Parameter(
        "output",
        "",
        "The new .mcap file; any other name is that of a new folder with files and metadata.yaml. "
        "What exists is never overwritten.",
    ),
    Parameter(
        "topics",
        [*(name for name in TYPES if name != "diagnostics"), "/diagnostics"],
        "What is recorded: names of the suite's topics, in any namespace, or 'NAME TYPE'.",
    ),
    Parameter(
        "compression",
        "zstd",
        "Of each chunk. zstd halves the file, none costs the least time.",
        choices=tuple(COMPRESSIONS),
    ),
    Parameter(
        "chunk_size",
        256 * 1024,
        "A chunk is written when it is larger. What is not written is lost when the recorder is "
        "killed.",
        "bytes",
        1024,
        2**26,
    ),
    Parameter(
        "split_size",
        0,
        "A folder's next file begins when a file is as large; 0: never.",
        "bytes",
        0,
        2**50,
    ),
    Parameter(
        "split_duration",
        0.0,
        "A folder's next file begins as long after a file's first message; 0: never.",
        "s",
        0.0,
        1e6,
    ),
    Parameter(
        "flush_period", 0.5, "A chunk is written at the latest after this time.", "s", 0.01, 60.0
    ),
)
