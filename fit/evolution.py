"""A small CMA-ES: minimises a function of many variables by evolving a normal distribution.

After N. Hansen, "The CMA Evolution Strategy: A Tutorial" (2016). A generation's random numbers
depend on the seed and its number only, so a resumed run equals an uninterrupted one.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Evolution:
    """The distribution after some generations; n variables.

    mean, best                  shape (n,)
    covariance                  shape (n, n), of the distribution divided by sigma^2
    path_sigma, path_covariance the evolution paths, each shape (n,)
    """

    generation: int
    mean: Vector
    sigma: float
    covariance: Matrix
    path_sigma: Vector
    path_covariance: Vector
    best: Vector
    best_cost: float

    def save(self, path: Path) -> None:
        """Write the state to an `.npz` file, replacing it in one step."""
        part = path.with_suffix(".part.npz")
        np.savez(part, **vars(self))
        part.replace(path)

    @staticmethod
    def load(path: Path) -> "Evolution":
        """Read what `save` wrote."""
        with np.load(path) as arrays:
            content = {name: arrays[name] for name in arrays.files}
        for name, convert in (("generation", int), ("sigma", float), ("best_cost", float)):
            content[name] = convert(content[name])
        return Evolution(**content)


@dataclass(frozen=True)
class Rates:
    """The tutorial's default weights and learning rates for n variables."""

    weights: Vector
    mu_eff: float
    c_sigma: float
    d_sigma: float
    c_path: float
    c_one: float
    c_mu: float
    chi: float


def first_generation(count: int, sigma: float) -> Evolution:
    """Return the state before the first generation, centred on zero; `count` variables."""
    zero = np.zeros(count)
    return Evolution(0, zero, sigma, np.eye(count), zero, zero, zero, np.inf)


def population_size(count: int) -> int:
    """Return how many candidates a generation has."""
    return 4 + int(3 * np.log(count))


def rates(count: int) -> Rates:
    """Return the strategy's constants for `count` variables."""
    parents = population_size(count) // 2
    raw = np.log(parents + 0.5) - np.log(np.arange(1, parents + 1))
    weights = raw / raw.sum()
    mu_eff = 1.0 / float((weights**2).sum())
    c_sigma = (mu_eff + 2) / (count + mu_eff + 5)
    c_one = 2 / ((count + 1.3) ** 2 + mu_eff)
    return Rates(
        weights=weights,
        mu_eff=mu_eff,
        c_sigma=c_sigma,
        d_sigma=1 + 2 * max(0.0, np.sqrt((mu_eff - 1) / (count + 1)) - 1) + c_sigma,
        c_path=(4 + mu_eff / count) / (count + 4 + 2 * mu_eff / count),
        c_one=c_one,
        c_mu=min(1 - c_one, 2 * (mu_eff - 2 + 1 / mu_eff) / ((count + 2) ** 2 + mu_eff)),
        chi=np.sqrt(count) * (1 - 1 / (4 * count) + 1 / (21 * count**2)),
    )


def next_generation(state: Evolution, cost: Callable[[Vector], float], seed: int) -> Evolution:
    """Draw, judge and learn from one generation."""
    constants = rates(state.mean.size)
    variance, axes = np.linalg.eigh(state.covariance)
    scale = np.sqrt(np.maximum(variance, 1e-20))
    random = np.random.default_rng([seed, state.generation])
    draws = random.standard_normal((population_size(state.mean.size), state.mean.size))
    steps = (draws * scale) @ axes.T
    candidates = state.mean + state.sigma * steps
    costs = np.array([cost(candidate) for candidate in candidates])
    order = np.argsort(costs, kind="stable")
    chosen = steps[order[: constants.weights.size]]
    moved = _learn(state, constants, chosen, axes @ np.diag(1.0 / scale) @ axes.T)
    if costs[order[0]] < state.best_cost:
        best = candidates[order[0]]
        return replace(moved, best=best, best_cost=float(costs[order[0]]))
    return moved


def evolve(
    cost: Callable[[Vector], float],
    first: Evolution,
    state_file: Path,
    seed: int,
    generations: int,
) -> Evolution:
    """Run up to `generations` generations, saving and showing each; go on from a saved state."""
    state = Evolution.load(state_file) if state_file.exists() else first
    began, begun_at = time.monotonic(), state.generation
    while state.generation < generations:
        state = next_generation(state, cost, seed)
        state.save(state_file)
        per_generation = (time.monotonic() - began) / (state.generation - begun_at)
        left = per_generation * (generations - state.generation)
        print(
            f"\rgeneration {state.generation}/{generations}  cost {state.best_cost:.4f}  "
            f"sigma {state.sigma:.4f}  {left:.0f} s left   ",
            end="",
            flush=True,
        )
    print()
    return state


def _learn(state: Evolution, constants: Rates, chosen: Matrix, whitening: Matrix) -> Evolution:
    """Move the distribution towards the chosen steps, shape (parents, n)."""
    mean_step = constants.weights @ chosen
    path_sigma = (1 - constants.c_sigma) * state.path_sigma + np.sqrt(
        constants.c_sigma * (2 - constants.c_sigma) * constants.mu_eff
    ) * (whitening @ mean_step)
    length = float(np.linalg.norm(path_sigma)) / constants.chi
    decay = np.sqrt(1 - (1 - constants.c_sigma) ** (2 * (state.generation + 1)))
    is_steady = length / decay < 1.4 + 2 / (state.mean.size + 1)
    path_covariance = (1 - constants.c_path) * state.path_covariance + is_steady * np.sqrt(
        constants.c_path * (2 - constants.c_path) * constants.mu_eff
    ) * mean_step
    covariance = (
        (1 - constants.c_one - constants.c_mu) * state.covariance
        + constants.c_one * np.outer(path_covariance, path_covariance)
        + constants.c_mu * (chosen.T * constants.weights) @ chosen
    )
    return replace(
        state,
        generation=state.generation + 1,
        mean=state.mean + state.sigma * mean_step,
        sigma=state.sigma * float(np.exp(constants.c_sigma / constants.d_sigma * (length - 1))),
        covariance=(covariance + covariance.T) / 2,
        path_sigma=path_sigma,
        path_covariance=path_covariance,
    )
