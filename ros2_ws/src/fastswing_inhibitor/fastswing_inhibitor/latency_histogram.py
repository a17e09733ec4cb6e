"""How long decisions took, in fixed buckets: counting one costs less than a microsecond."""

from bisect import bisect_left
from collections.abc import Iterable

_BOUNDS = (0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05)


class LatencyHistogram:
    """Counts durations [s].

    bounds   [s] rising; shape (k,)
    counts   of durations in (bounds[i-1], bounds[i]]; one more for what is beyond; shape (k + 1,)
    longest  [s] 0 before the first
    """

    def __init__(self, bounds: Iterable[float] = _BOUNDS) -> None:
        """Start with nothing counted."""
        self.bounds = tuple(bounds)
        self.counts = [0] * (len(self.bounds) + 1)
        self.longest = 0.0

    def add(self, duration: float) -> None:
        """Count a duration [s]; a negative one, measured on a clock that jumped, says nothing."""
        if duration < 0.0:
            return
        self.counts[bisect_left(self.bounds, duration)] += 1
        if duration > self.longest:
            self.longest = duration

    def report(self) -> dict[str, object]:
        """Return the buckets that hold anything, for diagnostics."""
        texts = [f"up_to_{1e3 * bound:g}_ms" for bound in self.bounds]
        texts.append(f"above_{1e3 * self.bounds[-1]:g}_ms")
        counted = {
            f"latency_{text}": count
            for text, count in zip(texts, self.counts, strict=True)
            if count
        }
        return {**counted, "latency_max_ms": f"{1e3 * self.longest:.3f}"}
