"""Third-party controllers, valid and invalid."""

import numpy as np

NUMBER = 3


class Spinner:
    """Turns on the spot."""

    def __init__(self, rate: float = 1.0) -> None:
        self.rate = rate

    def reset(self, robot) -> None:
        pass

    def act(self, estimate, proprio) -> np.ndarray:
        return np.array([0.0, self.rate, 0.0, 0.0])


def broken():
    raise RuntimeError("no motor")


def nothing():
    return {}
