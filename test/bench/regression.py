"""Whether ratios are worse than those of the last accepted run."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from rounds import Row

MARGIN = 0.25
"""A ratio may be so much worse, as a share."""
ATTEMPTS = 3
"""A ratio that is worse in each of so many runs has got worse."""

Ratios = Mapping[str, Mapping[str, float]]
"""Ratio to the baseline by benchmark and row."""


def ratios_of(results: Mapping[str, Iterable[Row]]) -> dict[str, dict[str, float]]:
    """Return the ratios that results tell; rows without one are left out."""
    return {
        benchmark: {one.name: one.guarded for one in rows if one.guarded is not None}
        for benchmark, rows in results.items()
    }


def worse(accepted: Ratios, measured: Ratios) -> dict[str, dict[str, str]]:
    """Return what is worse than accepted and by how much in words, by benchmark and row.

    An accepted row that was not measured counts: a guard must not vanish unseen. Benchmarks that
    were not run, and rows that were never accepted, do not.
    """
    found: dict[str, dict[str, str]] = {}
    for benchmark, rows in measured.items():
        for name, limit in accepted.get(benchmark, {}).items():
            if name not in rows:
                found.setdefault(benchmark, {})[name] = "is not measured any more"
            elif not rows[name] <= (1.0 + MARGIN) * limit:
                text = f"ratio {rows[name]:.3g}, accepted {limit:.3g}"
                found.setdefault(benchmark, {})[name] = text
    return found


def still_worse(
    accepted: Ratios, benchmarks: Sequence[str], measure: Callable[[Sequence[str]], Ratios]
) -> dict[str, dict[str, str]]:
    """Return what is worse in each of ATTEMPTS runs; only what looks worse is run again.

    measure  runs the named benchmarks
    """
    suspects = worse(accepted, measure(benchmarks))
    for _ in range(ATTEMPTS - 1):
        if not suspects:
            break
        again = worse(accepted, measure(list(suspects)))
        suspects = {
            benchmark: both
            for benchmark, rows in suspects.items()
            if (both := {k: again[benchmark][k] for k in rows if k in again.get(benchmark, {})})
        }
    return suspects


def load_accepted(path: Path) -> dict[str, dict[str, float]]:
    """Read the accepted ratios; nothing is accepted where there is no file."""
    accepted: dict[str, dict[str, float]] = json.loads(path.read_text()) if path.exists() else {}
    return accepted


def accept(path: Path, measured: Ratios) -> None:
    """Accept the ratios of the benchmarks that ran; the others stay."""
    accepted = {**load_accepted(path), **measured}
    path.write_text(json.dumps(accepted, indent=2, sort_keys=True) + "\n")
