"""Learned lengths have the derivative that they claim, doubt what they do not know, and refuse."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import Matrix
from fastswing_planner.errors import OutOfRange, RobotDescriptionError
from fastswing_planner.learning.fitting import TooFewSamples, fit_correction, spread_centers
from fastswing_planner.robot.length_correction import (
    LengthCorrection,
    load_correction,
    save_correction,
)

JOINTS, MUSCLES = ("j0", "j1"), ("m0", "m1", "m2")
NOISE = 1e-4


def truth(position: Matrix) -> Matrix:
    """Return smooth differences of length [m], shape (k, 3)."""
    a, b = position.T
    return np.stack([0.005 * np.sin(a + b), 0.004 * a * b + 0.003, 0.002 * np.cos(2 * b)], axis=1)


def walk(count: int = 3000, seed: int = 0) -> Matrix:
    """Return a smooth motion over [-0.5, 0.5] rad of both joints, shape (count, 2)."""
    time = np.arange(count) * 0.01
    phase = np.random.default_rng(seed).uniform(0.0, 6.0, 2)
    return 0.5 * np.sin(np.outer(time, [0.7, 1.9]) + phase)


@pytest.fixture(scope="module")
def correction() -> LengthCorrection:
    position = walk()
    noise = np.random.default_rng(1).normal(0.0, NOISE, (len(position), 3))
    return fit_correction(JOINTS, MUSCLES, position, truth(position) + noise, centers=100)


def error(correction: LengthCorrection, position: Matrix) -> float:
    found = np.array([correction.lengths(row) for row in position])
    return float(np.abs(found - truth(position)).max())


def test_lengths_are_learned_to_less_than_their_noise(correction: LengthCorrection) -> None:
    assert error(correction, walk(200, seed=5)) < NOISE


def test_the_held_out_error_is_the_noise(correction: LengthCorrection) -> None:
    assert correction.held_out_rms == pytest.approx([NOISE] * 3, rel=0.15)


@given(st.tuples(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4)))
def test_the_jacobian_is_the_slope_of_the_lengths(
    correction: LengthCorrection, posture: tuple[float, float]
) -> None:
    at, step = np.array(posture), 1e-5
    slope = np.stack(
        [
            (correction.lengths(at + move) - correction.lengths(at - move)) / (2 * step)
            for move in step * np.eye(2)
        ],
        axis=1,
    )
    np.testing.assert_allclose(correction.jacobian(at), slope, atol=1e-7)


def test_the_jacobian_is_learned(correction: LengthCorrection) -> None:
    for a, b in walk(50, seed=7):
        expected = [
            [0.005 * np.cos(a + b), 0.005 * np.cos(a + b)],
            [0.004 * b, 0.004 * a],
            [0.0, -0.004 * np.sin(2 * b)],
        ]
        np.testing.assert_allclose(correction.jacobian(np.array([a, b])), expected, atol=3e-4)


@given(st.floats(0.0, 2.0 * np.pi), st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_doubt_grows_with_the_distance_to_the_data(
    correction: LengthCorrection, angle: float, one: float, other: float
) -> None:
    way = np.array([np.cos(angle), np.sin(angle)])
    near, far = sorted((one, other))
    if (correction.distance(near * way) <= correction.distance(far * way)).all():
        assert (correction.uncertainty(near * way) <= correction.uncertainty(far * way)).all()
    assert (correction.uncertainty(near * way) >= correction.held_out_rms).all()


def test_every_sample_is_near_to_one_that_is_kept(correction: LengthCorrection) -> None:
    assert max(correction.distance(row).max() for row in walk()[::20]) <= 0.1


def test_no_answer_is_farther_than_the_reach_from_every_sample() -> None:
    time = np.linspace(0.0, 120.0, 4000)
    rates = np.array([0.11, 0.13, 0.17, 0.19, 0.23])
    position = 0.7 * np.sin(2.0 * np.pi * np.outer(time, rates) + np.arange(5.0))
    found = fit_correction(tuple("abcde"), ("m",), position, position[:, :1] * 1e-3)
    random = np.random.default_rng(0)
    for posture in random.uniform(-1.2, 1.2, (2000, 5)):
        nearest = np.linalg.norm(position - posture, axis=1).min()
        assert nearest <= found.reach or found.distance(posture)[0] > found.reach


def half_slack() -> LengthCorrection:
    """Return what is learned if m1 hangs while j0 is positive."""
    position = walk()
    usable = np.ones((len(position), 3), dtype=bool)
    usable[:, 1] = position[:, 0] < 0.0
    return fit_correction(JOINTS, MUSCLES, position, truth(position), usable, centers=100)


def test_the_distance_is_to_postures_with_the_muscle_taut() -> None:
    distance = half_slack().distance(np.array([0.2, 0.0]))
    assert distance[1] > 0.2
    assert max(distance[0], distance[2]) <= 0.1


def test_doubt_is_that_of_each_muscle() -> None:
    found = half_slack()
    at = np.array([0.2, 0.0])
    assert found.uncertainty(at)[1] > 0.2 * found.slope[1]


def test_where_one_muscle_was_always_slack_it_refuses() -> None:
    with pytest.raises(OutOfRange, match="from every posture recorded with a taut m1"):
        half_slack().lengths(np.array([0.45, 0.0]))


def test_far_from_all_data_it_refuses(correction: LengthCorrection) -> None:
    far = np.array([0.0, 1.5])
    with pytest.raises(OutOfRange) as caught:
        correction.jacobian(far)
    assert str(caught.value) == (
        "the learned muscle lengths do not reach j0 0.000, j1 1.500 rad: "
        f"{correction.distance(far)[0]:.2f} rad from every posture recorded with a taut m0, "
        "at most 0.3 rad; record there too"
    )
    with pytest.raises(OutOfRange):
        correction.lengths(far)


def test_a_posture_that_is_no_number_is_refused(correction: LengthCorrection) -> None:
    with pytest.raises(OutOfRange):
        correction.lengths(np.array([np.nan, 0.0]))


def test_slack_samples_are_not_learned_from() -> None:
    position = walk()
    difference = truth(position)
    usable = np.ones(difference.shape, dtype=bool)
    usable[::7, 1] = False
    difference[::7, 1] = 10.0
    found = fit_correction(JOINTS, MUSCLES, position, difference, usable, centers=100)
    assert error(found, walk(100, seed=3)) < 1e-4


def test_too_few_samples_name_the_muscle() -> None:
    position = walk(100)
    usable = np.ones((100, 3), dtype=bool)
    usable[7:, 2] = False
    with pytest.raises(TooFewSamples) as caught:
        fit_correction(JOINTS, MUSCLES, position, truth(position), usable)
    assert str(caught.value) == (
        "muscle m2 has 7 usable samples, at least 20 are needed: record more motion, with taut "
        "muscles"
    )


@pytest.mark.parametrize(
    ("taut_in_held_out", "counts"),
    [
        (False, "2400 usable samples to learn from and 0 to check with"),
        (True, "0 usable samples to learn from and 600 to check with"),
    ],
)
def test_a_muscle_taut_in_one_part_alone_is_named(taut_in_held_out: bool, counts: str) -> None:
    position = walk()
    usable = np.ones((len(position), 3), dtype=bool)
    usable[:, 2] = (np.arange(len(position)) // 60 % 5 == 2) == taut_in_held_out
    with pytest.raises(TooFewSamples) as caught:
        fit_correction(JOINTS, MUSCLES, position, truth(position), usable)
    assert str(caught.value) == (
        f"muscle m2 was taut in too short a part of the recording: {counts}, at least 15 and 4 "
        "are needed"
    )


def test_centers_are_spread_over_all_samples() -> None:
    position = walk()
    centers = spread_centers(position, 40)
    away = np.linalg.norm(position[:, None] - centers, axis=2).min(axis=1)
    apart = np.linalg.norm(centers[:, None] - centers, axis=2)[np.triu_indices(40, 1)]
    assert apart.min() >= away.max()


def test_a_file_gives_the_same_correction(correction: LengthCorrection, tmp_path: Path) -> None:
    save_correction(correction, tmp_path / "a.npz", "abc")
    again = load_correction(tmp_path / "a.npz", JOINTS, MUSCLES, "abc")
    at = np.array([0.1, -0.2])
    np.testing.assert_array_equal(again.lengths(at), correction.lengths(at))
    np.testing.assert_array_equal(again.uncertainty(at + 0.9), correction.uncertainty(at + 0.9))
    assert again.reach == correction.reach


def refusal(path: Path, muscles: tuple[str, ...] = MUSCLES, mjcf_hash: str = "abc") -> str:
    with pytest.raises(RobotDescriptionError) as caught:
        load_correction(path, JOINTS, muscles, mjcf_hash)
    return str(caught.value)


def test_a_file_of_another_arm_is_refused(correction: LengthCorrection, tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    save_correction(correction, path, "abc")
    assert refusal(path, ("m0", "m1")) == (
        f"{path} is learned for the muscles m0, m1, m2, the robot has m0, m1"
    )
    assert refusal(path, mjcf_hash="def") == (
        f"{path} is learned on another MJCF than the robot's: learn it again"
    )


def test_a_file_that_holds_no_correction_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    assert refusal(path).startswith(f"{path} holds no learned muscle lengths (FileNotFoundError)")
    path.write_bytes(b"PK\x03\x04hello")
    assert refusal(path).startswith(f"{path} holds no learned muscle lengths (")
