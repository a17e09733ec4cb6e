"""What the kernel grants is in force, and what it refuses is told."""

import json
import os
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from fastswing_planner.lifecycle.real_time import CoreSleep, use_cores, use_priority

# A process of its own, with a second thread, and one that is started afterwards.
PROGRAM = """
import gc, json, os, sys, threading, time
from pathlib import Path
from fastswing_planner.lifecycle import real_time

threading.Thread(target=time.sleep, args=(5,), daemon=True).start()
refused = eval(sys.argv[1], vars(real_time))
threading.Thread(target=time.sleep, args=(5,), daemon=True).start()
tasks = [int(entry.name) for entry in Path("/proc/self/task").iterdir()]
print(json.dumps({
    "refused": refused,
    "policies": [os.sched_getscheduler(task) for task in tasks],
    "cores": [sorted(os.sched_getaffinity(task)) for task in tasks],
    "slack": int(Path("/proc/self/timerslack_ns").read_text()),
    "frozen": gc.get_freeze_count(),
}), flush=True)
os._exit(0)
"""


def after(call: str) -> dict[str, Any]:
    """Return what a process is like after a call of the module."""
    command = [sys.executable, "-c", PROGRAM, call]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def held_files() -> list[str]:
    """Return the files that this process has open."""
    return [os.readlink(link) for link in Path("/proc/self/fd").iterdir() if link.is_symlink()]


def may_be_real_time() -> bool:
    """Whether the kernel lets this user ask for SCHED_FIFO."""
    return not after("use_priority(1)")["refused"]


def test_timers_wake_when_they_were_asked_to() -> None:
    assert after("tighten_timers()")["slack"] == 1


def test_all_threads_run_on_the_chosen_core_only() -> None:
    core = min(os.sched_getaffinity(0))
    found = after(f"use_cores([{core}])")
    assert (found["refused"], found["cores"]) == ("", [[core]] * 3)


def test_a_core_that_is_not_there_is_told() -> None:
    assert use_cores([1023]) == "cpu_affinity [1023] refused: Invalid argument"


def test_a_priority_is_that_of_all_threads_or_its_refusal_is_told() -> None:
    found = after("use_priority(10)")
    if may_be_real_time():
        assert found["policies"] == [os.SCHED_FIFO] * 3
    else:
        assert found["refused"].startswith("realtime_priority 10 refused: Operation not permitted")


def test_a_priority_that_does_not_exist_is_told() -> None:
    assert use_priority(1000).startswith("realtime_priority 1000 refused: ")


@pytest.mark.parametrize("call", ["use_priority(0)", "use_cores([])"])
def test_nothing_asked_for_changes_nothing(call: str) -> None:
    found, untouched = after(call), after("''")
    assert found == untouched


def test_everything_that_failed_is_told_at_once() -> None:
    refused = after("ask_for_real_time(1000, [1023])")["refused"]
    assert [text.split()[0] for text in refused] == ["cpu_affinity", "realtime_priority"]


def test_no_core_sleeps_while_the_kernels_file_is_held(tmp_path: Path) -> None:
    file = tmp_path / "latency"
    file.touch()
    core_sleep = CoreSleep(True, file)
    assert core_sleep.prevent() == core_sleep.prevent() == ""
    assert file.read_bytes() == struct.pack("i", 0)
    assert str(file) in held_files()
    core_sleep.allow()


def test_cores_sleep_unless_asked_not_to(tmp_path: Path) -> None:
    assert CoreSleep(False, tmp_path).prevent() == ""


def test_cores_may_sleep_again(tmp_path: Path) -> None:
    file = tmp_path / "latency"
    file.touch()
    core_sleep = CoreSleep(True, file)
    core_sleep.prevent()
    core_sleep.allow()
    core_sleep.allow()
    assert str(file) not in held_files()


def test_a_kernel_that_lets_cores_sleep_is_told(tmp_path: Path) -> None:
    core_sleep = CoreSleep(True, tmp_path)
    assert core_sleep.prevent() == f"{tmp_path} refused: Is a directory; cores may sleep"


def test_a_kernel_without_the_file_is_told_and_none_is_made(tmp_path: Path) -> None:
    file = tmp_path / "latency"
    refused = CoreSleep(True, file).prevent()
    assert refused == f"{file} refused: No such file or directory; cores may sleep"
    assert not file.exists()


def test_what_was_there_is_out_of_the_garbage_collectors_sight() -> None:
    assert after("keep_what_there_is() or ''")["frozen"] > 1000
