"""Pictures of the methods of docs/papers/relatives.md at work, on an episode of the simulator.

    python examples/relatives_pictures.py yang2005 --out yang2005.png

Each function of `PICTURES` draws one method, from what its tracker computes itself.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import cv2
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Polygon, Rectangle
from numpy.typing import NDArray
from paper_evidence import SMALL, frames

from pftrack_sim import scenario, trackers
from pftrack_sim.benchmark.running.rollout import detected, simulated
from pftrack_sim.core import boxes
from pftrack_sim.core.records import Estimate, TrackedBoxes
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.features.integral import integral_image
from pftrack_sim.trackers.relatives import khan2011 as khan2011_module
from pftrack_sim.trackers.relatives.islam2009 import SHAPE, Islam2009
from pftrack_sim.trackers.relatives.khan2011 import Khan2011
from pftrack_sim.trackers.relatives.klein2010 import CHANNEL_COUNT, Klein2010
from pftrack_sim.trackers.relatives.sidibe2010 import Sidibe2010
from pftrack_sim.trackers.relatives.yang2005 import STAGES, Yang2005

WALK: Mapping[str, Any] = MappingProxyType({**SMALL, "duration_s": 2.0})
CROWD: Mapping[str, Any] = MappingProxyType(
    {**SMALL, "duration_s": 3.0, "camera.rate_hz": 15.0, "axes.detector.severity": 1.0, "axes.detector.height_px": 20.0}
)
NEAR: Mapping[str, Any] = MappingProxyType({**WALK, "camera.width_px": 640, "camera.height_px": 480})
COVERED: Mapping[str, Any] = MappingProxyType({**SMALL, "duration_s": 8.0})


def follow(name: str, episode: list[tuple[Any, Any]], seed: int, **params: Any) -> tuple[Any, list[Estimate]]:
    """A tracker after an episode, and its estimates with particles, one for every frame but the first."""
    tracker = trackers.make(name, seed=seed, particles=True, **params)
    tracker.init(episode[0][0], episode[0][1].box)
    return tracker, [tracker.update(image) for image, _ in episode[1:]]


def show(axis: plt.Axes, image: NDArray[np.uint8], around: NDArray[np.float64], title: str) -> None:
    """The part of an image within one and a half sizes of a `(4,)` box [px], with the box."""
    axis.imshow(image)
    x, y, w, h = around
    side = max(w, h)
    axis.set(xlim=(x + w / 2 - side, x + w / 2 + side), ylim=(y + h / 2 + side, y + h / 2 - side), title=title)
    axis.set_axis_off()
    outline(axis, around, "white")


def outline(axis: plt.Axes, box: NDArray[np.float64], colour: str, style: str = "-") -> None:
    """A `(4,)` box [px] on an image."""
    x, y, w, h = box
    # Pixel centres lie at whole numbers in matplotlib and at halves in boxes.
    axis.add_patch(Rectangle((x - 0.5, y - 0.5), w, h, fill=False, edgecolor=colour, linewidth=1.5, linestyle=style))


def yang2005(seed: int) -> plt.Figure:
    """The particles of one frame by the last stage that observed them."""
    episode = list(frames("plaza-walk", seed, WALK))
    tracker, found = follow("yang2005", episode, seed)
    assert isinstance(tracker, Yang2005)
    particles, last = found[-1].particles, found[-1].box
    assert particles is not None
    total, observed = tracker.survivors(tracker.observe(episode[-1][0], particles), particles)
    figure, axes = plt.subplots(1, len(STAGES), figsize=(11.0, 3.2), layout="constrained")
    centres = particles[:, :2] + 0.5 * particles[:, 2:] - 0.5
    for index, (axis, stage) in enumerate(zip(axes, STAGES, strict=True)):
        seen = observed[stage]
        left = observed[STAGES[index + 1]] if index + 1 < len(STAGES) else seen[np.isfinite(total[seen])]
        show(axis, episode[-1][0], last, f"{stage}\n{len(seen)} observed, {len(left)} kept")
        axis.scatter(*centres[seen].T, s=5, color="tab:red", linewidths=0)
        axis.scatter(*centres[left].T, s=5, color="yellow", linewidths=0)
    return figure


def deguchi2004(seed: int) -> plt.Figure:
    """Similarity over an episode with covers, and one frame of each mode."""
    episode = list(frames("warehouse", seed, COVERED))
    _, found = follow("deguchi2004", episode, seed)
    lost = np.array([one.occluded for one in found])
    figure, axes = plt.subplot_mosaic("abb", figsize=(11.0, 3.2), layout="constrained")
    frame = int(lost.argmax()) if lost.any() else len(found) - 1
    shown = found[frame]
    show(axes["a"], episode[frame + 1][0], shown.box, f"frame {frame + 1}: the particles have taken over")
    assert shown.particles is not None
    axes["a"].scatter(*(shown.particles[:, :2] + 0.5 * shown.particles[:, 2:] - 0.5).T, s=5, color="yellow")
    index = np.arange(1, len(found) + 1)
    axes["b"].plot(index, [one.confidence for one in found], label="similarity of the estimate")
    axes["b"].plot(index, [truth.visible_fraction for _, truth in episode[1:]], label="visible fraction of the target")
    overlaps = [boxes.iou(one.box, truth.box) for one, (_, truth) in zip(found, episode[1:], strict=True)]
    axes["b"].plot(index, overlaps, linewidth=0.8, color="0.5", label="overlap with the true box")
    axes["b"].fill_between(index, 0, 1, where=lost, color="tab:red", alpha=0.2, label="the particles have taken over")
    axes["b"].set(xlabel="frame", ylim=(0, 1.02))
    axes["b"].legend(frameon=False, fontsize=8, loc="lower right")
    return figure


def islam2009(seed: int) -> plt.Figure:
    """A frame, the distances to its edges, the template, and the patches of two boxes with their correlations."""
    episode = list(frames("plaza-walk", seed, WALK))
    tracker, found = follow("islam2009", episode, seed)
    assert isinstance(tracker, Islam2009)
    image, last = episode[-1][0], found[-1].box
    near = last + np.array([-last[2], -0.5 * last[3], 2.0 * last[2], last[3]])
    seen = tracker.observe(image, near[None])
    aside = last + np.array([0.6 * last[2], 0.0, 0.0, 0.0])
    figure, axes = plt.subplots(1, 5, figsize=(11.0, 3.2), layout="constrained", width_ratios=(2, 2, 1, 1, 1))
    show(axes[0], image, last, "frame")
    outline(axes[0], aside, "tab:red")
    axes[1].imshow(seen.distances, cmap="gray")
    axes[1].set_title("distance to edges")
    for axis, box, colour in ((axes[3], last, "estimate"), (axes[4], aside, "aside (red)")):
        patch = seen.shapes(box[None])[0]
        axis.imshow(patch.reshape(SHAPE), cmap="gray")
        axis.set_title(f"{colour}\ncorrelation {patch @ tracker.template / patch.size:.2f}")
    axes[2].imshow(tracker.template.reshape(SHAPE), cmap="gray")
    axes[2].set_title("template")
    for axis in axes:
        axis.set_axis_off()
    return figure


def klein2010(seed: int) -> plt.Figure:
    """The regions of the heaviest weak classifiers, and the confidence of boxes at all places near the target."""
    episode = list(frames("easy/plaza-walk", seed, NEAR))
    tracker, _ = follow("klein2010", episode[:-1], seed)
    assert isinstance(tracker, Klein2010)
    image, classifier = episode[-1][0], tracker.classifier
    last = tracker.update(image).box
    figure, axes = plt.subplots(1, 4, figsize=(11.0, 3.6), layout="constrained", width_ratios=(1, 1, 1, 1.2))
    for channel, name in enumerate(("intensity", "red less green", "blue less yellow")):
        axis, votes = axes[channel], np.where(classifier.chosen % CHANNEL_COUNT == channel, classifier.votes, 0.0)
        show(axis, image, last, f"{name}:\n{(votes > 0).sum()} features,\n{100 * votes.sum():.0f} % of the votes")
        axis.set(xlim=np.add(axis.get_xlim(), (0.35 * last[3], -0.35 * last[3])))
        for place in np.argsort(-votes)[:3]:
            region, above = classifier.chosen[place] // CHANNEL_COUNT, classifier.slopes[place] > 0
            for part, style in ((tracker.pool.regions[region], "--"), (tracker.pool.centres[region], "-")):
                box = np.concatenate([last[:2] + part[:2] * last[2:], part[2:] * last[2:]])
                outline(axis, box, "red" if above else "cyan", style)
    figure.supxlabel(
        "the three heaviest weak classifiers: centre (solid) and region (dashed); red: the centre is above", fontsize=9
    )
    shifts = np.linspace(-0.75, 0.75, 31)
    moved = last + np.stack([*np.meshgrid(shifts, shifts), *np.zeros((2, 31, 31))], axis=-1) * np.tile(last[2:], 2)
    moved = moved.reshape(-1, 4)
    seen = tracker.observe(image, np.concatenate([moved, last[None]]))
    confidences = tracker.confidences(seen, moved).reshape(31, 31)
    drawn = axes[3].contourf(shifts, shifts, confidences, levels=np.linspace(-1, 1, 21), cmap="RdBu_r")
    axes[3].set(title="confidence of a shifted box", xlabel="shift [widths]", ylabel="shift [heights]")
    axes[3].invert_yaxis()
    figure.colorbar(drawn, ax=axes[3], ticks=[-1, 0, 1])
    return figure


def sidibe2010(seed: int) -> plt.Figure:
    """A frame with its particles, its saliency, and the shares of saliency in the first box and in the estimate."""
    episode = list(frames("easy/plaza-walk", seed, NEAR))
    tracker, found = follow("sidibe2010", episode, seed)
    assert isinstance(tracker, Sidibe2010)
    image, last, particles = episode[-1][0], found[-1].box, found[-1].particles
    assert particles is not None
    saliency = tracker.saliency(image)
    figure, axes = plt.subplots(1, 4, figsize=(11.0, 2.9), layout="constrained", width_ratios=(4, 4, 1.3, 1.3))
    axes[0].imshow(image)
    axes[0].scatter(*(particles[:, :2] + 0.5 * particles[:, 2:] - 0.5).T, s=3, color="yellow", linewidths=0)
    axes[0].set_title("frame, particles, estimate")
    axes[1].imshow(saliency, cmap="magma", extent=(-0.5, image.shape[1] - 0.5, image.shape[0] - 0.5, -0.5))
    axes[1].set_title("saliency")
    margin, side = tracker.params.margin, tracker.params.cells
    for axis in axes[:2]:
        outline(axis, last, "white")
    outline(axes[1], np.concatenate([last[:2] - margin * last[2:], (1.0 + 2.0 * margin) * last[2:]]), "white", "--")
    start, present = tracker._root_model**2, tracker.distributions(integral_image(saliency), last[None])[0]
    alike = np.sqrt(start * present).sum()
    for axis, shares, name in ((axes[2], start, "first box"), (axes[3], present, f"estimate,\nsimilarity {alike:.2f}")):
        axis.imshow(shares.reshape(side, side), cmap="magma", vmin=0.0, aspect=last[3] / last[2])
        axis.set_title(f"shares in {name}", fontsize=9)
    for axis in axes:
        axis.set_axis_off()
    return figure


def khan2011(seed: int) -> plt.Figure:
    """The rotated box with its areas, the climb of its particles, and its angle while the image is turned."""
    episode = list(frames("easy/plaza-walk", seed, {**NEAR, "duration_s": 4.0}))
    turns = 20.0 * np.sin(2.0 * np.pi * np.arange(len(episode)) / len(episode))
    height, width = episode[0][0].shape[:2]
    images = [
        cv2.warpAffine(image, cv2.getRotationMatrix2D((width / 2, height / 2), -turn, 1.0), (width, height))
        for (image, _), turn in zip(episode, turns, strict=True)
    ]
    tracker = trackers.make("khan2011", seed=seed)
    assert isinstance(tracker, Khan2011)
    tracker.init(images[0], episode[0][1].box)
    angles: list[float] = []
    shown = int(turns.argmax())
    figure, axes = plt.subplots(1, 3, figsize=(11.0, 3.6), layout="constrained", width_ratios=(1, 1, 1.6))
    for index, image in enumerate(images[1:], 1):
        if index == shown:
            _draw_climb(axes[1], tracker, image, seed)
        tracker.update(image)
        angles.append(np.rad2deg(tracker._state[4]))
        if index == shown:
            _draw_areas(axes[0], tracker, image)
    axes[2].plot(turns, label="turn of the image")
    axes[2].plot(np.arange(1, len(images)), angles, label="angle of the box")
    axes[2].axvline(shown, color="0.6", linewidth=0.8)
    axes[2].set(xlabel="frame", ylabel="degrees, clockwise")
    axes[2].legend(frameon=False, fontsize=8)
    return figure


def _draw_areas(axis: plt.Axes, tracker: Khan2011, image: NDArray[np.uint8]) -> None:
    """The rotated box, its areas with the similarity of each, and the upright box that is reported."""
    state = tracker._state
    region, codes = tracker._encode(image, state[None])
    _, histograms = tracker._compare(codes, khan2011_module._to_region(state[None], region))
    similarities = np.sqrt(histograms[0] * tracker._model).sum(axis=1)
    show(axis, image, khan2011_module.upright(state[None])[0], f"areas; whole box: {similarities[0]:.2f}")
    rows, columns = tracker.params.rows, tracker.params.columns
    for area, similarity in enumerate(similarities[1:]):
        u, v = area % columns / columns - 0.5, area // columns / rows - 0.5
        corners = np.array([[u, v], [u + 1 / columns, v], [u + 1 / columns, v + 1 / rows], [u, v + 1 / rows]])
        axis.add_patch(Polygon(_placed(corners, state), fill=False, edgecolor="yellow", linewidth=1.2))
        beside = np.array([[-0.6 if u < -0.25 else 0.6, v + 0.5 / rows]])
        (x, y), side = _placed(beside, state)[0], "right" if u < -0.25 else "left"
        axis.text(x, y, f"{similarity:.2f}", color="yellow", ha=side, va="center")


def _placed(points: NDArray[np.float64], state: NDArray[np.float64]) -> NDArray[np.float64]:
    """`(N, 2)` places on the image of points in shares of a `(5,)` rotated box, from its centre."""
    u, v = (points * state[2:4]).T
    cosine, sine = np.cos(state[4]), np.sin(state[4])
    return np.column_stack([u * cosine - v * sine, u * sine + v * cosine]) + state[:2] - 0.5


def _draw_climb(axis: plt.Axes, tracker: Khan2011, image: NDArray[np.uint8], seed: int) -> None:
    """Particles around the last box, and where mean shift takes their centres."""
    p, state = tracker.params, tracker._state
    sigma = np.sqrt(state[2] * state[3]) * p.sigma_centre
    starts = np.tile(state, (p.particle_count, 1))
    starts[:, :2] += sigma * np.random.default_rng(seed).standard_normal((p.particle_count, 2))
    region, codes = tracker._encode(image, starts)
    local = khan2011_module._to_region(starts, region)
    climbed = khan2011_module.mean_shift(
        codes, local, tracker._partition, tracker._model, p.iteration_count, p.shape_gain
    )
    ends = khan2011_module._to_image(climbed, region)
    show(axis, image, khan2011_module.upright(state[None])[0], f"{p.particle_count} particles climb")
    for start, end in zip(starts[:, :2] - 0.5, ends[:, :2] - 0.5, strict=True):
        axis.plot(*zip(start, end, strict=True), color="yellow", linewidth=0.7)
    axis.scatter(*(starts[:, :2] - 0.5).T, s=6, color="tab:red", linewidths=0)
    axis.scatter(*(ends[:, :2] - 0.5).T, s=6, color="yellow", linewidths=0)


def chau2011(seed: int) -> plt.Figure:
    """Detections, tracks and the target's track before, during and after a cover, and its similarities over time."""
    with Simulation(scenario.load("plaza-walk", dict(CROWD))) as simulation:
        shown = list(detected(simulated(simulation, seed), simulation.scenario.resolve(seed), seed))
    tracker = trackers.make("chau2011")
    assert isinstance(tracker, trackers.FollowedPerson)
    tracks: list[TrackedBoxes] = []
    for index, sample in enumerate(shown):
        assert sample.detections is not None
        tracker.receive_detections(sample.detections)
        tracker.init(sample.image, sample.true_box) if index == 0 else tracker.update(sample.image)
        assert tracker.tracks is not None
        tracks.append(tracker.tracks)
    figure, axes = plt.subplot_mosaic("abc;ddd", figsize=(11.0, 5.4), height_ratios=(3, 2), layout="constrained")
    chosen = np.linspace(len(shown) // 3, len(shown) - 1, 3).astype(int).tolist()
    colours = plt.get_cmap("tab20").colors
    for axis, index in zip("abc", chosen, strict=True):
        axes[axis].imshow(shown[index].image)
        for box in shown[index].detections.boxes:
            outline(axes[axis], box, "white")
        for identity, box in zip(tracks[index].identities.tolist(), tracks[index].boxes, strict=True):
            outline(axes[axis], box, colours[identity % 20])
            axes[axis].text(box[0], box[1] - 3, identity, color=colours[identity % 20], fontsize=8)
        axes[axis].set_title(f"frame {index}: detections (white) and tracks")
        axes[axis].set_axis_off()
    for index, found in enumerate(tracks):
        for identity in found.identities.tolist():
            axes["d"].plot(index, identity, "s", markersize=3, color=colours[identity % 20])
    axes["d"].set(xlabel="frame", ylabel="identity", title="frames in which each track has a box")
    return figure


PICTURES = {one.__name__: one for one in (yang2005, deguchi2004, islam2009, klein2010, sidibe2010, khan2011, chau2011)}


def main() -> None:
    """Draw one of the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=sorted(PICTURES))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", required=True)
    given = parser.parse_args()
    PICTURES[given.what](given.seed).savefig(given.out, dpi=90)


if __name__ == "__main__":
    main()
