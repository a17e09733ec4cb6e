"""The command `swing` swings through running nodes, and Ctrl-C holds the arm."""

import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from processes import executable, isolated_environment

from fastswing_msgs.msg import MuscleState

if TYPE_CHECKING:
    from test.system.suite import Suite


_TIMEOUT_SEC = 120.0


@contextmanager
def running(suite: "Suite", *arguments: str) -> Iterator["subprocess.Popen[str]"]:
    with subprocess.Popen(
        [str(executable("fastswing_planner", "swing")), *arguments],
        env=isolated_environment(suite.domain),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def swing(suite: "Suite", *arguments: str) -> tuple[int, str]:
    """Run it to its end; return the exit code and what it printed."""
    with running(suite, *arguments) as process:
        text, _ = process.communicate(timeout=_TIMEOUT_SEC)
        return process.returncode, text


def test_a_swing_tells_its_phases_and_figures(all_nodes: "Suite") -> None:
    code, text = swing(all_nodes, "--method", "elongate")
    assert code == 0, text
    lines = text.splitlines()
    assert lines[:6] == ["plan", "raise", "elongate", "settle", "swing", "recover"]
    assert lines[6].startswith("swung in ")
    assert lines[6].endswith("; muscles masked: #9")
    assert lines[7].startswith("peak joint speeds [rad/s]: S-p ")


def test_ctrl_c_cancels_and_the_arm_holds(all_nodes: "Suite") -> None:
    with running(all_nodes) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.strip() == "raise":
                break
        process.send_signal(signal.SIGINT)
        text, _ = process.communicate(timeout=_TIMEOUT_SEC)
    assert process.returncode == 1
    assert "swing: CANCELED: canceled by the client; the arm holds where it is" in text
    assert set(all_nodes.fresh_muscles().mode) == {MuscleState.MODE_LENGTH}


def test_what_the_executor_refuses_is_told_by_name(all_nodes: "Suite") -> None:
    code, text = swing(all_nodes, "--start", "end", "--end", "end")
    assert code == 1
    assert text.splitlines()[-1].startswith("swing: START_EQUALS_END: ")


def test_a_wrong_posture_moves_nothing(world: "Suite") -> None:
    code, text = swing(world, "--end", "nowhere")
    assert code == 2
    assert text == (
        "swing: --end is 'nowhere': give one angle [rad] for each of S-p, S-r, S-y, E-p, E-y, "
        "with commas between, or a posture of the robot: home, start, end\n"
    )


def test_without_nodes_it_says_so(world: "Suite") -> None:
    code, text = swing(world, "--patience", "0.5")
    assert code == 1
    assert text == ("swing: no execute_swing for 0.5 s: are the nodes active, in this namespace?\n")
