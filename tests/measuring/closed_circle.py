"""Videos rendered at known levels, measured back.

`python tests/measuring/closed_circle.py` prints the table of the page of measuring: for each kind of video how often
the interval of each level holds it.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from pftrack_sim import scenario
from pftrack_sim.benchmark.running.rollout import Step, rollout, simulated
from pftrack_sim.benchmark.running.sinks import video_writer
from pftrack_sim.camera.trajectory import log_so3
from pftrack_sim.measuring.jitter import ABOVE_HZ
from pftrack_sim.measuring.material import read_material
from pftrack_sim.measuring.measured import Measured
from pftrack_sim.measuring.spectrum import rms_above, spectrum_of_turns
from pftrack_sim.measuring.video import measure_video
from pftrack_sim.simulation.simulation import Simulation

PLACES = ("corridor", "warehouse", "plaza-walk", "park", "hall")
SMALL = {"camera.width_px": 320, "camera.height_px": 240, "camera.rate_hz": 25.0, "camera.fovy_deg": 50.0}
STILL = {"robot.route": {"kind": "still"}, "robot.gaze": "forward", "jitter.angular_rms_deg": 0.0}


def shaking(rms_deg: float, seconds: float = 8.0, **more: Any) -> dict[str, Any]:
    """Settings of an episode that shakes by ground vibration alone."""
    axis = {"sources": ["ground"], "ground_rms_deg": rms_deg, "ground_rms_mm": 0.0, "severity": 1.0}
    return {**SMALL, "axes.jitter": axis, "duration_s": seconds, **more}


@dataclass(frozen=True, eq=False)
class Rendered:
    """What was rendered.

    Attributes:
        true_deg: RMS of the camera's pitch and roll above 1 Hz, by its true poses.
    """

    found: Measured
    true_deg: float

    def holds(self, name: str, level: float) -> bool | None:
        """Whether the interval of a quantity holds a level; None if the quantity was left out."""
        one = next((one for one in self.found.quantities if one.name == name), None)
        return None if one is None else one.low <= level <= one.high

    def interval(self, name: str) -> list[float]:
        """Value and ends of a quantity."""
        return [
            round(x, 4) for one in self.found.quantities if one.name == name for x in (one.value, one.low, one.high)
        ]

    def value(self, name: str) -> float:
        return next((one.value for one in self.found.quantities if one.name == name), float("nan"))


def measured_back(place: str, seed: int, settings: Mapping[str, Any], *, crf: int | None, folder: Path) -> Rendered:
    """Render an episode as images without loss, or as H.264 of a rate factor, and measure it."""
    loaded = scenario.load(place, dict(settings))
    poses: list[np.ndarray] = []
    path = folder / ("video.mp4" if crf is not None else "images")

    def run(add: Any) -> None:
        def sink(step: Step) -> None:
            sample = step.sample
            assert sample.frame is not None
            poses.append(sample.frame.truth.T_world_camera[:3, :3])
            add(sample.image, sample.time_s)

        with Simulation(loaded) as simulation:
            rollout(simulated(simulation, seed), [], [sink])

    rate = loaded.resolve(seed).camera.rate_hz
    if crf is not None:
        with video_writer(path, rate, crf) as add:
            run(add)
    else:
        path.mkdir()
        run(lambda image, time_s: cv2.imwrite(str(path / f"{round(time_s * rate) + 1:06}.png"), image[:, :, ::-1]))
    turns = log_so3(np.swapaxes(poses[:-1], 1, 2) @ np.array(poses[1:]))
    true = rms_above(spectrum_of_turns([turns], [turns], rate), ABOVE_HZ)[0].value
    found = measure_video(read_material(path, rate if crf is None else None), fovy_deg=50.0)
    return Rendered(found, true)


KINDS: Sequence[tuple[str, Mapping[str, Any], int | None]] = (
    ("robot stands, PNG", STILL, None),
    ("robot stands, H.264 of rate factor 28", STILL, 28),
    ("robot drives, H.264 of rate factor 28", {}, 28),
)


def main(repeats: int) -> None:
    """Print a row for each kind of video and level."""
    print("| video | shake [deg RMS] | measured / true, mean | held |\n| --- | --- | --- | --- |")  # noqa: T201
    seeds = itertools.count()  # a seed's shake is the same in all places
    for title, more, crf in KINDS:
        for level in (0.05, 0.2, 0.8, 2.5):
            rows: list[tuple[float, bool | None]] = []
            for place in PLACES:
                for seed in itertools.islice(seeds, repeats):
                    with tempfile.TemporaryDirectory() as folder:
                        one = measured_back(place, seed, shaking(level, **more), crf=crf, folder=Path(folder))
                    wanted = level if more else one.true_deg
                    rows.append((one.value("jitter") / wanted, one.holds("jitter", wanted)))
                    words = [place, seed, round(one.true_deg, 4), *one.interval("jitter")]
                    print(title, level, *words, file=sys.stderr, flush=True)  # noqa: T201
            shares = [ratio for ratio, held in rows if held is not None]
            held = f"{sum(held is True for _, held in rows)} of {len(rows)}"
            print(f"| {title} | {level} | {np.mean(shares):.3f} | {held} |", flush=True)  # noqa: T201

    for ev in (0.5, 1.0, 2.0):
        axis = {"parts": ["change"], "dim_ev": ev, "auto_exposure": False, "at_s": 2.5, "severity": 1.0}
        settings = {**SMALL, **STILL, "duration_s": 5.0, "lights.schedule": [], "axes.light": axis}
        found: list[tuple[float, bool | None]] = []
        for place in PLACES[:4]:  # not every seed of the hall can be planned
            for seed in itertools.islice(seeds, repeats):
                with tempfile.TemporaryDirectory() as folder:
                    one = measured_back(place, seed, settings, crf=None, folder=Path(folder))
                found.append((one.value("change of light") / ev, one.holds("change of light", ev)))
                print("light", ev, place, seed, *one.interval("change of light"), file=sys.stderr, flush=True)  # noqa: T201
        held = f"{sum(held is True for _, held in found)} of {len(found)}"
        mean = np.nanmean([ratio for ratio, _ in found])
        print(f"| robot stands, PNG | light falls by {ev} EV | {mean:.2f} | {held} |", flush=True)  # noqa: T201


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 1)
