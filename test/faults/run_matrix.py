"""Runs the fault matrix: every row, the timed ones many times, and writes its page."""

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "out/faults/results.jsonl"


def main() -> int:
    """Run; returns pytest's exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20, help="of each timed row")
    parser.add_argument("--page", type=Path, default=ROOT / "docs/fault_matrix.md")
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument(
        "--more", action="store_true", help="add to the results that are there; else start anew"
    )
    parser.add_argument("--page-only", action="store_true", help="only write the page")
    parser.add_argument("-k", default="", help="only rows that fit, as of pytest; no page")
    arguments = parser.parse_args()
    results: Path = arguments.results
    code = 0
    if not arguments.page_only:
        results.parent.mkdir(parents=True, exist_ok=True)
        if results.exists() and not arguments.more:
            stamp = time.strftime("%Y%m%d_%H%M%S")
            results.rename(results.with_name(f"results_{stamp}.jsonl"))
        environment = {
            **os.environ,
            "FASTSWING_FAULT_RUNS": str(arguments.runs),
            "FASTSWING_FAULT_RESULTS": str(results),
        }
        command = [sys.executable, "-m", "pytest", str(ROOT / "test/faults"), "-q"]
        code = subprocess.run([*command, "-k", arguments.k], env=environment, cwd=ROOT).returncode
    if arguments.k:
        print(f"results of some rows: {results}; --page-only writes the page")
        return code
    # Not before: it needs what is on the tests' path.
    from fault_page import write

    write(results, arguments.page)
    print(f"written: {arguments.page}")
    return code


if __name__ == "__main__":
    raise SystemExit(main())
