"""Evidence for two choices in docs/papers: pictures of what a method's parts do where the truth is known.

    python examples/paper_evidence.py walking-off --out kwon2005-walking-off.png
    python examples/paper_evidence.py learning --out lee2012-learning.png

`walking-off`: the robot stands, the person walks away, and the height of the box of `kwon2005` is compared with the
true height, with three settings of its template. `learning`: the likelihood of `lee2012`
around the true box, after learning from its own estimates and after learning from the true boxes.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import trackers
from pftrack_sim.core.records import Estimate
from pftrack_sim.trackers.papers.lee2012 import METHODS, Lee2012, Lee2012Parameters

SMALL = MappingProxyType({"camera.width_px": 320, "camera.height_px": 240, "lights.shadows": False})
WALKING_OFF: Mapping[str, Any] = MappingProxyType(
    {
        **SMALL,
        "duration_s": 10.0,
        "robot.route.kind": "still",
        "distractors.count": 0,
        "occluders": [],
        "target.path_m": [[3.5, 0.3], [14.0, 1.6]],
        "target.speed_m_s": 0.85,
    }
)
COARSE = MappingProxyType(
    {"point_count": 25, "sigma_scale": 0.0056, "sigma_wandering": 0.402, "sigma_centre": 0.0978, "hold_below": 0.0}
)
SETTINGS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "25 points": COARSE,
        "100 points, sigma_scale=0.02": {"sigma_scale": 0.02},
        "default: 100 points, 0.025": {},
        "100 points, 0.05": {"sigma_scale": 0.05},
    }
)
LEARNING: Mapping[str, Any] = MappingProxyType({**SMALL, "duration_s": 7.0})
PLACES = ("easy/plaza-walk", "easy/warehouse")
SHIFTS = np.linspace(-1.0, 1.0, 41)
"""Horizontal shifts of the box, as shares of its width."""


def frames(scenario: str, seed: int, changes: Mapping[str, Any]) -> Iterator[tuple[Any, Any]]:
    """Images and truth of an episode whose robot follows its script."""
    env = gym.make("pftrack_sim/Track-v0", scenario=scenario, overrides=dict(changes))
    observation, info = env.reset(seed=seed)
    done = False
    while not done:
        yield observation["image"], info["truth"]
        observation, _, terminated, truncated, info = env.step(np.asarray(info["truth"].box, dtype=np.float32))
        done = terminated or truncated
    env.close()


def walking_off(seed: int) -> plt.Figure:
    """Height of the box over the true height, against the distance of the person."""
    figure, axes = plt.subplots(1, len(PLACES), figsize=(9.0, 3.4), sharey=True, layout="constrained")
    for axis, place in zip(axes, PLACES, strict=True):
        episode = list(frames(place, seed, WALKING_OFF))
        for name, params in SETTINGS.items():
            tracker = trackers.make("kwon2005", seed=seed, **params)
            tracker.init(episode[0][0], episode[0][1].box)
            ratios = [tracker.update(image).box[3] / truth.amodal_box[3] for image, truth in episode[1:]]
            axis.plot([truth.distance_m for _, truth in episode[1:]], ratios, label=name)
        axis.axhline(1.0, color="0.6", linewidth=0.8, zorder=0)
        axis.set(title=place, xlabel="distance of the person [m]")
    axes[0].set_ylabel("height of the box / true height")
    axes[0].legend(frameon=False)
    return figure


class Taught(Lee2012):
    """`lee2012` that learns from boxes it is given instead of its own, and shows its likelihood.

    Attributes:
        teacher: `(4,)` box to learn from in the next frame [px]; None for its own estimate.
    """

    teacher: NDArray[np.float64] | None = None

    def _follow(self, image: Any) -> Estimate:
        if self.teacher is None:
            return super()._follow(image)
        lessons = [model.learn for model in self._models]
        taken: list[Any] = []
        for model in self._models:
            model.learn = taken.append  # type: ignore[method-assign]
        estimate = super()._follow(image)
        features = self._features(image, self.teacher[None])
        for model, lesson, feature in zip(self._models, lessons, features, strict=True):
            lesson(feature[0])
            model.learn = lesson  # type: ignore[method-assign]
        return estimate

    def likelihood(self, image: Any, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(N,)` likelihood (14) of `(N, 4)` boxes [px], over the largest."""
        parts = zip(self._shares, self._models, self._features(image, boxes), strict=True)
        found = np.sum([share * model.likelihood(feature) for share, model, feature in parts], axis=0)
        return found / found.max()

    def _features(self, image: Any, boxes: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        return self._region(image, boxes).features(boxes)


def learning(seed: int) -> plt.Figure:
    """Likelihood around the true box in the last frame, by what was learnt from."""
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.4), sharey=True, layout="constrained")
    episode = [(image, truth) for image, truth in frames("plaza-walk", seed, LEARNING) if truth.visible_fraction > 0.5]
    last_image, last_truth = episode[-1]
    shifted = np.tile(last_truth.box, (len(SHIFTS), 1))
    shifted[:, 0] += SHIFTS * last_truth.box[2]
    for axis, preset in zip(axes, ("paper", "default"), strict=True):
        for name, from_truth in (("its own estimates", False), ("the true boxes", True)):
            tracker = Taught(METHODS["lee2012"], Lee2012Parameters.from_preset("lee2012", preset, {}), seed)
            tracker.init(episode[0][0], episode[0][1].box)
            for image, truth in episode[1:]:
                tracker.teacher = np.asarray(truth.box) if from_truth else None
                tracker.update(image)
            axis.plot(SHIFTS, tracker.likelihood(last_image, shifted), label=f"taught by {name}")
        axis.axvline(0.0, color="0.6", linewidth=0.8, zorder=0)
        axis.set(title=f"preset {preset}", xlabel="shift from the true box [widths]", ylim=(0.0, 1.05))
    axes[0].set_ylabel("likelihood / its maximum")
    axes[0].legend(frameon=False)
    return figure


def main() -> None:
    """Draw one of the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("walking-off", "learning"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", required=True)
    given = parser.parse_args()
    draw = {"walking-off": walking_off, "learning": learning}[given.what]
    draw(given.seed).savefig(given.out, dpi=110)


if __name__ == "__main__":
    main()
