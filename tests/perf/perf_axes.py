"""What each stress axis costs: a step at severity 1, as a ratio to the base step beside it, at 640x480.

Rounds are interleaved, so that a noisy machine disturbs all alike; medians are shown. `blur` is measured twice: in the
scenario as it is, where people and the robot move and more is drawn, and where only the camera turns.

    python tests/perf/perf_axes.py [SCENARIO]
"""

from __future__ import annotations

import contextlib
import sys
import time
from statistics import median
from typing import Any

from pftrack_sim import scenario
from pftrack_sim.scenario.axes import axes_by_name
from pftrack_sim.simulation.simulation import Simulation

ROUNDS, STEPS, SEED = 12, 5, 1

TURNING: dict[str, Any] = {
    "robot.route": {"kind": "still", "start_m": [0.0, 0.0], "heading_deg": 0.0},
    "distractors.count": 0,
    "occluders": [],
    # Behind the camera, so that nobody moves in view; the shake turns the camera by about 2 px in 10 ms.
    "robot.gaze": "forward",
    "target.path_m": [[-6.0, 0.0], [-60.0, 0.0]],
    "jitter": {"angular_rms_deg": 0.3, "band_hz": [2.0, 12.0]},
}


def measure(name: str, base: dict[str, Any], arms: dict[str, dict[str, Any]]) -> dict[str, tuple[float, float]]:
    """Median ms of a step of each arm, and its ratio to the first."""
    size = {"camera.width_px": 640, "camera.height_px": 480, "duration_s": 60.0}
    taken: dict[str, list[float]] = {arm: [] for arm in arms}
    with contextlib.ExitStack() as stack:
        running: dict[str, Simulation] = {}
        for arm, overrides in arms.items():
            loaded = scenario.load(name, {**size, **base, **overrides})
            running[arm] = stack.enter_context(Simulation(loaded))
            running[arm].reset(SEED)
        for _ in range(ROUNDS):
            for arm, simulation in running.items():
                simulation.advance()
                for _ in range(STEPS):
                    began = time.perf_counter()
                    simulation.advance()
                    taken[arm].append(time.perf_counter() - began)
    first = median(next(iter(taken.values())))
    return {arm: (1e3 * median(times), median(times) / first) for arm, times in taken.items()}


def main() -> None:
    """Print the table."""
    name = sys.argv[1] if len(sys.argv) > 1 else "plaza-walk"
    axes = {axis: {f"axes.{axis}.severity": 1.0} for axis in axes_by_name()}
    print(f"{name}, 640x480, severity 1")
    print(f"{'axis':>28} {'step ms':>8} {'ratio':>6}")
    for arm, (ms, ratio) in measure(name, {}, {"base": {}, **axes}).items():
        print(f"{arm:>28} {ms:>8.1f} {ratio:>6.2f}")
    optics = {arm: axes[arm] for arm in ("blur", "rolling_shutter")}
    for arm, (ms, ratio) in measure(name, TURNING, {"base": {}, **optics}).items():
        print(f"{arm + ', only turning':>28} {ms:>8.1f} {ratio:>6.2f}")


if __name__ == "__main__":
    main()
