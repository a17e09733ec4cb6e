"""What a benchmark tells, and rounds of several programs in turns."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.float64]
"""[s], one for each repetition of a round."""
Program = Callable[[], Sequence[float] | Samples]
"""Runs one round."""
_UNITS = {"us": 1e6, "ms": 1e3, "s": 1.0}


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

    @property
    def guarded(self) -> float | None:
        """The ratio that must not get worse: of p99, where only p99 was asked for."""
        return self.ratio_p99 if self.bound.startswith("p99") else self.ratio


def in_turns(programs: Mapping[str, Program], rounds: int) -> dict[str, list[Samples]]:
    """Run the programs one after the other, again and again: A B A B.

    Returns the samples of each program's rounds. What disturbs the machine for longer than a
    round disturbs all of them.
    """
    found: dict[str, list[Samples]] = {name: [] for name in programs}
    for _ in range(rounds):
        for name, program in programs.items():
            found[name].append(np.asarray(program(), dtype=float))
    return found


def repeated(call: Callable[[], Any], count: int) -> Program:
    """Return a program that times `count` calls, one by one."""

    def program() -> list[float]:
        samples = []
        for _ in range(count):
            begin = time.perf_counter()
            call()
            samples.append(time.perf_counter() - begin)
        return samples

    return program


def ratios(rounds: Sequence[Samples], baseline: Sequence[Samples], percent: float) -> Samples:
    """Return a percentile of each round, divided by the baseline's of the same round."""
    return np.array(
        [
            np.percentile(one, percent) / np.percentile(other, percent)
            for one, other in zip(rounds, baseline, strict=True)
        ]
    )


def row(
    name: str,
    rounds: Sequence[Samples],
    unit: str = "ms",
    against: tuple[str, Sequence[Samples]] | None = None,
    at_most: float | None = None,
    ratio_at_most: float | None = None,
    note: str = "",
) -> Row:
    """Return the figures of a program's rounds.

    against        name and rounds of the baseline
    at_most        what was asked of the median, in `unit`
    ratio_at_most  what was asked of the ratio
    """
    samples = np.concatenate(rounds) * _UNITS[unit]
    asked, met = [], []
    if at_most is not None:
        asked.append(f"median <= {at_most:g} {unit}")
        met.append(float(np.median(samples)) <= at_most)
    each = None if against is None else ratios(rounds, against[1], 50.0)
    worst = None if against is None else ratios(rounds, against[1], 99.0)
    if ratio_at_most is not None and each is not None:
        asked.append(f"ratio <= {ratio_at_most:g}")
        met.append(float(np.median(each)) <= ratio_at_most)
    return Row(
        name=name,
        median=float(np.median(samples)),
        p99=float(np.percentile(samples, 99.0)),
        maximum=float(samples.max()),
        unit=unit,
        baseline="" if against is None else against[0],
        ratio=None if each is None else float(np.median(each)),
        ratio_p99=None if worst is None else float(np.median(worst)),
        bound=", ".join(asked),
        met=all(met) if met else None,
        note=note,
        rounds=() if each is None else tuple(float(one) for one in each),
    )
