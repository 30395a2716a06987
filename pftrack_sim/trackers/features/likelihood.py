"""From how alike two histograms are to how likely the target is there."""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Form: TypeAlias = Literal["linear", "exponential"]
"""With the Bhattacharyya distance d: `"linear"` is 1 - d^2, the coefficient; `"exponential"` is exp(-lambda d^2)."""


def log_mixture(
    similarities: NDArray[np.float64], shares: NDArray[np.float64], form: Form, sharpness: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Logarithm of a linear mixture of one likelihood per feature (Ko et al. 2012, eq. 9).

    Args:
        similarities: `(F, N)` Bhattacharyya coefficients.
        shares: `(F,)` weight of each feature, summing to 1.
        form: What each feature's likelihood is.
        sharpness: `(F,)` lambda of each feature; not used by `"linear"`.

    Returns:
        `(N,)` logarithms; -inf where nothing is alike.
    """
    likelihoods = similarities if form == "linear" else np.exp(-sharpness[:, None] * (1.0 - similarities))
    with np.errstate(divide="ignore"):
        return np.log(shares @ likelihoods)
