"""Evidence for choices in docs/papers: what a method's parts do where the truth is known.

    python examples/paper_evidence.py walking-off --out kwon2005-walking-off.png
    python examples/paper_evidence.py learning --out lee2012-learning.png
    python examples/paper_evidence.py noise
    python examples/paper_evidence.py causes --episodes ko2012/video-4:0,1,2
    python examples/paper_evidence.py hue --episodes ko2012/video-1:0,1,2
    python examples/paper_evidence.py background --episodes lee2012/07:0,1,2 --seconds 8
    python examples/paper_evidence.py taught --seconds 8

`walking-off`: the robot stands, the person walks away, and the height of the box of `kwon2005` is compared with the
true height, with three settings of its template. `learning`: the likelihood of `lee2012`
around the true box, after learning from its own estimates and after learning from the true boxes. `noise`: a table of
the target's motion in the videos after Ko et al. 2012 beside the noise of `ko2012`, and its effective sample size.
`causes`: overlaps of `ko2012` in those videos without what covers the target, and without what stands behind it.
`hue`: how alike the target in full view, and boxes beside it, are to its first frame in each channel of RGB and HSV.
`background`: the episodes after Lee et al. 2012 that `lee2012` loses by day, each changed in one thing at a time.
`taught`: `lee2012` with several settings in these recordings, taught by its own estimates or by the true boxes.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from types import MappingProxyType
from typing import Any, TypeAlias

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim import trackers
from pftrack_sim.core.records import Estimate
from pftrack_sim.score.curves import success_rate
from pftrack_sim.score.frames import counted_frames, frame_scores
from pftrack_sim.trackers.features.pixel_codes import hsv_codes, rgb_codes
from pftrack_sim.trackers.filters import ParticleFilter
from pftrack_sim.trackers.papers.ko2012 import Ko2012, Ko2012Parameters
from pftrack_sim.trackers.papers.lee2012 import METHODS, Lee2012, Lee2012Parameters
from pftrack_sim.truth.silhouettes import Silhouette

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
UNCOVERED: Mapping[str, Any] = MappingProxyType({"occluders": [], "distractors.count": 0})
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

LOST = MappingProxyType({"lee2012/01": (0, 1, 4), "lee2012/02": (2, 3), "lee2012/03": (4,)})
"""Seeds of episodes by day that `lee2012` loses in the first 11 s."""
CHANGES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "nothing": {},
        "no other people": {"axes.distractors.severity": 0, "distractors.count": 0},
        "steady light": {"axes.light.severity": 0, "lights.patches": 0},
        "nothing on the ground": {"place.clutter": 0},
        "steady operator": {"robot.operator.character": "steady", "robot.operator.wander_deg": 0},
        "constant distance": {"robot.operator.distance_ratio": 1},
    }
)
METHOD_CHANGES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "four times the particles": {"particle_count": 1600},
        "taught by the true boxes": {"taught": True},
        "first box with the legs together": {"narrow": True},
    }
)
FROM_BOX: Mapping[str, Any] = MappingProxyType({"start": "box", "resampling": "systematic"})
SHARP: Mapping[str, Any] = MappingProxyType({"sigma_colour": 0.22, "sigma_hog": 0.22})
FREE: Mapping[str, Any] = MappingProxyType({"anchored": False, "learned_sigma_colour": 0.15, "learned_sigma_hog": 0.15})
LESSONS: tuple[tuple[str, str, Mapping[str, Any]], ...] = (
    ("lee2012-color", "paper", {}),
    ("lee2012-color", "paper", SHARP),
    ("lee2012-color-hog", "paper", {}),
    ("lee2012-color-hog", "paper", SHARP),
    ("lee2012", "paper", {}),
    ("lee2012", "paper", FROM_BOX),
    ("lee2012", "default", {**FREE, "memory": "sliding"}),
    ("lee2012", "default", FREE),
    ("lee2012", "default", {}),
)
"""Methods, presets and changed parameters of `taught`."""


def frames(
    scenario: str, seed: int, changes: Mapping[str, Any], contrast: float = 1.0
) -> Iterator[tuple[NDArray[np.uint8], Any]]:
    """Images and truth of an episode whose robot follows its script; `contrast` of all but the target's pixels."""
    env = gym.make("pftrack_sim/Track-v0", scenario=scenario, overrides=dict(changes))
    observation, info = env.reset(seed=seed)
    done = False
    while not done:
        image = observation["image"]
        if contrast < 1.0:
            image = faded(image, env.unwrapped.simulation.silhouettes.get("target"), contrast)  # type: ignore[attr-defined]
        yield image, info["truth"]
        observation, _, terminated, truncated, info = env.step(np.asarray(info["truth"].box, dtype=np.float32))
        done = terminated or truncated
    env.close()


