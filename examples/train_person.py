"""Train the network by which `pftrack` knows people: where in a box a person is, how much can be seen, and who it is.

    pip install 'pftrack-sim[learn]'
    python examples/train_person.py --seeds 200:213 --steps 4700 --out person.onnx
    python examples/train_person.py --seeds 200:213 --steps 2000 --identities-of person.onnx --out mine.onnx

The simulator knows the box, the identity, the cover and every pixel of all people it draws. Boxes are displaced and
scaled at random, and the network learns by how much (a regression, as in Ren et al. 2015), which share of the person
can be seen, and vectors that are alike for views of one person and unlike for others of the same scene (Khosla et al.
2020, "Supervised contrastive learning", eq. 2). Half of these views have the background of another crop, so that a
vector says who somebody is and not where. The second command trains the layer of the identities alone, and leaves what
is said of boxes as it is. It trains on a GPU where PyTorch finds one.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import numpy_helper
from torch import nn
from torch.nn import functional

from pftrack_sim.core.records import Frame
from pftrack_sim.core.types import FloatArray
from pftrack_sim.scenario import load, names
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.trackers.recognition.person import COLUMNS, REACH, ROWS
from pftrack_sim.truth.silhouettes import Silhouette

RATE_HZ, FRAMES = 2.0, 40  # Frames of an episode: few, so that a person is seen in many poses
LEFT_OUT = ("lee2012", "kwon2005", "objects")  # Suites of papers, which are not trained on, and of things
CROP, CROP_REACH = (144, 72), 2.7  # Rows and columns of a stored crop, and its height in heights of the box
HEIGHT_PX = CROP[0] / CROP_REACH  # Of the box in a crop
MIN_HEIGHT_PX, MAX_TRUNCATION = 16.0, 0.1
ASPECT = 0.33  # Width over height of a person's box, on average
SEEN, PLAIN = 0.4, 0.6  # Least visible share of a person whose box is learnt, and whose identity is
EPISODES, PEOPLE, VIEWS, BOXES, GROUNDS = 16, 6, 4, 256, 64  # Of a batch: identities, displaced boxes, and background
TEMPERATURE = 0.035  # Low, so that those who resemble each other most count most
RATE = 2e-3  # Of learning
ELSEWHERE = 0.5  # Share of the views of an identity that are put before another background


class Crop(NamedTuple):
    """A crop around a box, and the truth of it; `person` is the index of the person in the episode, -1: background.

    The fourth channel of its pixels is 255 where the person can be seen.
    """

    pixels: NDArray[np.uint8]
    episode: int
    person: int
    visible: float
    aspect: float


def draw(seeds: range) -> list[Crop]:
    """Crops of all people in all scenarios, and some of what is no person."""
    jobs = [(name, seed) for seed in seeds for name in names() if not name.startswith(LEFT_OUT)]
    crops: list[Crop] = []
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for done, found in enumerate(pool.map(draw_episode, range(len(jobs)), *zip(*jobs, strict=True)), 1):
            crops += found
            print(f"\r{done} of {len(jobs)} episodes, {len(crops)} crops", end="", flush=True)
    print()
    return crops


def draw_episode(episode: int, name: str, seed: int) -> list[Crop]:
    """The crops of one episode of a scenario."""
    width, height = (640, 480) if episode % 3 == 0 else (320, 240)
    size = {"camera.rate_hz": RATE_HZ, "camera.width_px": width, "camera.height_px": height}
    simulation = Simulation(load(name, size))
    rng = np.random.default_rng([seed, episode])
    frame = simulation.reset(seed)
    crops: list[Crop] = []
    people: dict[str, int] = {}
    for index in range(min(simulation.frame_count, FRAMES)):
        frame = frame if index == 0 else simulation.advance()
        silhouettes = simulation.silhouettes
        for person in frame.people:
            x, y, w, h = person.amodal_box
            if h >= MIN_HEIGHT_PX and person.truncation < MAX_TRUNCATION:
                number = people.setdefault(person.name, len(people))
                pixels = _cut(_with_mask(frame.image, silhouettes.get(person.name)), x + w / 2, y + h / 2, h)
                crops.append(Crop(pixels, episode, number, person.visible_fraction, w / h))
        if index % 2 == 0 and (place := _background(frame, rng)) is not None:
            crops.append(Crop(_cut(_with_mask(frame.image, None), *place), episode, -1, 0.0, ASPECT))
    simulation.close()
    return crops


def _with_mask(image: NDArray[np.uint8], silhouette: Silhouette | None) -> NDArray[np.uint8]:
    mask = np.zeros((*image.shape[:2], 1), dtype=np.uint8)
    if silhouette is not None:
        mask[silhouette.rect.slices] = 255 * silhouette.visible[:, :, None]
    return np.concatenate([image, mask], axis=2)


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


def _cut(image: NDArray[np.uint8], x: float, y: float, height: float) -> NDArray[np.uint8]:
    step = height / HEIGHT_PX
    if step > 5 / 3:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), 0.45 * step), dtype=np.uint8)
    crop = np.empty((*CROP, image.shape[2]), dtype=np.uint8)
    _sample(image, x - 0.5, y - 0.5, step, step, crop)
    return crop


def _sample(pixels: NDArray[np.uint8], x: float, y: float, across: float, down: float, out: NDArray[np.uint8]) -> None:
    """Fill a patch around `x`, `y`, whose pixels are `across` and `down` apart; right to left where `across` < 0."""
    rows, columns = out.shape[:2]
    matrix = np.array([[across, 0.0, x - across * (columns - 1) / 2], [0.0, down, y - down * (rows - 1) / 2]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    cv2.warpAffine(pixels, matrix, (columns, rows), dst=out, flags=flags, borderMode=cv2.BORDER_REPLICATE)


class Network(nn.Module):
    """Six convolutions; from them a vector for the identity, and shift, growth, aspect, visibility and person."""

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for inputs, outputs, step in ((3, 16, 2), (16, 32, 2), (32, 48, 2), (48, 48, 1), (48, 64, 2), (64, 64, 1)):
            layers += [nn.Conv2d(inputs, outputs, 3, step, 1, bias=False), nn.BatchNorm2d(outputs), nn.ReLU()]
        self.features = nn.Sequential(*layers)
        cells = 64 * -(-ROWS // 16) * -(-COLUMNS // 16)
        self.embedding = nn.Linear(cells, 32)
        self.box = nn.Sequential(nn.Linear(cells, 56), nn.ReLU(), nn.Linear(56, 6))

    def forward(self, patches: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """`(N, 3, ROWS, COLUMNS)` patches in [0, 1] -> `(N, 32)` vectors and `(N, 6)` numbers."""
        found = self.features(patches - 0.5).flatten(1)
        return self.embedding(found), self.box(found)


def read(file: str) -> Network:
    """A network that was written; its normalisations are in the weights of its convolutions."""
    network, graph = Network(), onnx.load(file).graph
    stored = {one.name: torch.from_numpy(numpy_helper.to_array(one).copy()) for one in graph.initializer}
    network.load_state_dict({name: values for name, values in stored.items() if "::" not in name}, strict=False)
    weights = [node.input[1:] for node in graph.node if node.op_type == "Conv"]
    for (weight, bias), layer in zip(weights, range(0, len(network.features), 3), strict=True):
        network.features[layer].weight.data = stored[weight]
        normalisation = network.features[layer + 1]
        normalisation.bias.data = stored[bias]
        normalisation.running_var.fill_(1.0 - normalisation.eps)
    return network.eval()


class Patches:
    """Patches of crops under other light, and the displacements of their boxes, on one device."""

    def __init__(self, crops: list[Crop], rng: np.random.Generator, device: torch.device) -> None:
        self.rng, self.device = rng, device
        self.pixels = [crop.pixels for crop in crops]
        self.visible = np.array([crop.visible for crop in crops])
        self.aspect = np.array([crop.aspect for crop in crops])
        background = np.array([crop.person < 0 for crop in crops])
        self.people, self.grounds = np.flatnonzero(~background), np.flatnonzero(background)
        views: dict[tuple[int, int], list[int]] = {}
        for index in self.people.tolist():
            if self.visible[index] > PLAIN:
                views.setdefault((crops[index].episode, crops[index].person), []).append(index)
        self.views = [np.array(found) for found in views.values() if len(found) >= VIEWS]
        episodes: dict[int, list[int]] = {}
        for identity, found in enumerate(self.views):
            episodes.setdefault(crops[int(found[0])].episode, []).append(identity)
        self.episodes = [np.array(found) for found in episodes.values()]

    def patches(
        self, places: NDArray[np.intp], moved: FloatArray, flipped: NDArray[np.bool_], elsewhere: float = 0.0
    ) -> torch.Tensor:
        """`(N, 3, ROWS, COLUMNS)` patches of boxes around the crops at `(N,)` places.

        The boxes are `moved` `(N, 3)` right and down by heights of the person, and grown by a logarithm. A share
        `elsewhere` of them, chosen at random, has another background.
        """
        patches = self._drawn(places, moved, flipped)
        if put := round(elsewhere * len(places)):
            some = self.rng.permutation(len(places))[:put]
            behind = self._drawn(self.rng.choice(self.grounds, put), moved[some], flipped[some])
            person = patches[some, :, :, 3:] / np.float32(255)
            patches[some] = np.rint(behind + person * (patches[some] - behind.astype(np.float32)))
        drawn = torch.from_numpy(patches[..., :3]).to(self.device).permute(0, 3, 1, 2).float() / 255
        one = (len(places), 1, 1, 1)
        light, tint, lift = self._normal(one, 0.18), self._normal((len(places), 3, 1, 1), 0.05), self._normal(one, 0.03)
        drawn = drawn * torch.exp(light + tint) + lift
        blurred = torch.from_numpy(np.flatnonzero(self.rng.random(len(places)) < 0.4)).to(self.device)
        drawn[blurred] = _blur(drawn[blurred], float(self.rng.uniform(0.4, 1.4)))
        noise = torch.from_numpy(self.rng.uniform(0, 0.04, one).astype(np.float32)).to(self.device)
        return (drawn + noise * torch.randn_like(drawn)).clamp(0, 1)

    def _drawn(self, places: NDArray[np.intp], moved: FloatArray, flipped: NDArray[np.bool_]) -> NDArray[np.uint8]:
        """`(N, ROWS, COLUMNS, 4)` what boxes hold that are moved from the crops at `(N,)` places."""
        patches = np.empty((len(places), ROWS, COLUMNS, 4), dtype=np.uint8)
        for place, (right, down, growth), flip, out in zip(places, moved, flipped, patches, strict=True):
            x, y = HEIGHT_PX * right + (CROP[1] - 1) / 2, HEIGHT_PX * down + (CROP[0] - 1) / 2
            step = REACH * HEIGHT_PX * float(np.exp(growth)) / ROWS
            _sample(self.pixels[place], x, y, -step if flip else step, step, out)
        return patches

    def batch(self) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        """Views of people and whose they are, displaced boxes and what is to be said of them."""
        return *self.identities(), *self.boxes()

    def identities(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Views of people of some episodes, nearly in the middle, and whose they are."""
        rng = self.rng
        chosen = [self.episodes[place] for place in rng.permutation(len(self.episodes))[:EPISODES]]
        whose = np.concatenate([rng.permutation(identities)[:PEOPLE] for identities in chosen])
        places = np.concatenate([rng.permutation(self.views[identity])[:VIEWS] for identity in whose])
        moved = rng.normal(0, (0.015, 0.025, 0.05), (len(places), 3))
        views = self.patches(places, moved, rng.random(len(places)) < 0.5, ELSEWHERE)
        return views, torch.from_numpy(np.repeat(whose, VIEWS))

    def boxes(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Displaced boxes, and what is to be said of each: four numbers, the visible share, person (or NaN)."""
        rng = self.rng
        places = np.concatenate([rng.choice(self.people, BOXES), rng.choice(self.grounds, GROUNDS)])
        flipped = rng.random(len(places)) < 0.5
        far = np.where(rng.random((len(places), 1)) < 0.35, 0.12, 0.35)
        moved = np.clip(rng.normal(0, far, (len(places), 3)) * (0.35, 0.6, 1.0), -0.6, 0.6)
        right, down, growth = moved.T
        visible, in_box = self.visible[places], np.exp(-growth)
        person = (visible > 0.3) & (np.abs(right) < 0.25) & (np.abs(down) < 0.35)
        unsaid = ~person & (visible >= 0.05)
        sideways = np.where(flipped, right, -right)
        shape = np.log(self.aspect[places] / ASPECT)
        said = np.where(unsaid, np.nan, person)
        wanted = np.stack([sideways * in_box, -down * in_box, -growth, shape, visible, said], axis=1)
        return self.patches(places, moved, flipped), torch.from_numpy(wanted.astype(np.float32))

    def _normal(self, shape: tuple[int, ...], deviation: float) -> torch.Tensor:
        return torch.from_numpy(self.rng.normal(0, deviation, shape).astype(np.float32)).to(self.device)


def _blur(pixels: torch.Tensor, sigma: float) -> torch.Tensor:
    weights = np.exp(-0.5 * (np.arange(-4, 5) / sigma) ** 2)
    row = torch.tensor(weights / weights.sum(), dtype=torch.float32, device=pixels.device).expand(3, 1, 1, 9)
    padded = functional.pad(pixels, (4, 4, 4, 4), mode="replicate")
    return functional.conv2d(functional.conv2d(padded, row, groups=3), row.transpose(2, 3), groups=3)


def contrast(vectors: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """Loss of vectors that are not alike where the labels are the same, or are where they are not."""
    unit = functional.normalize(vectors)
    itself = torch.eye(len(unit), dtype=torch.bool, device=unit.device)
    alike = (unit @ unit.T / TEMPERATURE).masked_fill(itself, -1e4)
    same = (labels[:, None] == labels[None]) & ~itself
    shares = alike - torch.logsumexp(alike, 1, keepdim=True)
    return -((shares * same).sum(1) / same.sum(1)).mean()


def misplacement(numbers: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
    """Loss of shift, growth and aspect where a person can be seen, of the visible share, and of person."""
    weights = torch.tensor([3.0, 1.5, 1.5, 0.5], device=numbers.device)
    seen = (wanted[:, 4] > SEEN).float()[:, None]
    errors = functional.smooth_l1_loss(numbers[:, :4], wanted[:, :4], reduction="none", beta=0.05)
    visible = functional.binary_cross_entropy_with_logits(numbers[:, 4], wanted[:, 4])
    said = ~wanted[:, 5].isnan()
    person = functional.binary_cross_entropy_with_logits(numbers[said, 5], wanted[said, 5])
    return 4.0 * (errors * weights * seen).sum() / seen.sum() + 0.5 * visible + 0.5 * person


def train(crops: list[Crop], steps: int, known: Network | None) -> Network:
    """Train for so many steps, with a rate of learning that falls to nothing; of a known network the identities."""
    torch.manual_seed(0)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network, patches = (known or Network()).to(device), Patches(crops, np.random.default_rng(0), device)
    learnt = network.embedding if known else network
    network.requires_grad_(requires_grad=False)
    learnt.requires_grad_()
    optimiser = torch.optim.AdamW(learnt.parameters(), RATE, weight_decay=1e-3)
    torch.set_num_threads(max(1, torch.get_num_threads() - 1))  # One draws the next batch
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(patches.batch)
        for step in range(steps):
            for group in optimiser.param_groups:
                group["lr"] = RATE * min(1.0, step / 100) * (0.5 + 0.5 * float(np.cos(np.pi * step / steps)) + 0.01)
            views, labels, boxes, wanted = coming.result()
            coming = pool.submit(patches.batch)
            with torch.autocast(device.type, torch.bfloat16):
                vectors, numbers = (found.float() for found in network(torch.cat([views, boxes])))
            loss = contrast(vectors[: len(views)], labels.to(device))
            if known is None:
                loss = loss + misplacement(numbers[len(views) :], wanted.to(device))
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            if step % 20 == 0:
                print(f"\rstep {step} of {steps}, loss {loss.item():.3f}", end="", flush=True)
    print()
    return network.cpu().eval()


def main() -> None:
    """Draw, train, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="200:213", help="FIRST:END of the scenarios' seeds")
    parser.add_argument("--steps", type=int, default=4700, help="of training")
    parser.add_argument("--identities-of", metavar="FILE", help="train only the identities of this network")
    parser.add_argument("--out", default="person.onnx")
    given = parser.parse_args()
    first, end = (int(part) for part in given.seeds.split(":"))
    if given.identities_of and not Path(given.identities_of).is_file():
        parser.error(f"no such file: {given.identities_of}")
    known = read(given.identities_of) if given.identities_of else None
    network = train(draw(range(first, end)), given.steps, known)
    sample = torch.zeros(1, 3, ROWS, COLUMNS)
    outputs = ["embedding", "box"]
    torch.onnx.export(network, (sample,), given.out, input_names=["patch"], output_names=outputs, dynamo=False)
    print(f"written: {given.out}")


if __name__ == "__main__":
    main()
