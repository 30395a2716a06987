"""Simulated observers, whose breaking point is known, in an adaptive search."""

import math

import numpy as np
import scipy

from pftrack_sim.score.psychometric import Psychometric, next_levels, threshold

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
