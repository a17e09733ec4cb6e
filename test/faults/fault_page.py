"""Writes docs/fault_matrix.md from the results of `make faults`."""

import json
import os
import platform
import re
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[2] / "demo")]

from bench import HOLD  # noqa: E402
from fault_rows import ROWS, Row, Safe  # noqa: E402

Result = dict[str, Any]
LEASE_MS, PERIOD_MS, WATCHDOG_MS = 50.0, 2.0, 100.0
_LONGEST_TEXT = 110

HEAD = """# What happens when something breaks

Made by `make faults` (`test/faults/fault_page.py`) on {date}: {attempts} faults,
through the executables, on {machine}. Do not edit it by hand.
`make test` runs {quick} of the {rows} rows once.

All nodes run with their defaults, but `raise_speed` 2 rad/s to save time. Every time is taken
where the truth is: in the log of the emulated boards (`board_log` of the mock driver), which notes
each command frame and each change of the boards with the monotonic clock. Time until safe counts
from the injection: median / largest (runs). "Safe" is the row's own word:

{safe}

The phases are those of a swing by Method 1; in `swing` the fault comes while muscles are let go.
{disturbed}

"""

CLAIMS = """## What is claimed of all rows

| claim | measured |
|---|---|
{claims}

The first two are asserted in frames and in the boards' own time, not in seconds of the machine: a
bridge that is not scheduled sends no frames, and boards that are not scheduled do not age. So they
hold on a busy machine too. The milliseconds include the machine's stalls.

"""

BESIDES = """## Besides

- **Method 1's muscles come back without a jump.** The zero current ends with the lease. Then the
  setpoint moves from the measured length to the commanded one within the speed limit: that is the
  difference between "no muscle is let go" and `held`.
- **A swing whose inhibitor dies ends**, when the executor has not heard of it for `state_timeout`:
  the muscles are back by then, and the arm is held where it is.
- **A bridge that is stopped (SIGSTOP)** goes on controlling for `supervision_timeout` (0.5 s) in
  its control process. Then this process stops sending too, and the boards' watchdog acts.
- **A stray joint state** that jumps ends the inhibition and the swing at once. One with NaN
  is counted and ignored.
- **After a fault the arm may hang where no muscles can hold it on its way to the start.** The next
  swing is then refused with HOLDING_INFEASIBLE. Support the arm, `emergency_stop`, let it hang,
  `clear_faults`, and swing again.
- **An executor that stood still does not go on with its swing**: after SIGCONT it ends it.
- **Boards that were not scheduled** take the frames that waited all at once. Which of them were
  sent before the fault follows from the bridge's rate: it sends one frame each period, and catches
  up one at most. Only frames that may have been sent after the fault count.
- **Current commands are not tension commands**: 1e6 A is clamped to the robot's `current_limit`,
  and reduced by the tension and speed that are measured ([safety.md](safety.md), promise 8). It may
  pull more than `tension_max`; when the stream ends the muscle holds the length it has, and so the
  tension.
- **Boards that hold when frames stop** (`watchdog_action` hold_length) keep without current what an
  override had let go. `emergency_stop` takes the current from the others too, as soon as a bridge
  reaches them: `test/system/test_safety.py`.

"""

NOT_COVERED = """## What this does not show

- Clock jumps are jumps of `/clock` with `use_sim_time`. A jump of the computer's own clock is not
  tried (it would move every process of the machine). The nodes see both through the same ROS clock;
  leases, time-outs and phases use the monotonic one.
- DDS under a cut network: [multi_host.md](multi_host.md).
- The boards are emulated. How a real board's watchdog acts is up to its firmware.
- A muscle that is held with constant commanded length is safe for the arm's structure, not for a
  hand between arm and table.
"""


