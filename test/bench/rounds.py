"""What a benchmark tells, and rounds of several programs in turns."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Row:
    """One figure of a benchmark.

    median, p99, maximum  in `unit`
    baseline              what it is compared with, by name
    ratio, ratio_p99      to the baseline of the same round, medians over the rounds
    bound                 what was asked for, as text
    met                   whether it was met; None: nothing was asked for
    rounds                the ratio of each round
    """

    name: str
    median: float
    p99: float | None = None
    maximum: float | None = None
    unit: str = "us"
    baseline: str = ""
    ratio: float | None = None
    ratio_p99: float | None = None
    bound: str = ""
    met: bool | None = None
    note: str = ""
    rounds: tuple[float, ...] = field(default=())
