"""What a frame costs `ko2012`, as ratios: a machine's speed divides out.

python tests/perf/perf_trackers.py
"""

import time

import numpy as np

from pftrack_sim import trackers


def cost_ms(side_px: float, particle_count: int) -> float:
    """Least processor time of a frame at 640x480 [ms]."""
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, (480, 640, 3), dtype=np.uint8) for _ in range(4)]
    tracker = trackers.make("ko2012", particle_count=particle_count, sigma_centre=0.01, sigma_size=0.0)
    tracker.init(images[0], np.array([200.0, 150, side_px, side_px]))
    times: list[float] = []
    for index in range(40):
        began = time.process_time()
        tracker.update(images[index % 4])
        times.append((time.process_time() - began) * 1e3)
    return min(times)


def main() -> None:
    """Print the ratios."""
    base = cost_ms(60, 400)
    print(f"60x60 px, 400 particles: {base:.2f} ms")
    print(f"box of 4x the area:      x{cost_ms(120, 400) / base:.2f} (nearly free: the grid is fixed)")
    print(f"4x the particles:        x{cost_ms(60, 1600) / base:.2f} (at most 4)")


if __name__ == "__main__":
    main()
