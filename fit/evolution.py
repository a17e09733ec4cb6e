"""Runs CMA-ES, an evolution strategy, on a fit; the library `cma` does the strategy itself.

A run that was interrupted goes on from its file, with the random numbers that it would have had.
"""

import pickle
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cma
import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Fitted:
    """The best of all candidates after some generations.

    best  shape (n,), from -1 to 1
    """

    generation: int
    best: Vector
    best_cost: float


def evolve(
    cost: Callable[[Vector], float],
    first: Vector,
    sigma: float,
    state_file: Path,
    seed: int,
    generations: int,
) -> Fitted:
    """Minimise `cost` for x of shape (n,), each from -1 to 1; go on from a saved state.

    first  where the search begins, shape (n,)
    sigma  first standard deviation

    Saves and shows each of at most `generations` generations; ends earlier when nothing changes.
    """
    if state_file.exists():
        strategy: cma.CMAEvolutionStrategy = pickle.loads(state_file.read_bytes())
    else:
        strategy = _begun(cost, first, sigma, seed)
    began, begun_at = time.monotonic(), strategy.countiter
    while strategy.countiter < generations and not strategy.stop():
        candidates = strategy.ask()
        strategy.tell(candidates, [cost(candidate) for candidate in candidates])
        _save(strategy, state_file)
        per_generation = (time.monotonic() - began) / (strategy.countiter - begun_at)
        left = per_generation * (generations - strategy.countiter)
        print(
            f"\rgeneration {strategy.countiter}/{generations}  cost {strategy.best.f:.4f}  "
            f"sigma {strategy.sigma:.4f}  {left:.0f} s left   ",
            end="",
            flush=True,
        )
    print()
    return Fitted(strategy.countiter, np.array(strategy.best.x), float(strategy.best.f))


def _begun(
    cost: Callable[[Vector], float], first: Vector, sigma: float, seed: int
) -> cma.CMAEvolutionStrategy:
    # Random numbers of its own, saved with the rest: `seed` would set those of the whole process.
    options = {
        "bounds": [-1.0, 1.0],
        "randn": np.random.RandomState(seed).randn,
        "seed": np.nan,
        "verbose": -9,
    }
    strategy = cma.CMAEvolutionStrategy(first, sigma, options)
    strategy.best.update([first], arf=[cost(first)])
    return strategy


def _save(strategy: cma.CMAEvolutionStrategy, state_file: Path) -> None:
    """Write the state, replacing the file in one step."""
    part = state_file.with_suffix(".part")
    part.write_bytes(strategy.pickle_dumps())
    part.replace(state_file)