def load(path: Path) -> tuple[dict[str, list[Result]], list[Result]]:
    """Return the results of each row, by its name, and the runs that failed."""
    results: dict[str, list[Result]] = {}
    failed = []
    for line in path.read_text().splitlines():
        result = json.loads(line)
        if "failed" in result:
            failed.append(result)
        else:
            results.setdefault(result["row"], []).append(result)
    return results, failed


def milliseconds(values: Sequence[float]) -> str:
    """Return median / largest (count) of times [s]."""
    if not values:
        return "–"
    middle, most = statistics.median(values) * 1e3, max(values) * 1e3
    return f"{middle:.0f} / {most:.0f} ms ({len(values)})"


def _alike(texts: Iterable[str]) -> Counter[str]:
    """Return how many texts differ in numbers only, by the first of them."""
    first: dict[str, str] = {}
    counts: Counter[str] = Counter()
    for text in texts:
        counts[first.setdefault(re.sub(r"\d+(\.\d+)?", "0", text), text)] += 1
    return counts


def _cell(text: str) -> str:
    # Of a file its name: the rest is this machine's.
    text = re.sub(r"(?<=\s)/\S+/", "", " ".join(text.split()).replace("|", "\\|"))
    return text if len(text) <= _LONGEST_TEXT else text[: _LONGEST_TEXT - 1] + "…"


def seen_text(row: Row, results: Sequence[Result]) -> str:
    """Return what an operator sees, as it was seen first."""
    places = dict.fromkeys(place for place, _ in row.sees)
    parts = []
    for place in places:
        text = _cell(results[0]["seen"][place])
        if place.endswith(" silent"):
            parts.append(f"`{place.split()[0]}` is missing in `/diagnostics`")
        elif place == "result":
            parts.append(f"swing: {text}")
        elif place.endswith(" log"):
            parts.append(f"log of `{place.split()[0]}`: {text}")
        elif "." in place:
            node, _, key = place.partition(".")
            parts.append(f"`{node}`: {key} {text}")
        else:
            parts.append(f"`{place}`: {text}")
    if row.phase != HOLD and "result" not in places:
        outcome = _alike(sorted(result["result"] for result in results if result["result"]))
        parts += [f"swing: {_cell(text)}" for text in outcome]
    later = _alike(
        sorted(
            result["result_after"]
            for result in results
            if result.get("result_after") and not result["result"]
        )
    )
    parts += [f"after the recovery the swing ends: {_cell(text)}" for text in later]
    parts += [_cell(note) for note in results[0]["notes"]]
    return "; ".join(parts) or "nothing"


def merged(rows: Sequence[Row]) -> list[list[Row]]:
    """Return rows that differ only in their phase together."""
    groups: dict[tuple[object, ...], list[Row]] = {}
    for row in rows:
        key = row.fault, row.safe, tuple(step.text for step in row.recover), tuple(row.sees)
        groups.setdefault(key, []).append(row)
    return list(groups.values())


def table_of(group: str, results: dict[str, list[Result]]) -> str:
    """Return the table of one group of faults."""
    lines = [
        f"## {group}",
        "",
        "| fault | in phase | safe is | time until safe | the operator sees | recovery |",
        "|---|---|---|---|---|---|",
    ]
    for rows in merged([row for row in ROWS if row.group == group and row.name in results]):
        row = rows[0]
        here = [result for one in rows for result in results[one.name]]
        times = [result["safe_after"] for result in here if result["safe_after"] is not None]
        recover = "; ".join(step.text for step in row.recover) or "nothing to do"
        lines.append(
            f"| {row.fault} | {', '.join(one.phase for one in rows)} | {row.safe.name.lower()} | "
            f"{milliseconds(times)} | {seen_text(row, here)} | {recover} |"
        )
    return "\n".join(lines) + "\n"


