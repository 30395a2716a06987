"""How far the truth of partly hidden targets is from a segmentation of its own for every row, 81 times finer.

    PYTHONPATH=.:tests python -m tests.attack.exactness [FRAMES] [FIRST_SEED]

Rolling shutter, lens, shake, lost frames and occluders at once. Every third frame in which the target is partly hidden
is compared, at most 30 of an episode. Edges are those of the visible box, in pixels.
"""

import sys
from collections.abc import Iterator, Sequence
from itertools import count, zip_longest
from unittest.mock import patch

import numpy as np

from pftrack_sim import scenario
from pftrack_sim.core.records import Truth
from pftrack_sim.render.capture.frame_capture import CapturedFrame
from pftrack_sim.render.segmentation import Segmenter
from pftrack_sim.scene.layout import body_owners
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.truth.observer import TruthObserver
from tests.observing import box_of
from tests.render_stage import HEIGHT, WIDTH
from tests.truth.test_truth_exactness import pixels_by_rows

NAMES = ("warehouse", "station", "corridor", "hall", "hard/plaza", "hard/street", "plaza-walk", "park", "real/market")
AXES = {"rolling_shutter": 2.0, "jitter": 2.0, "distortion": 1.0, "stream": 1.0, "occlusion": 2.0}
SIZE = {"camera.width_px": WIDTH, "camera.height_px": HEIGHT, "lights.shadows": False, "axes.blur.severity": 0.0}
MOST, EVERY = 30, 3


def compared(name: str, seed: int) -> Iterator[tuple[float, float, float, bool]]:
    """Of each frame: edges and shares that differ from the reference, its pixels, and whether edges are explained.

    An edge is explained where its pixels are of the target within 0.13 px of their centres.
    """
    taken: list[CapturedFrame] = []
    observe = TruthObserver.observe_captured

    def kept(self: TruthObserver, captured: CapturedFrame, *more: object) -> Sequence[Truth]:
        taken[:] = [captured]
        return observe(self, captured, *more)

    axes = {f"axes.{axis}.severity": severity for axis, severity in AXES.items()}
    loaded = scenario.load(name, SIZE | axes)
    with patch.object(TruthObserver, "observe_captured", kept), Simulation(loaded, image=False) as simulation:
        simulation.reset(seed)
        segmenter = Segmenter(simulation.world.model)
        owners = np.array([one == "target" for one in body_owners(simulation.world.model)])
        own = owners[simulation.world.model.geom_bodyid] & segmenter.drawn
        hidden = 0
        for _ in range(loaded.frame_count(seed) - 1):
            truth = simulation.advance().truth
            hidden += 0.0 < truth.visible_fraction < 1.0
            if not 0.0 < truth.visible_fraction < 1.0 or hidden % EVERY or hidden > MOST * EVERY:
                continue
            silhouette = simulation.silhouettes["target"]
            seen = np.zeros((HEIGHT, WIDTH), dtype=bool)
            seen[silhouette.rect.slices] = silhouette.visible
            exact, somewhere, everywhere, whole = pixels_by_rows(taken[-1], segmenter, own, silhouette.rect)
            box, reference = box_of(seen), box_of(exact)
            ends = [np.append(one[:2], one[:2] + one[2:]) for one in (box, reference)]
            explained = not (seen & ~somewhere).any() and not (everywhere & ~seen).any()
            off = abs(truth.visible_fraction - exact.sum() / whole.sum())
            yield float(np.abs(ends[0] - ends[1]).max()), off, float(whole.sum()), explained


def main() -> None:
    wanted, first = (int(given or usual) for given, usual in zip_longest(sys.argv[1:3], ("1000", "0")))
    rows: list[tuple[float, float, float, bool]] = []
    for seed in count(first):
        for name in NAMES:
            rows += compared(name, seed)
        table = np.array(rows)
        lines = [f"seeds {first} to {seed}: {len(rows)} frames"]
        for what, values in (("edge of the visible box [px]", table[:, 0]), ("visible fraction", table[:, 1])):
            marks = np.round(np.nanquantile(values, (0.5, 0.9, 0.99, 1.0)), 4)
            lines.append(f"  {what}: median, 90 %, 99 %, worst {marks}")
        lines.append(f"  edges off by more than half a pixel: {(table[:, 0] > 0.5).sum()}")
        lines.append(f"  visible in one of the two only: {np.isnan(table[:, 0]).sum()}")
        lines.append(f"  not explained by 0.13 px: {(table[:, 3] == 0).sum()}")
        print("\n".join(lines), flush=True)  # noqa: T201
        if len(rows) >= wanted:
            return


if __name__ == "__main__":
    main()
