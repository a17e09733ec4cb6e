"""A bus on which frames are late, lost and damaged, exactly as asked for."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from musashi_muscle_bridge.emulation.faulty_line import FaultyLine, LineFaults

FRAME = bytes(range(40))
delays = st.floats(0.0, 1.0)


def through(faults: LineFaults, count: int, seed: int = 0) -> list[bytes]:
    """Send some frames, one each second; return what arrives in the end."""
    line: FaultyLine[str] = FaultyLine(seed)
    line.faults = faults
    arrived = []
    for second in range(count):
        line.put(FRAME, "bridge", float(second))
        arrived += [frame for frame, _ in line.take(float(second) + 0.99)]
    return arrived + [frame for frame, _ in line.take(float("inf"))]


def flipped_bits(frame: bytes) -> int:
    return sum((a ^ b).bit_count() for a, b in zip(frame, FRAME, strict=True))


def test_without_faults_a_frame_arrives_at_once_where_it_was_sent_to() -> None:
    line: FaultyLine[str] = FaultyLine(0)
    line.put(FRAME, "bridge", 5.0)
    assert line.take(5.0) == [(FRAME, "bridge")]


def test_a_frame_arrives_once() -> None:
    line: FaultyLine[str] = FaultyLine(0)
    line.put(FRAME, "bridge", 5.0)
    line.take(5.0)
    assert line.take(6.0) == []


def test_with_latency_a_frame_arrives_when_it_is_over_not_before() -> None:
    line: FaultyLine[str] = FaultyLine(0)
    line.faults = LineFaults(latency=0.25)
    line.put(FRAME, "bridge", 5.0)
    assert line.take(5.24) == []
    assert line.due() == 5.25
    assert line.take(5.25) == [(FRAME, "bridge")]


@given(latency=delays, jitter=delays, seed=st.integers(0, 1000))
def test_a_delay_lies_between_latency_and_latency_with_jitter(
    latency: float, jitter: float, seed: int
) -> None:
    line: FaultyLine[str] = FaultyLine(seed)
    line.faults = LineFaults(latency=latency, jitter=jitter)
    line.put(FRAME, "bridge", 0.0)
    assert latency <= line.due() <= latency + jitter


@given(jitter=delays, times=st.lists(st.floats(0.0, 1.0), max_size=20), seed=st.integers(0, 1000))
def test_frames_do_not_overtake(jitter: float, times: list[float], seed: int) -> None:
    line: FaultyLine[int] = FaultyLine(seed)
    line.faults = LineFaults(jitter=jitter)
    for number, now in enumerate(sorted(times)):
        line.put(FRAME, number, now)
    arrived = [to for _, to in line.take(float("inf"))]
    assert arrived == list(range(len(times)))


def test_without_frames_nothing_is_due() -> None:
    assert FaultyLine[str](0).due() == float("inf")


def test_a_loss_of_one_loses_every_frame_and_counts_them() -> None:
    line: FaultyLine[str] = FaultyLine(0)
    line.faults = LineFaults(loss=1.0)
    for _ in range(5):
        line.put(FRAME, "bridge", 0.0)
    assert line.take(1.0) == []
    assert line.lost == 5


def test_a_loss_of_a_quarter_loses_about_a_quarter() -> None:
    assert len(through(LineFaults(loss=0.25), 2000)) == pytest.approx(1500, abs=100)


def test_a_damaged_frame_has_one_flipped_bit() -> None:
    frames = through(LineFaults(corruption=1.0), 200)
    assert {flipped_bits(frame) for frame in frames} == {1}


def test_a_corruption_of_a_quarter_damages_about_a_quarter() -> None:
    frames = through(LineFaults(corruption=0.25), 2000)
    assert sum(map(flipped_bits, frames)) == pytest.approx(500, abs=100)


def test_the_same_seed_gives_the_same_faults() -> None:
    faults = LineFaults(0.1, 0.1, 0.3, 0.3)
    assert through(faults, 100, seed=3) == through(faults, 100, seed=3)


def test_another_seed_gives_other_faults() -> None:
    faults = LineFaults(0.1, 0.1, 0.3, 0.3)
    assert through(faults, 100, seed=3) != through(faults, 100, seed=4)


def test_faults_that_are_switched_off_end() -> None:
    line: FaultyLine[str] = FaultyLine(0)
    line.faults = LineFaults(loss=1.0, corruption=1.0)
    line.put(FRAME, "bridge", 0.0)
    line.faults = LineFaults()
    line.put(FRAME, "bridge", 0.0)
    assert line.take(0.0) == [(FRAME, "bridge")]


def test_frames_underway_do_not_pile_up() -> None:
    line: FaultyLine[str] = FaultyLine(0)
    line.faults = LineFaults(latency=1.0)
    for _ in range(10_000):
        line.put(FRAME, "bridge", 0.0)
    assert len(line.take(1.0)) == 4096
    assert line.lost == 10_000 - 4096
