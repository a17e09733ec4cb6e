"""The command `plan` prints tables or JSON, draws, and says in one line what is wrong."""

import json
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from processes import executable

TIMEOUT_SEC = 120.0


def plan(*arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [str(executable("fastswing_planner", "plan")), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_SEC, check=False)


def refuse_constant(name: str) -> None:
    raise AssertionError(f"{name} is no JSON")


def parsed(text: str) -> Any:
    """Return what strict JSON says."""
    return json.loads(text, parse_constant=refuse_constant)


@pytest.fixture(scope="module")
def table() -> list[list[str]]:
    """Return the words of each line of the robot's own swing."""
    done = plan()
    assert (done.returncode, done.stderr) == (0, "")
    return [line.split() for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def record() -> Any:
    """Return the JSON of the robot's own swing, searched exhaustively."""
    done = plan("--json", "--search", "exhaustive")
    assert (done.returncode, done.stderr) == (0, "")
    return parsed(done.stdout)


@pytest.mark.parametrize(
    "row",
    [
        "S-p -0.7475 -0.4108",
        "basic 0.99 2.41 (E-p) none none",
        "inhibit 0.60 4.39 (E-p) none #2 #3 #9 #10",
        "elongate 0.78 3.30 (E-p) #9 none",
        "hybrid 0.60 4.39 (E-p) #9 #2 #3 #10",
        "elongate, 0.78 s instead of 0.99 s:",
        "#9 #10 2.59 start posture cannot be held",
        "Not every set of antagonists was tried: --search exhaustive does.",
    ],
)
def test_the_tables_hold_the_papers_swing(table: list[list[str]], row: str) -> None:
    assert row.split() in table


def test_the_elongated_muscle_holds_nothing(table: list[list[str]]) -> None:
    ninth = next(row for row in table if row[:3] == ["#9", "+0.465", "elongated"])
    assert ninth[3:] == ["44.5", "31", "0", "-31", "37"]


def test_the_record_holds_the_plan(record: Any) -> None:
    planned = record["plan"]
    assert planned["method"] == "elongate"
    assert planned["time_cost"] == pytest.approx(0.78)
    assert [
        name
        for name, kept in zip(planned["muscle_names"], planned["kept"], strict=True)
        if not kept
    ] == ["#9"]


def test_the_record_tells_what_elongating_costs(record: Any) -> None:
    planned = record["plan"]
    rise = dict(zip(planned["muscle_names"], planned["tension_rise"], strict=True))
    assert rise["#9"] < 0.0 < rise["#10"]


def test_the_record_holds_the_whole_trajectory(record: Any) -> None:
    trajectory = record["plan"]["trajectory"]
    assert {name: len(rows) for name, rows in trajectory.items()} == dict.fromkeys(trajectory, 27)


def test_the_record_tells_that_the_mask_is_proven(record: Any) -> None:
    verdicts = [trial["verdict"] for trial in record["plan"]["trials"]]
    assert (record["plan"]["proven"], len(verdicts), verdicts.count("taken")) == (True, 15, 1)


def test_the_record_compares_all_methods(record: Any) -> None:
    costs = {one["method"]: one["time_cost"] for one in record["comparison"]}
    assert costs == pytest.approx({"basic": 0.99, "inhibit": 0.6, "elongate": 0.78, "hybrid": 0.6})


@pytest.mark.parametrize(
    ("name", "begin", "end"),
    [("plan.png", b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"), ("plan.SVG", b"<?xml", b"</svg>\n")],
    ids=["png", "svg"],
)
def test_a_picture_is_drawn(tmp_path: Path, name: str, begin: bytes, end: bytes) -> None:
    assert plan("--plot", tmp_path / name, "--method", "hybrid").returncode == 0
    content = (tmp_path / name).read_bytes()
    assert (content[: len(begin)], content[-len(end) :]) == (begin, end)
    assert len(content) > 10_000


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (
            ["--payload", "50"],
            1,
            "the start posture cannot be held even with all muscles: 116 N m are missing; choose "
            "another start posture, less payload or a wider tension range",
        ),
        (
            ["--keep", "#11"],
            2,
            "unknown muscle '#11', choose from: #1, #2, #3, #4, #5, #6, #7, #8, #9, #10",
        ),
        (
            ["--start", "lying"],
            2,
            "--start is 'lying': give one angle [rad] for each of S-p, S-r, S-y, E-p, E-y, with "
            "commas between, or a posture of the robot: home, start, end",
        ),
        (
            ["--start=1,2"],
            2,
            "start_position has 2 values, expected 5: S-p, S-r, S-y, E-p, E-y",
        ),
        (["--threshold", "nan"], 2, "threshold is nan, expected a finite number"),
        (["--max-steps", 10**20], 2, f"max_steps is {10**20}, must be 1 to 100000"),
        (
            ["--payload", "1", "--payload-position", "1,2"],
            2,
            "--payload-position has 2 numbers, expected 3",
        ),
        (
            ["--robot", "/no/such.yaml"],
            2,
            "/no/such.yaml: no such file; give the YAML file of your robot: "
            "robot_description, --robot",
        ),
        (
            ["--plot", "plan.xyz"],
            2,
            "--plot is 'plan.xyz': choose a file name that ends in .png, .svg, .pdf",
        ),
        (
            ["--plot", "/no/such/plan.png"],
            2,
            "--plot: [Errno 2] No such file or directory: '/no/such/plan.png'",
        ),
        (
            ["--velocity-limit", "fast"],
            2,
            "argument --velocity-limit: 'fast' is not numbers with commas; see --help",
        ),
        (["--swing"], 2, "argument --swing-weight: expected one argument; see --help"),
        (["now"], 2, "unrecognized arguments: now; see --help"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(arguments: list[object], code: int, text: str) -> None:
    done = plan(*arguments)
    assert (done.returncode, done.stdout, done.stderr) == (code, "", f"plan: {text}\n")


def test_angles_may_begin_with_a_minus() -> None:
    done = plan("--start", "start", "--end", "-0.4,0,0,-0.6,0")
    assert done.returncode == 0, done.stderr


def test_a_broken_robot_file_is_told_in_one_line(tmp_path: Path) -> None:
    broken = tmp_path / "robot.yaml"
    broken.write_text("joints: [S-p\nmuscles: {\n")
    done = plan("--robot", broken)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.startswith(f"plan: {broken}: not a readable YAML file: ")


def test_an_error_is_told_to_programs_too() -> None:
    done = plan("--json", "--payload", "nan")
    text = "payload_mass is nan, expected a finite number"
    assert parsed(done.stdout) == {"error_code": "NOT_FINITE", "error_string": text}


def test_a_wrong_file_name_is_no_defect_of_ours() -> None:
    assert parsed(plan("--json", "--plot", "plan").stdout)["error_code"] == "INVALID_REQUEST"


def test_help_tells_every_option_and_ends_with_0() -> None:
    done = plan("--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert all(option in done.stdout for option in ("--search", "--holding-weight", "--plot FILE"))


def test_a_reader_that_has_read_enough_ends_it_without_a_word() -> None:
    process = subprocess.Popen(
        [str(executable("fastswing_planner", "plan"))],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    process.stdout.close()
    process.stdout = None
    assert process.communicate(timeout=TIMEOUT_SEC)[1] == b""
    assert process.returncode == -signal.SIGPIPE
