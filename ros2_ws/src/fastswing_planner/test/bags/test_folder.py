"""A bag of several files is one bag to every reader, also when its recorder was killed."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import yaml
from bag_builder import JOINT_STATE, JOINT_STATE_NAME, SECOND, START, joint_state
from rosbags.rosbag2 import Reader

from fastswing_planner.bags import open_bag
from fastswing_planner.bags.folder import BagFolder
from fastswing_planner.bags.metadata import BagTopic
from fastswing_planner.bags.writer import BagExists
from fastswing_planner.errors import BagError

JOINTS = BagTopic("/joint_states", JOINT_STATE_NAME, JOINT_STATE)


def write_folder(path: Path, count: int = 100, **options: Any) -> BagFolder:
    """Write `count` joint states 10 ms apart; the bag stays open."""
    bag = BagFolder(path, **options)
    bag.add_topic(JOINTS)
    for index in range(count):
        log_time = START + index * SECOND // 100
        bag.write("/joint_states", joint_state([index, 0.0]), log_time, log_time, index + 1)
    return bag


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def positions(path: Path) -> list[float]:
    return [float(row[0]) for row in open_bag(path).columns("/joint_states")["position"]]


@contextmanager
def file_size_limit(size: int) -> Iterator[None]:
    """Let every file be a full disk beyond `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_without_splits_a_folder_has_one_file(tmp_path: Path) -> None:
    write_folder(tmp_path / "run").close()
    assert names(tmp_path / "run") == ["metadata.yaml", "run_0.mcap"]


def test_a_file_lasts_as_long_as_asked(tmp_path: Path) -> None:
    write_folder(tmp_path / "run", split_duration_ns=SECOND // 4).close()
    counts = [len(positions(tmp_path / "run" / f"run_{index}.mcap")) for index in range(4)]
    assert counts == [25, 25, 25, 25]


def test_a_file_is_hardly_larger_than_asked(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    options: dict[str, Any] = {"compression": "none", "chunk_size": 1000, "split_size": 5000}
    write_folder(folder, **options).close()
    sizes = [path.stat().st_size for path in folder.glob("*.mcap")]
    assert len(sizes) > 3
    # A chunk, and what finishing a file adds: indices, schemas, statistics and metadata.
    assert max(sizes) < 5000 + 1300 + 5000


def test_every_file_explains_itself(tmp_path: Path) -> None:
    write_folder(tmp_path / "run", split_duration_ns=SECOND // 4).close()
    last = open_bag(tmp_path / "run" / "run_3.mcap")
    assert last.warnings == []
    assert last.topics["/joint_states"].definition == JOINT_STATE


def test_all_messages_come_back_in_order(tmp_path: Path) -> None:
    write_folder(tmp_path / "run", split_duration_ns=SECOND // 20).close()
    assert positions(tmp_path / "run") == [float(index) for index in range(100)]
    assert open_bag(tmp_path / "run").warnings == []


def test_rosbags_reads_the_folder(tmp_path: Path) -> None:
    write_folder(tmp_path / "run", split_duration_ns=SECOND // 4).close()
    with Reader(tmp_path / "run") as reader:
        assert reader.message_count == 100
        assert reader.start_time == START
        assert reader.duration == 99 * SECOND // 100 + 1  # rosbags counts the last nanosecond
        times = [time for _, time, _ in reader.messages()]
    assert times == [START + index * SECOND // 100 for index in range(100)]


def test_metadata_names_each_file_with_its_extent(tmp_path: Path) -> None:
    write_folder(tmp_path / "run", split_duration_ns=SECOND // 2).close()
    content = yaml.safe_load((tmp_path / "run" / "metadata.yaml").read_text())
    information = content["rosbag2_bagfile_information"]
    assert information["relative_file_paths"] == ["run_0.mcap", "run_1.mcap"]
    assert information["message_count"] == 100
    assert information["files"][1] == {
        "path": "run_1.mcap",
        "duration": {"nanoseconds": 49 * SECOND // 100},
        "starting_time": {"nanoseconds_since_epoch": START + SECOND // 2},
        "message_count": 50,
    }


def test_losses_are_those_of_each_file_and_of_all(tmp_path: Path) -> None:
    lost = iter(["1", "5"])
    options: dict[str, Any] = {"notes": lambda: {"lost": f'{{"/joint_states": {next(lost)}}}'}}
    write_folder(tmp_path / "run", split_duration_ns=SECOND // 2, **options).close()
    assert open_bag(tmp_path / "run" / "run_0.mcap").lost == {"/joint_states": 1}
    assert open_bag(tmp_path / "run").lost == {"/joint_states": 6}


def test_a_folder_that_was_not_finished_is_read(tmp_path: Path) -> None:
    bag = write_folder(tmp_path / "run", split_duration_ns=SECOND // 4)
    bag.flush()  # and then nothing more, as after SIGKILL
    opened = open_bag(tmp_path / "run")
    assert opened.message_count == 100
    assert opened.warnings == ["run_3.mcap: was not finished, what was written is read"]
    bag.close()


def test_size_and_count_are_those_of_all_files(tmp_path: Path) -> None:
    bag = write_folder(tmp_path / "run", split_duration_ns=SECOND // 4)
    bag.close()
    files = (tmp_path / "run").glob("*.mcap")
    assert bag.size == sum(path.stat().st_size for path in files)
    assert bag.message_count == 100


def test_an_existing_folder_is_never_written_into(tmp_path: Path) -> None:
    with pytest.raises(BagExists) as caught:
        BagFolder(tmp_path)
    assert str(caught.value) == f"{tmp_path} exists and is never overwritten; choose another output"


def test_a_folder_that_cannot_be_created_is_named(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    with pytest.raises(BagError) as caught:
        BagFolder(tmp_path / "a" / "run")
    assert str(caught.value) == f"cannot create {tmp_path}/a/run: Not a directory"


def test_a_full_disk_leaves_all_that_was_written_before(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    options: dict[str, Any] = {"compression": "none", "chunk_size": 1000}
    options["split_duration_ns"] = SECOND // 4
    bag = write_folder(folder, 60, **options)
    with file_size_limit(1), pytest.raises(BagError) as caught:
        bag.flush()
    assert f"cannot write {folder}/run_2.mcap: File too large" in str(caught.value)
    assert positions(folder)[:50] == [float(index) for index in range(50)]
    bag.close()
