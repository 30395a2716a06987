"""Simulated observers, whose breaking point is known, in an adaptive search.

`python tests/benchmark/observers.py` prints how often the interval holds the breaking point, as on the page of limits.
"""

import itertools
import math

import numpy as np
import scipy

from pftrack_sim.benchmark.limits.psychometric import Psychometric, next_levels, psychometric, threshold

BATCH = 8


def coordinates(levels: int = 33, span: float = 4.0 * math.log(2.0)) -> np.ndarray:
    return np.array([-math.inf, *np.linspace(0.0, span, levels)])


def success_rates(grid: Psychometric, at: float, spread: float, lapse: float, shape: str = "logistic") -> np.ndarray:
    """`(L,)` rates of an observer; threshold and spread are shares of the range, spread as the logistic function's."""
    low, high = grid.ends
    z = (grid.coordinates - low - at * (high - low)) / (spread * (high - low))
    share = grid.at / (1.0 - lapse)
    if shape == "logistic":
        falling = scipy.special.expit(-z + scipy.special.logit(share))
    elif shape == "normal":
        falling = scipy.special.ndtr(-z / 1.7 + scipy.special.ndtri(share))
    else:
        falling = np.exp(np.log(share) * np.exp(np.clip(z / 1.4, -700.0, 50.0)))
    return (1.0 - lapse) * falling


def search(grid: Psychometric, rates: np.ndarray, budget: int, rng, width: float = 0.0, chunk: int = 250) -> np.ndarray:
    """`(N, L, 2)` counts of N observers with rates `(N, L)`; a search stops at the budget or the width."""
    counts = np.zeros((*rates.shape, 2))
    for first in range(0, len(rates), chunk):
        active = np.arange(first, min(first + chunk, len(rates)))
        for trials in range(BATCH, budget + 1, BATCH):
            for level in next_levels(grid, counts[active][:, None], BATCH, trials // BATCH - 1).T:
                hit = rng.random(active.size) < rates[active, level]
                np.add.at(counts, (active, level, np.where(hit, 0, 1)), 1.0)
            if width and trials >= 3 * BATCH:
                active = np.array([one for one in active if not _enough(grid, counts[one], width)], dtype=np.intp)
            if not active.size:
                break
    return counts


def _enough(grid: Psychometric, counts: np.ndarray, width: float) -> bool:
    found = threshold(grid, counts)
    if not math.isfinite(found.low + found.high):
        return max(found.above, found.broken + found.below) >= 0.975
    return math.exp(found.high) - math.exp(found.low) <= width * math.exp(found.coordinate)


def covered(grid: Psychometric, counts: np.ndarray, at: float) -> np.ndarray:
    """`(N,)` whether the interval holds the threshold, a share of the range."""
    low, high = grid.ends
    ends = [threshold(grid, one) for one in counts]
    true = low + at * (high - low)
    return np.array([one.low <= true <= one.high for one in ends])


def main(observers: int = 600) -> None:
    """Print a row for each kind of observer and each way to stop: shares of intervals that hold the breaking point."""
    places = (0.05, 0.35, 0.65, 0.95)
    kinds = itertools.product(("logistic", "normal"), (0.045, 0.12), (0.0, 0.04))
    print("| curve | spread | lapse | rate | stop |", *(f"{one} |" for one in places), "episodes |")  # noqa: T201
    print("| --- " * (6 + len(places)) + "|")  # noqa: T201
    stops = [(0.5, 24, 0.0), (0.5, 64, 0.0), (0.5, 200, 0.3), (0.75, 64, 0.0)]
    for (shape, spread, lapse), (wanted, budget, width) in itertools.product(kinds, stops):
        grid = psychometric(coordinates(), wanted)
        held: list[float] = []
        episodes: list[float] = []
        for place in places:
            rates = np.tile(success_rates(grid, place, spread, lapse, shape), (observers, 1))
            counts = search(grid, rates, budget, np.random.default_rng([round(100 * place), budget]), width)
            held.append(float(covered(grid, counts, place).mean()))
            episodes.append(float(np.median(counts.sum(axis=(1, 2)))))
        stop = f"{width:.0%} or {budget}" if width else f"{budget}"
        cells = [shape, f"{spread:g}", f"{lapse:g}", f"{wanted:g}", stop, *(f"{one:.3f}" for one in held)]
        print(f"| {' | '.join(cells)} | {np.median(episodes):.0f} |", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