def claims(results: dict[str, list[Result]]) -> str:
    """Return the table of what is claimed of all rows."""
    everything = [result for several in results.values() for result in several]
    of_inhibitor = [
        result
        for row in ROWS
        if re.search("SIG.* of inhibitor", row.fault) and row.phase == "swing"
        for result in results.get(row.name, [])
    ]
    frames = [result["frames_without_current"] for result in of_inhibitor]
    times = [result["let_go_sec"] for result in of_inhibitor if result.get("let_go_sec")]
    held = [result["safe_after"] for result in of_inhibitor]
    watchdog = [
        result for row in ROWS if row.safe is Safe.WATCHDOG for result in results.get(row.name, [])
    ]
    silence = [result["silence"] * 1e3 for result in watchdog]
    after = [result["safe_after"] for result in watchdog]
    beyond = sum(len(result["beyond_limits"]) for result in everything)
    by_hand = sum(len(result["killed_by_hand"]) for result in everything)
    peak = max(result["peak_tension"] for result in everything)
    most = LEASE_MS / PERIOD_MS + 2
    return "\n".join(
        [
            "| inhibitor killed or stopped in the swing: no muscle is let go longer than lease + "
            f"two control periods, {LEASE_MS:g} + {2 * PERIOD_MS:g} ms or {most:g} frames | at "
            f"most {max(frames)} frames in {len(frames)} runs; the last such frame after "
            f"{milliseconds(times)}; back at constant lengths, bumplessly, after "
            f"{milliseconds(held)} |",
            "| bridge killed or stopped, bus dead: every board in its watchdog action within "
            f"{WATCHDOG_MS:g} ms + one period | {min(silence):.1f} to {max(silence):.1f} ms of the "
            f"boards' time in {len(silence)} runs; {milliseconds(after)} from the injection |",
            f"| no command above a limit, tensions above all | {beyond} in {len(everything)} runs; "
            f"largest tension measured {peak:.0f} N, the boards pay out above 450 N |",
            f"| no node has to be killed by hand | {by_hand} in {len(everything)} runs |",
        ]
    )


def failures(failed: Sequence[Result]) -> str:
    """Return the section of runs that did not end as their row says."""
    if not failed:
        return ""
    lines = ["## Runs that failed", ""]
    lines += [f"- {result['row']}: {_cell(result['failed'])}" for result in failed]
    return "\n".join(lines) + "\n\n"


def disturbances(everything: Sequence[Result]) -> str:
    """Return which attempts were repeated, and why."""
    reasons = _alike(reason for result in everything for reason in result["disturbed"])
    if not reasons:
        return "No attempt had to be repeated."
    lines = [f"- {count} times: {_cell(reason)}" for reason, count in reasons.most_common()]
    return (
        f"{reasons.total()} attempts in which something else broke before the fault was made, or "
        "the machine stalled, were repeated:\n\n" + "\n".join(lines)
    )


def page(results: dict[str, list[Result]], failed: Sequence[Result], date: str) -> str:
    """Return the whole page."""
    everything = [result for several in results.values() for result in several]
    disturbed = disturbances(everything)
    machine = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores shared with others"
    text = HEAD.format(
        date=date,
        attempts=len(everything),
        machine=machine,
        quick=sum(row.quick for row in ROWS),
        rows=len(ROWS),
        safe="\n".join(f"- `{safe.name.lower()}`: {safe.value}" for safe in Safe),
        disturbed=disturbed,
    )
    text += CLAIMS.format(claims=claims(results)) + failures(failed)
    for group in dict.fromkeys(row.group for row in ROWS):
        text += table_of(group, results) + "\n"
    missing = [f"{row.fault}, {row.phase}" for row in ROWS if row.name not in results]
    if missing:
        text += f"## Rows that this run did not reach\n\n{len(missing)}: {'; '.join(missing)}.\n\n"
    return text + BESIDES + NOT_COVERED


def write(results_file: Path, output: Path) -> None:
    """Write the page."""
    date = time.strftime("%Y-%m-%d", time.localtime(results_file.stat().st_mtime))
    output.write_text(page(*load(results_file), date))