def faded(image: NDArray[np.uint8], target: Silhouette | None, contrast: float) -> NDArray[np.uint8]:
    """The image with all but the target's visible pixels drawn towards the image's mean colour."""
    mean = image.mean((0, 1))
    out = np.asarray(np.round(mean + contrast * (image - mean)), dtype=np.uint8)
    if target is not None:
        rows, columns = target.rect.slices
        out[rows, columns][target.visible] = image[rows, columns][target.visible]
    return out


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
        features = self._features(self._encode(image, self.teacher[None]), self.teacher[None])
        for model, lesson, feature in zip(self._models, lessons, features, strict=True):
            lesson(feature[0])
            model.learn = lesson  # type: ignore[method-assign]
        return estimate

    def likelihood(self, image: Any, boxes: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(N,)` likelihood (14) of `(N, 4)` boxes [px], over the largest."""
        parts = zip(self._shares, self._models, self._features(self._encode(image, boxes), boxes), strict=True)
        found = np.sum([share * model.likelihood(feature) for share, model, feature in parts], axis=0)
        return found / found.max()


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


class Weighed(Ko2012):
    """`ko2012` that keeps the log-likelihoods of its particles."""

    def log_likelihood(self, seen: Any, wanted: NDArray[np.float64]) -> NDArray[np.float64]:
        """As it weighs the particles."""
        self.weights = super().log_likelihood(seen, wanted)
        return self.weights

    def effective_share(self) -> float:
        """Effective sample size over the number of particles, in the last frame."""
        weighed = ParticleFilter(np.zeros((len(self.weights), 1)), np.random.default_rng(0))
        weighed.weigh(self.weights)
        return weighed.effective_share


def noise(seed: int, videos: Iterable[str], changes: Mapping[str, Any]) -> Iterator[str]:
    """Lines of a table: motion of the centre per frame, noise of the centre, effective sample size over N."""
    yield "| | motion: median, 0.9 quantile [px] | sigma_centre [px], ESS / N: paper | default |"
    yield "| --- | --- | --- | --- |"
    for video in videos:
        episode = list(frames(video, seed, changes))
        middles = np.array([truth.amodal_box[:2] + 0.5 * truth.amodal_box[2:] for _, truth in episode])
        moved = np.hypot(*np.diff(middles, axis=0).T)
        cells = [f"{np.median(moved):.2f}, {np.quantile(moved, 0.9):.2f}"]
        for preset in ("paper", "default"):
            params = Ko2012Parameters.from_preset("ko2012", preset, {})
            tracker = Weighed("ko2012", params, seed)
            tracker.init(episode[0][0], episode[0][1].box)
            shares = [(tracker.update(image), tracker.effective_share())[1] for image, _ in episode[1:]]
            width, height = episode[0][1].box[2:]
            sigma, *_ = params.sigma_px(np.array([0.0, 0.0, width, height]))
            cells.append(f"{sigma:.1f}, {np.median(shares):.3f}")
        yield f"| {video} | {' | '.join(cells)} |"


def causes(episodes: Mapping[str, Iterable[int]]) -> Iterator[str]:
    """Lines of a table: mean overlaps of `ko2012` and of the first box carried along at the true centre."""
    pairs = ("as it is", "no covers", "no contrast behind", "neither")
    heads = [f"{pair}: `{preset}`" for pair in pairs for preset in ("paper", "default")]
    yield f"| | {' | '.join([*heads[:2], 'fixed size', *heads[2:]])} |"
    yield f"|{' --- |' * 10}"
    for scenario, seeds in episodes.items():
        rows = [ko2012_overlaps(scenario, seed) for seed in seeds]
        yield f"| {scenario} | {' | '.join(f'{value:.2f}' for value in np.mean(rows, axis=0))} |"


def hue(episodes: Mapping[str, Iterable[int]]) -> Iterator[str]:
    """Lines of a table: similarity of 128-bin histograms with the first frame's, by channel."""
    yield "| | target: R, G, B | beside | difference | target: H, S, V | beside | difference |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for scenario, seeds in episodes.items():
        cells: list[str] = []
        for codes in (rgb_codes, hsv_codes):
            rows = np.array([row for seed in seeds for row in similarities(scenario, seed, codes)])
            own, beside = rows[:, 0].mean(axis=0), rows[:, 1:].mean(axis=(0, 1))
            cells += [", ".join(f"{value:.2f}" for value in one) for one in (own, beside)]
            cells.append(f"{(own - beside).mean():.3f}")
        yield f"| {scenario} | {' | '.join(cells)} |"


def similarities(
    scenario: str, seed: int, codes: Callable[[NDArray[np.uint8], int], NDArray[np.uint8]]
) -> Iterator[NDArray[np.float64]]:
    """`(5, 3)` of the target and of boxes 0.6 and 1.2 widths aside, by channel, in every twelfth of 240 frames."""
    first: NDArray[np.float64] | None = None
    for index, (image, truth) in enumerate(islice(frames(scenario, seed, {}), 240)):
        if index % 12 or truth.visible_fraction < 0.9:
            continue
        x, y, width, height = truth.amodal_box
        coded = codes(image, 128)
        found: list[NDArray[np.float64]] = []
        for left in x + width * np.array([0.0, -1.2, -0.6, 0.6, 1.2]):
            box = np.maximum(np.rint([y, y + height, left, left + width]).astype(int), 0)
            pixels = coded[box[0] : box[1], box[2] : box[3]].reshape(-1, 3)
            counts = np.array([np.bincount(channel, minlength=128) for channel in pixels.T])
            found.append(counts / max(len(pixels), 1))
        if first is None:
            first = found[0]
        else:
            yield np.sqrt(first * np.array(found)).sum(axis=2)


def ko2012_overlaps(scenario: str, seed: int) -> list[float]:
    """A row of `causes` for one episode."""
    row: list[float] = []
    for contrast in (1.0, 0.0):
        for given in ({}, UNCOVERED):
            episode = list(frames(scenario, seed, given, contrast))
            truth = np.array([one.box for _, one in episode])
            counted = counted_frames([one.scored for _, one in episode])
            for preset in ("paper", "default"):
                tracker = trackers.make("ko2012", seed=seed, preset=preset)
                tracker.init(episode[0][0], truth[0])
                boxes = np.array([truth[0], *(tracker.update(image).box for image, _ in episode[1:])])
                row.append(float(np.mean(frame_scores(boxes, truth).overlap[counted])))
            if not given and contrast == 1.0:
                fixed = np.hstack(
                    [truth[:, :2] + 0.5 * (truth[:, 2:] - truth[0, 2:]), np.tile(truth[0, 2:], (len(truth), 1))]
                )
                row.append(float(np.mean(frame_scores(fixed, truth).overlap[counted])))
    return row


Episode: TypeAlias = list[tuple[NDArray[np.uint8], Any]]


def followed(
    episode: Episode,
    seed: int,
    *,
    method: str = "lee2012",
    preset: str = "default",
    taught: bool = False,
    narrow: bool = False,
    **params: Any,
) -> tuple[float, float]:
    """Share of frames in which `method` overlaps the true box by a half, and the spread of its particles.

    The spread is the median standard deviation of their centres across, in widths of the target. `taught`: the method
    learns from the true boxes. `narrow`: its first box is as wide as the target with its legs together, and its answers
    are widened to the shape of the true first box.
    """
    truth = np.array([one.box for _, one in episode])
    first = truth[0].copy()
    if narrow:
        first[2] = np.quantile(truth[:60, 2], 0.1)
        first[0] += 0.5 * (truth[0, 2] - first[2])
    tracker = Taught(
        METHODS[method], Lee2012Parameters.from_preset(method, preset, {**params, "particles": True}), seed
    )
    tracker.init(episode[0][0], first)
    answers, spreads = [first], []
    for image, one in episode[1:]:
        tracker.teacher = np.array(one.box) if taught and one.visible_fraction > 0.3 else None
        estimate = tracker.update(image)
        answers.append(np.asarray(estimate.box))
        assert estimate.particles is not None
        spreads.append(np.std(estimate.particles[:, 0] + 0.5 * estimate.particles[:, 2]) / one.amodal_box[2])
    boxes = np.array(answers)
    if narrow:
        widths = boxes[:, 3] * truth[0, 2] / truth[0, 3]
        boxes[:, 0] += 0.5 * (boxes[:, 2] - widths)
        boxes[:, 2] = widths
    overlap = frame_scores(boxes, truth).overlap
    return success_rate(overlap[counted_frames([one.scored for _, one in episode])]), float(np.median(spreads))


def background(episodes: Mapping[str, Iterable[int]], changes: Mapping[str, Any]) -> Iterator[str]:
    """Lines of a table: per cent of frames tracked in each episode, by what is changed."""
    named = [(scenario, seed) for scenario, seeds in episodes.items() for seed in seeds]
    rows: dict[str, list[float]] = {}
    for scenario, seed in named:
        for name, given in CHANGES.items():
            episode = list(frames(scenario, seed, {**changes, **given}))
            rows.setdefault(name, []).append(followed(episode, seed)[0])
            if not given:
                for how, params in METHOD_CHANGES.items():
                    rows.setdefault(how, []).append(followed(episode, seed, **params)[0])
        for contrast in (0.5, 0.0):
            episode = list(frames(scenario, seed, changes, contrast))
            rows.setdefault(f"contrast of the background x {contrast}", []).append(followed(episode, seed)[0])
    yield f"| changed | {' | '.join(f'{scenario}, {seed}' for scenario, seed in named)} | mean |"
    yield f"| {' | '.join(['---'] * (len(named) + 2))} |"
    for name, shares in rows.items():
        yield f"| {name} | {' | '.join(f'{100 * share:.0f}' for share in [*shares, float(np.mean(shares))])} |"


def taught(episodes: Mapping[str, Iterable[int]], changes: Mapping[str, Any]) -> Iterator[str]:
    """Lines of a table: per cent of frames tracked and spread of the particles, by what the method learns from."""
    found: list[list[list[float]]] = [[] for _ in LESSONS]
    for scenario, seeds in episodes.items():
        for seed in seeds:
            episode = list(frames(scenario, seed, changes))
            for rows, (method, preset, params) in zip(found, LESSONS, strict=True):
                row = [*followed(episode, seed, method=method, preset=preset, **params)]
                if METHODS[method].learns:
                    row.append(followed(episode, seed, method=method, preset=preset, taught=True, **params)[0])
                rows.append(row)
    yield "| | spread of the particles [widths of the target] | own estimates | true boxes |"
    yield "| --- | --- | --- | --- |"
    for rows, (method, preset, params) in zip(found, LESSONS, strict=True):
        given = ",".join([f"preset={preset}", *(f"{name}={value}" for name, value in params.items())])
        own, spread, *true = np.mean(rows, axis=0)
        shares = [f"{100 * share:.0f}" for share in (own, *true)]
        yield f"| `{method}[{given}]` | {spread:.2f} | {' | '.join([*shares, '-'][:2])} |"


def main() -> None:
    """Draw one of the pictures, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("walking-off", "learning", "noise", "causes", "hue", "background", "taught"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", help="file of the picture")
    parser.add_argument("--episodes", nargs="+", metavar="SCENARIO:SEED,SEED", help="of a table, but `noise`")
    parser.add_argument("--seconds", type=float, default=11.0, help="length of an episode of `background` and `taught`")
    given = parser.parse_args()
    parts = [one.partition(":") for one in given.episodes or ()]
    episodes = {scenario: [int(seed) for seed in seeds.split(",")] for scenario, _, seeds in parts}
    videos = [f"ko2012/video-{number}" for number in range(1, 6)]
    tables = {
        "noise": lambda: noise(given.seed, videos, {}),
        "causes": lambda: causes(episodes or {video: [0, 1, 2] for video in videos}),
        "hue": lambda: hue(episodes or {video: [0, 1, 2] for video in videos}),
        "background": lambda: background(episodes or LOST, {"duration_s": given.seconds}),
        "taught": lambda: taught(
            episodes or {f"lee2012/0{number}": [0, 1] for number in range(1, 9)}, {"duration_s": given.seconds}
        ),
    }
    if given.what in tables:
        for line in tables[given.what]():
            print(line)
        return
    if given.out is None:
        parser.error("a picture needs --out")
    draw = {"walking-off": walking_off, "learning": learning}[given.what]
    draw(given.seed).savefig(given.out, dpi=110)


if __name__ == "__main__":
    main()
