"""AdaBoost over thresholds of single features (Freund & Schapire 1997; Viola & Jones 2001), for training every frame.

Each feature has one weak classifier, whose threshold is where two normal distributions of the classes' means and
standard deviations would be told apart at equal errors. It is set once for all rounds: a round is then one product of
a vector with a matrix, and a classifier of 40 features is trained in about a millisecond.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pftrack_sim.core.types import BoolArray, FloatArray

_LEAST = 1e-9  # Differences of means below this share of them are rounding errors


@dataclass(frozen=True, eq=False)
class StrongClassifier:
    """A weighted vote of weak classifiers.

    Attributes:
        chosen: `(T,)` indices of their features, each one once.
        thresholds: `(T,)` threshold of each.
        slopes: `(T,)` positive where values above the threshold are the target's; 1 over half the distance of the
            classes' means.
        votes: `(T,)` weights >= 0, summing to 1.
    """

    chosen: NDArray[np.intp]
    thresholds: FloatArray
    slopes: FloatArray
    votes: FloatArray

    def score(self, features: FloatArray, *, soft: bool) -> FloatArray:
        """`(N,)` confidence in [-1, 1] of `(N, T)` values of the chosen features; 1: certainly the target.

        Args:
            features: Their values.
            soft: Whether a weak classifier's answer grows linearly from the threshold to the mean of each class;
                otherwise it is -1 or 1.
        """
        margins = (features - self.thresholds) * self.slopes
        answers = np.clip(margins, -1.0, 1.0) if soft else np.where(margins > 0.0, 1.0, -1.0)
        return answers @ self.votes


def train(features: FloatArray, positive: BoolArray, weights: FloatArray, rounds: int) -> StrongClassifier:
    """Train on `(M, K)` features of M samples, of which the `(M,)` positive ones show the target.

    `weights` are `(M,)` weights >= 0 of the samples; both classes have the same total. Of K features at most `rounds`
    are chosen, fewer where none is left that is right more often than not.
    """
    current = weights.copy()
    current[positive] /= float(weights[positive].sum())
    current[~positive] /= float(weights[~positive].sum())
    target, target_deviation = _moments(features[positive], current[positive])
    other, other_deviation = _moments(features[~positive], current[~positive])
    spread = target_deviation + other_deviation
    share = np.divide(target_deviation, spread, out=np.full_like(spread, 0.5), where=spread > 0.0)
    difference = target - other
    thresholds = target - share * difference
    differs = np.abs(difference) > _LEAST * (np.abs(target) + np.abs(other))
    slopes = np.divide(2.0, difference, out=np.zeros_like(difference), where=differs)
    # 1 where a weak classifier is right about a sample, -1 where it is wrong; 0 on the threshold.
    sides = np.sign((features - thresholds) * slopes)
    right = np.where(differs, sides * np.where(positive, 1.0, -1.0)[:, None], -1.0)
    chosen: list[int] = []
    votes: list[float] = []
    current = 0.5 * current
    least_error = 0.5 / len(features)
    for _ in range(min(rounds, features.shape[1])):
        errors: FloatArray = 0.5 * (1.0 - current @ right)
        errors[chosen] = 1.0
        best = int(errors.argmin())
        if errors[best] >= 0.5:
            break
        error = max(float(errors[best]), least_error)
        vote = 0.5 * math.log((1.0 - error) / error)
        current = current * np.exp(-vote * right[:, best])
        current /= current.sum()
        chosen.append(best)
        votes.append(vote)
    index = np.array(chosen, dtype=np.intp)
    share_of_vote = np.array(votes) / sum(votes) if votes else np.empty(0)
    return StrongClassifier(index, thresholds[index], slopes[index], share_of_vote)


def _moments(features: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """`(K,)` weighted means and standard deviations of `(M, K)` features, with `(M,)` weights summing to 1."""
    mean = weights @ features
    return mean, np.sqrt(weights @ np.square(features - mean))
