"""Pictures of the methods of docs/papers/relatives.md at work, on an episode of the simulator.

    python examples/relatives_pictures.py yang2005 --out yang2005.png

Each function of `PICTURES` draws one method, from what its tracker computes itself.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from paper_evidence import SMALL, frames

from pftrack_sim import scenario, trackers
from pftrack_sim.benchmark.rollout import detected, simulated
from pftrack_sim.core import boxes
from pftrack_sim.core.records import Estimate, TrackedBoxes
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.relatives.islam2009 import SHAPE, Islam2009
from pftrack_sim.trackers.relatives.yang2005 import STAGES, Yang2005

WALK: Mapping[str, Any] = MappingProxyType({**SMALL, "duration_s": 2.0})
CROWD: Mapping[str, Any] = MappingProxyType(
    {**SMALL, "duration_s": 3.0, "camera.rate_hz": 15.0, "axes.detector.severity": 1.0, "axes.detector.height_px": 20.0}
)
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


def outline(axis: plt.Axes, box: NDArray[np.float64], colour: str) -> None:
    """A `(4,)` box [px] on an image."""
    x, y, w, h = box
    # Pixel centres lie at whole numbers in matplotlib and at halves in boxes.
    axis.add_patch(Rectangle((x - 0.5, y - 0.5), w, h, fill=False, edgecolor=colour, linewidth=1.5))


def yang2005(seed: int) -> plt.Figure:
    """The particles of one frame by the last stage that observed them."""
    episode = list(frames("plaza-walk", seed, WALK))
    tracker, found = follow("yang2005", episode, seed)
    assert isinstance(tracker, Yang2005)
    particles, last = found[-1].particles, found[-1].box
    assert particles is not None
    total, observed = tracker._observe(episode[-1][0], particles).survivors(particles)
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
    observation = tracker._observe(image, near[None])
    aside = last + np.array([0.6 * last[2], 0.0, 0.0, 0.0])
    figure, axes = plt.subplots(1, 5, figsize=(11.0, 3.2), layout="constrained", width_ratios=(2, 2, 1, 1, 1))
    show(axes[0], image, last, "frame")
    outline(axes[0], aside, "tab:red")
    axes[1].imshow(observation.seen.distances, cmap="gray")
    axes[1].set_title("distance to edges")
    for axis, box, colour in ((axes[3], last, "estimate"), (axes[4], aside, "aside (red)")):
        patch = observation.seen.shapes(box[None])[0]
        axis.imshow(patch.reshape(SHAPE), cmap="gray")
        axis.set_title(f"{colour}\ncorrelation {patch @ tracker.template.shape / patch.size:.2f}")
    axes[2].imshow(tracker.template.shape.reshape(SHAPE), cmap="gray")
    axes[2].set_title("template")
    for axis in axes:
        axis.set_axis_off()
    return figure


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


PICTURES = {"yang2005": yang2005, "deguchi2004": deguchi2004, "islam2009": islam2009, "chau2011": chau2011}


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
