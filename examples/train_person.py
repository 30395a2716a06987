"""Train the network by which `pftrack` knows people: where in a box a person is, how much can be seen, and who it is.

    pip install 'pftrack-sim[learn]'
    python examples/train_person.py --seeds 200:208 --minutes 10 --out person.onnx

The simulator knows the box, the identity and the cover of every person it draws. Boxes are displaced and scaled at
random, and the network learns by how much (a regression, as in Ren et al. 2015), which share of the person can be seen,
and vectors that are alike for views of one person and unlike for others of the same scene (Khosla et al. 2020,
"Supervised contrastive learning", eq. 2). A quarter of an hour on two cores draws the crops.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from typing import NamedTuple

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional

from pftrack_sim.core.records import Frame
from pftrack_sim.scenario import load, names
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.recognition.person import COLUMNS, REACH, ROWS

RATE_HZ, FRAMES = 2.0, 40  # Frames of an episode: few, so that a person is seen in many poses
LEFT_OUT = ("lee2012", "kwon2005")  # Suites of papers, which are not trained on
CROP, CROP_REACH = (144, 72), 2.7  # Rows and columns of a stored crop, and its height in heights of the box
HEIGHT_PX = CROP[0] / CROP_REACH  # Of the box in a crop
MIN_HEIGHT_PX, MAX_TRUNCATION = 16.0, 0.1
ASPECT = 0.33  # Width over height of a person's box, on average
SEEN, PLAIN = 0.4, 0.6  # Least visible share of a person whose box is learnt, and whose identity is
EPISODES, PEOPLE, VIEWS, BOXES, GROUNDS = 10, 3, 3, 96, 24  # Of a batch: identities, displaced boxes, and background
TEMPERATURE = 0.08
RATE = 2e-3  # Of learning


class Crop(NamedTuple):
    """A crop around a box, and what is true of it; `identity` is -1 where there is no person."""

    pixels: NDArray[np.uint8]
    identity: int
    episode: int
    visible: float
    aspect: float


def draw(seeds: range) -> list[Crop]:
    """Crops of all people in all scenarios, and some of what is no person."""
    crops: list[Crop] = []
    identities: dict[tuple[int, str], int] = {}
    jobs = [(name, seed) for seed in seeds for name in names() if not name.startswith(LEFT_OUT)]
    for episode, (name, seed) in enumerate(jobs):
        width, height = (640, 480) if episode % 3 == 0 else (320, 240)
        size = {"camera.rate_hz": RATE_HZ, "camera.width_px": width, "camera.height_px": height}
        simulation = Simulation(load(name, size))
        rng = np.random.default_rng([seed, episode])
        frame = simulation.reset(seed)
        for index in range(min(simulation.frame_count, FRAMES)):
            frame = frame if index == 0 else simulation.advance()
            for person in frame.people:
                x, y, w, h = person.amodal_box
                if h >= MIN_HEIGHT_PX and person.truncation < MAX_TRUNCATION:
                    identity = identities.setdefault((episode, person.name), len(identities))
                    pixels = _cut(frame, x + w / 2, y + h / 2, h)
                    crops.append(Crop(pixels, identity, episode, person.visible_fraction, w / h))
            if index % 2 == 0 and (place := _background(frame, rng)) is not None:
                crops.append(Crop(_cut(frame, *place), -1, episode, 0.0, ASPECT))
        simulation.close()
        print(f"\r{episode + 1} of {len(jobs)} episodes, {len(crops)} crops", end="", flush=True)
    print()
    return crops


def _background(frame: Frame, rng: np.random.Generator) -> tuple[float, float, float] | None:
    """Centre and height [px] of a box that touches no person; None where the one tried does."""
    rows, columns = frame.image.shape[:2]
    height = float(rng.uniform(0.1, 0.6)) * rows
    x, y = float(rng.uniform(0, columns)), float(rng.uniform(0, rows))
    for person in frame.people:
        left, top, w, h = person.amodal_box
        if abs(x - left - w / 2) < (w + ASPECT * height) / 2 and abs(y - top - h / 2) < (h + height) / 2:
            return None
    return x, y, height


def _cut(frame: Frame, x: float, y: float, height: float) -> NDArray[np.uint8]:
    zoom = HEIGHT_PX / height
    image = cv2.GaussianBlur(frame.image, (0, 0), 0.45 / zoom) if zoom < 0.6 else frame.image
    return np.asarray(_warped(image, zoom, (x, y), CROP, 0), dtype=np.uint8)


def _warped(
    image: NDArray[np.uint8], zoom: float, centre: tuple[float, float], shape: tuple[int, int], flip: bool
) -> NDArray[np.uint8]:
    """The part around a centre x, y [px of the image], magnified, as an image of `shape`."""
    rows, columns = shape
    step = 1.0 / zoom
    across = -step if flip else step
    x, y = centre
    matrix = np.array(
        [[across, 0.0, x - 0.5 - across * (columns - 1) / 2], [0.0, step, y - 0.5 - step * (rows - 1) / 2]]
    )
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    out = cv2.warpAffine(image, matrix, (columns, rows), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(out, dtype=np.uint8)


class Network(nn.Module):
    """Four convolutions; from them a vector for the identity, and shift, growth, aspect, visibility and person."""

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for inputs, outputs in ((3, 16), (16, 32), (32, 48), (48, 64)):
            layers += [nn.Conv2d(inputs, outputs, 3, 2, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()]
        self.features = nn.Sequential(*layers)
        cells = 64 * -(-ROWS // 16) * -(-COLUMNS // 16)
        self.embedding = nn.Linear(cells, 32)
        self.box = nn.Sequential(nn.Linear(cells, 96), nn.ReLU(), nn.Linear(96, 6))

    def forward(self, patches: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """`(N, 3, ROWS, COLUMNS)` patches in [0, 1] -> `(N, 32)` vectors and `(N, 6)` numbers."""
        found = self.features(patches - 0.5).flatten(1)
        return self.embedding(found), self.box(found)


class Patches:
    """Patches of crops under other light, and the displacements of their boxes."""

    def __init__(self, crops: list[Crop], rng: np.random.Generator) -> None:
        self.rng = rng
        self.crops = crops
        self.people = [crop for crop in crops if crop.identity >= 0]
        self.grounds = [crop for crop in crops if crop.identity < 0]
        views: dict[int, list[Crop]] = defaultdict(list)
        for crop in self.people:
            if crop.visible > PLAIN:
                views[crop.identity].append(crop)
        self.episodes: dict[int, list[list[Crop]]] = defaultdict(list)
        for found in views.values():
            if len(found) >= VIEWS:
                self.episodes[found[0].episode].append(found)

    def patch(self, crop: Crop, right: float, down: float, growth: float, flip: bool) -> NDArray[np.float32]:
        """The patch of a box displaced by heights of the person, and exp(growth) times as high."""
        rng = self.rng
        zoom = ROWS / (REACH * HEIGHT_PX * np.exp(growth))
        centre = (CROP[1] / 2 + right * HEIGHT_PX, CROP[0] / 2 + down * HEIGHT_PX)
        pixels = _warped(crop.pixels, float(zoom), centre, (ROWS, COLUMNS), flip).astype(np.float32) / 255
        pixels = pixels * np.exp(rng.normal(0, 0.18)) * np.exp(rng.normal(0, 0.05, 3)) + rng.normal(0, 0.03)
        if rng.random() < 0.4:
            pixels = cv2.GaussianBlur(pixels, (0, 0), float(rng.uniform(0.4, 1.4)))
        return np.clip(pixels + rng.normal(0, rng.uniform(0, 0.04), pixels.shape), 0, 1).astype(np.float32)

    def identities(self) -> tuple[list[NDArray[np.float32]], list[int]]:
        """Views of people of some episodes, nearly in the middle, and whose they are."""
        rng = self.rng
        patches: list[NDArray[np.float32]] = []
        labels: list[int] = []
        for episode in rng.choice(list(self.episodes), EPISODES, replace=False):
            people = self.episodes[int(episode)]
            for place in rng.permutation(len(people))[:PEOPLE]:
                for view in rng.choice(len(people[place]), VIEWS, replace=False):
                    crop = people[place][view]
                    displaced = rng.normal(0, (0.015, 0.025, 0.05))
                    patches.append(self.patch(crop, *displaced.tolist(), flip=bool(rng.random() < 0.5)))
                    labels.append(crop.identity)
        return patches, labels

    def boxes(self) -> tuple[list[NDArray[np.float32]], list[list[float]]]:
        """Displaced boxes, and what is to be said of each: four numbers, the visible share, person (or NaN)."""
        rng = self.rng
        patches: list[NDArray[np.float32]] = []
        wanted: list[list[float]] = []
        for place in rng.choice(len(self.people), BOXES):
            crop, flip = self.people[place], bool(rng.random() < 0.5)
            far = 0.12 if rng.random() < 0.35 else 0.35
            right, down, growth = np.clip(rng.normal(0, far, 3) * (0.35, 0.6, 1.0), -0.6, 0.6).tolist()
            patches.append(self.patch(crop, right, down, growth, flip))
            in_box = np.exp(-growth)
            person = float(crop.visible > 0.3 and abs(right) < 0.25 and abs(down) < 0.35)
            unsaid = not person and crop.visible >= 0.05
            shift = [(right if flip else -right) * in_box, -down * in_box, -growth, float(np.log(crop.aspect / ASPECT))]
            wanted.append([*shift, crop.visible, np.nan if unsaid else person])
        for place in rng.choice(len(self.grounds), GROUNDS):
            patches.append(self.patch(self.grounds[place], 0.0, 0.0, float(rng.normal(0, 0.3)), flip=False))
            wanted.append([0.0] * 6)
        return patches, wanted


def contrast(vectors: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """Loss of vectors that are not alike where the labels are the same, or are where they are not."""
    unit = functional.normalize(vectors)
    itself = torch.eye(len(unit), dtype=torch.bool)
    alike = (unit @ unit.T / TEMPERATURE).masked_fill(itself, -1e4)
    same = (labels[:, None] == labels[None]) & ~itself
    shares = alike - torch.logsumexp(alike, 1, keepdim=True)
    return -((shares * same).sum(1) / same.sum(1)).mean()


def misplacement(numbers: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    """Loss of shift, growth and aspect where a person can be seen, of the visible share, and of person."""
    weights = torch.tensor([3.0, 1.5, 1.5, 0.5])
    seen = (wanted[:, 4] > SEEN).float()[:, None]
    errors = functional.smooth_l1_loss(numbers[:, :4], wanted[:, :4], reduction="none", beta=0.05)
    visible = functional.binary_cross_entropy_with_logits(numbers[:, 4], wanted[:, 4])
    said = ~wanted[:, 5].isnan()
    person = functional.binary_cross_entropy_with_logits(numbers[said, 5], wanted[said, 5])
    return 4.0 * (errors * weights * seen).sum() / seen.sum() + 0.5 * visible + 0.5 * person


def train(crops: list[Crop], minutes: float) -> Network:
    """Train for a time, with a rate of learning that falls to nothing."""
    torch.manual_seed(0)
    network, patches = Network(), Patches(crops, np.random.default_rng(0))
    optimiser = torch.optim.AdamW(network.parameters(), RATE, weight_decay=1e-3)
    began, step = time.monotonic(), 0
    while (spent := (time.monotonic() - began) / (60 * minutes)) < 1.0:
        for group in optimiser.param_groups:
            group["lr"] = RATE * min(1.0, step / 100) * (0.5 + 0.5 * float(np.cos(np.pi * spent)) + 0.01)
        views, labels = patches.identities()
        boxes, wanted = patches.boxes()
        pixels = torch.from_numpy(np.stack([*views, *boxes]).transpose(0, 3, 1, 2).copy())
        vectors, numbers = network(pixels)
        loss = contrast(vectors[: len(views)], torch.tensor(labels))
        loss = loss + misplacement(numbers[len(views) :], torch.tensor(wanted, dtype=torch.float32))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        step += 1
        if step % 20 == 0:
            print(f"\rstep {step}, {spent:.0%}, loss {loss.item():.3f}", end="", flush=True)
    print()
    return network.eval()


def main() -> None:
    """Draw, train, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="200:208", help="FIRST:END of the scenarios' seeds")
    parser.add_argument("--minutes", type=float, default=10.0, help="of training")
    parser.add_argument("--out", default="person.onnx")
    given = parser.parse_args()
    first, end = (int(part) for part in given.seeds.split(":"))
    network = train(draw(range(first, end)), given.minutes)
    sample = torch.zeros(1, 3, ROWS, COLUMNS)
    outputs = ["embedding", "box"]
    torch.onnx.export(network, (sample,), given.out, input_names=["patch"], output_names=outputs, dynamo=False)
    print(f"written: {given.out}")


if __name__ == "__main__":
    main()
