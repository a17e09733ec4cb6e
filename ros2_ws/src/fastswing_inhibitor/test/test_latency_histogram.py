"""The histogram of how long decisions took."""

from fastswing_inhibitor.latency_histogram import LatencyHistogram


def counted(*durations: float) -> LatencyHistogram:
    histogram = LatencyHistogram((0.001, 0.01))
    for duration in durations:
        histogram.add(duration)
    return histogram


def test_there_is_one_bucket_more_than_bounds() -> None:
    assert counted().counts == [0, 0, 0]


def test_a_duration_at_a_bound_is_within_it() -> None:
    assert counted(0.001, 0.01).counts == [1, 1, 0]


def test_a_duration_beyond_all_bounds_is_counted_last() -> None:
    assert counted(0.5).counts == [0, 0, 1]


def test_the_longest_is_kept() -> None:
    assert counted(0.002, 0.5, 0.003).longest == 0.5


def test_a_negative_duration_of_a_clock_that_jumped_is_not_counted() -> None:
    assert counted(-1.0).counts == [0, 0, 0]


def test_the_report_names_the_buckets_that_hold_anything() -> None:
    assert counted(0.0005, 0.5).report() == {
        "latency_up_to_1_ms": 1,
        "latency_above_10_ms": 1,
        "latency_max_ms": "500.000",
    }
