"""What a table of a bag holds is what the bag holds."""

import csv
import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest
from bag_builder import (
    SECOND,
    START,
    STRING_NAME,
    Builder,
    joint_state,
    text,
    write_idl_beside_joints,
    write_joints,
)
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.bags import open_bag
from fastswing_planner.bags.table import MissingLibrary, data_frame, flat_columns, write_table
from fastswing_planner.commands.export_bag import main


def rows(path: Path) -> list[dict[str, str]]:
    with open(path, newline="") as stream:
        return list(csv.DictReader(stream))


def test_an_element_is_called_by_its_name(tmp_path: Path) -> None:
    flat = flat_columns(open_bag(write_joints(tmp_path / "a.mcap", 3)).columns("/joint_states"))
    assert flat["position[j1]"].tolist() == [0.0, -1.0, -2.0]


def test_elements_without_names_are_numbered(tmp_path: Path) -> None:
    bag = open_bag(write_joints(tmp_path / "a.mcap", 3))
    flat = flat_columns(bag.columns("/joint_states", fields=["position"]))
    assert list(flat) == ["time", "position[0]", "position[1]"]


def test_sequences_whose_length_changes_are_one_column(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints()
        for position in ([1.0], [2.0, 3.0]):
            bag.write("/joint_states", joint_state(position), START)
    columns = open_bag(tmp_path / "a.mcap").columns("/joint_states", fields=["position", "name"])
    write_table(columns, tmp_path / "a.csv", "csv")
    found = rows(tmp_path / "a.csv")
    assert [row["position"] for row in found] == ["[1.0]", "[2.0, 3.0]"]
    assert found[1]["name"] == '["j0", "j1"]'


@given(st.lists(st.floats(allow_nan=False), min_size=2, max_size=2))
def test_numbers_come_back_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, position: list[float]
) -> None:
    folder = tmp_path_factory.mktemp("bag")
    with Builder(folder / "a.mcap") as bag:
        bag.joints()
        bag.write("/joint_states", joint_state(position), START)
    write_table(open_bag(folder / "a.mcap").columns("/joint_states"), folder / "a.csv", "csv")
    (row,) = rows(folder / "a.csv")
    found = np.array([float(row["position[j0]"]), float(row["position[j1]"])])
    np.testing.assert_array_equal(found.view(np.int64), np.array(position).view(np.int64))


def test_times_keep_every_nanosecond(tmp_path: Path) -> None:
    time_ns = 1_795_435_340 * SECOND + 64_072_507
    path = write_joints(tmp_path / "a.mcap", 1, time_ns)
    assert main([str(path), "-o", str(tmp_path)]) == 0
    assert rows(tmp_path / "joint_states.csv")[0]["time"] == "1795435340.064072507"


def test_the_command_writes_each_topic_in_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints("/left/joint_states").topic("/text", STRING_NAME, "string data\n")
        bag.write("/left/joint_states", joint_state([1.0]), START)
        bag.write("/text", text('say "a, b"'), START)
    assert main([str(tmp_path / "a.mcap"), "-o", str(tmp_path / "out")]) == 0
    assert rows(tmp_path / "out" / "text.csv")[0]["data"] == 'say "a, b"'
    assert capsys.readouterr().out.splitlines() == [
        f"{tmp_path}/out/left.joint_states.csv: 1 messages",
        f"{tmp_path}/out/text.csv: 1 messages",
    ]


def test_only_the_topic_asked_for_is_written(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints().topic("/text", STRING_NAME, "string data\n")
        bag.write("/joint_states", joint_state([1.0]), START)
        bag.write("/text", text("a"), START)
    assert main([str(tmp_path / "a.mcap"), "-o", str(tmp_path / "o"), "--topic", "/text"]) == 0
    assert [path.name for path in (tmp_path / "o").iterdir()] == ["text.csv"]


def test_a_topic_without_header_is_left_out_of_tables_by_header(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.topic("/a", STRING_NAME, "string data\n").joints()
        bag.write("/a", text("a"), START)
        bag.write("/joint_states", joint_state([1.0]), START)
    arguments = [str(tmp_path / "a.mcap"), "-o", str(tmp_path / "o"), "--time", "header"]
    assert main(arguments) == 0
    assert [path.name for path in (tmp_path / "o").iterdir()] == ["joint_states.csv"]
    complaint = "/a (std_msgs/msg/String) has no header: use the time base log or publish\n"
    assert capsys.readouterr().err == f"left out: {complaint}"
    assert main([*arguments, "--topic", "/a"]) == 2
    assert capsys.readouterr().err == f"export_bag: {complaint}"


def test_a_topic_with_an_idl_definition_is_left_out_of_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_idl_beside_joints(tmp_path / "a.mcap")
    arguments = [str(path), "-o", str(tmp_path / "o")]
    assert main(arguments) == 0
    assert [path.name for path in (tmp_path / "o").iterdir()] == ["joint_states.csv"]
    complaint = "/text is 'cdr' with a definition in 'ros2idl'; only cdr with ros2msg can be read\n"
    assert capsys.readouterr().err == f"left out: {complaint}"
    assert main([*arguments, "--topic", "/text"]) == 2
    assert capsys.readouterr().err == f"export_bag: {complaint}"


def test_a_topic_may_have_a_name_that_no_file_can_have(tmp_path: Path) -> None:
    with Builder(tmp_path / "a.mcap") as bag:
        bag.joints("/a\0b")
        bag.write("/a\0b", joint_state([1.0]), START)
    assert main([str(tmp_path / "a.mcap"), "-o", str(tmp_path / "o")]) == 0
    assert [path.name for path in (tmp_path / "o").iterdir()] == ["a b.csv"]


def test_an_error_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_joints(tmp_path / "a.mcap", 1)
    assert main([str(path), "--topic", "/no"]) == 2
    assert capsys.readouterr().err == (
        "export_bag: a.mcap has no topic /no; it has: /joint_states\n"
    )


def test_without_pandas_the_error_says_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    columns = open_bag(write_joints(tmp_path / "a.mcap", 1)).columns("/joint_states")
    with pytest.raises(MissingLibrary) as caught:
        write_table(columns, tmp_path / "a.parquet", "parquet")
    assert str(caught.value) == (
        "pandas is not installed: pip install pandas, or use the columns as they are"
    )


@pytest.mark.skipif(importlib.util.find_spec("pandas") is None, reason="pandas is not installed")
def test_a_data_frame_has_the_columns(tmp_path: Path) -> None:
    columns = open_bag(write_joints(tmp_path / "a.mcap", 3)).columns("/joint_states")
    assert data_frame(columns)["velocity[j0]"].tolist() == [0.0, 10.0, 20.0]
