"""Many worlds drawn together: frames per second with the truth of the target, against the number of worlds.

    python tests/perf/perf_gpu.py                    # the GPU where Warp finds one, and 1 to 4096 worlds; else 1 to 4
    python tests/perf/perf_gpu.py --worlds 1,16,256 --processes 8 --seconds 600

Worlds are divided between processes, since physics and people are computed on the processor; all draw on the same
device. `cast` is the share of the time spent in the ray caster and in copies to and from it: the rest of a frame is
what a faster device cannot shorten. Memory is that of the processes (`host`, with what a process without worlds has)
and of the device, for each world. Without a GPU all times are those of the processor, on however busy a machine.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import time
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

import pftrack_sim  # noqa: F401 - registers the environments
from pftrack_sim.core.errors import PftrackError
from pftrack_sim.render.selection import warp_installed
from pftrack_sim.scenario import load

AIM = 100_000
ON_GPU, ON_CPU = (1, 4, 16, 64, 256, 1024, 4096), (1, 4)
STEPS = 5


@dataclass(frozen=True)
class Job:
    """Worlds of one process, and the process number."""

    scenario: str
    size_px: int
    worlds: int
    first_seed: int


@dataclass(frozen=True)
class Measured:
    """Seconds of all resets, of all steps and of the casts in them; memory of the process and of the device [MB]."""

    reset_s: float
    step_s: float
    cast_s: float
    host_mb: float
    device_mb: float


def measure(job: Job, barrier: Any = None) -> Measured:
    """Reset and step the worlds of one process; the steps begin when all processes are there."""
    from pftrack_sim.render.warp import rays, world_pool

    device = rays.wp.get_device()
    clock = time.perf_counter if device.is_cuda else time.process_time
    cast_s = [0.0]
    draw = world_pool._Group.draw

    def timed(*args: Any) -> Any:
        start = clock()
        drawn = draw(*args)
        cast_s[0] += clock() - start
        return drawn

    world_pool._Group.draw = timed  # type: ignore[method-assign]
    try:
        overrides = {"camera.width_px": job.size_px, "camera.height_px": job.size_px}
        free = device.free_memory if device.is_cuda else 0
        host = _host_mb()
        envs: Any = gym.make_vec("pftrack_sim/FollowBatch-v0", job.worlds, scenario=job.scenario, overrides=overrides)
        start = clock()
        envs.reset(seed=job.first_seed)
        still = np.zeros((job.worlds, 4), dtype=np.float32)
        reset_s = clock() - start
        envs.complete_truth(envs.step(still)[-1])
        if barrier is not None:
            barrier.wait()
        start, cast_s[0] = clock(), 0.0
        for _ in range(STEPS):
            envs.complete_truth(envs.step(still)[-1])
        step_s = clock() - start
        used = (free - device.free_memory) / 1e6 if device.is_cuda else 0.0
        found = Measured(reset_s, step_s, cast_s[0], _host_mb() - host, used)
        envs.close()
        return found
    finally:
        world_pool._Group.draw = draw  # type: ignore[method-assign]


def _host_mb() -> float:
    """Most memory that the process has had so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def _work(job: Job, barrier: Any, results: Any) -> None:
    try:
        results.put(measure(job, barrier))
    except BaseException as error:
        barrier.abort()
        results.put(f"{type(error).__name__}: {error}")
        raise


def measure_all(scenario: str, size_px: int, worlds: int, processes: int) -> list[Measured]:
    """Measure some worlds, divided between fresh processes, so that what one number of worlds leaves burdens no other.

    Raises:
        RuntimeError: A process has failed, for example for want of memory.
    """
    context = multiprocessing.get_context("spawn")
    shares = [len(share) for share in np.array_split(np.arange(worlds), min(worlds, processes))]
    barrier, results = context.Barrier(len(shares)), context.Queue()
    starts = np.cumsum([0, *shares]).tolist()
    workers = [
        context.Process(target=_work, args=(Job(scenario, size_px, share, first), barrier, results))
        for share, first in zip(shares, starts, strict=False)
    ]
    for worker in workers:
        worker.start()
    found: list[Any] = []
    while len(found) < len(workers):
        if not any(worker.is_alive() for worker in workers) and results.empty():
            raise RuntimeError(f"a process ended with {[worker.exitcode for worker in workers]}")
        if not results.empty():
            found.append(results.get())
        time.sleep(0.05)
    for worker in workers:
        worker.join()
    failed = [one for one in found if isinstance(one, str)]
    if failed:
        raise RuntimeError(failed[0])
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", type=_counts, help=f"numbers of worlds; {ON_GPU} on a GPU, {ON_CPU} without")
    parser.add_argument("--processes", type=_count, help="one for each core on a GPU, 1 without")
    parser.add_argument("--seconds", type=float, default=300.0, help="begin nothing that would end later")
    parser.add_argument("--size", type=_count, default=84, help="width and height of the images [px]")
    parser.add_argument("--scenario", default="plaza-walk")
    options = parser.parse_args()
    if not warp_installed():
        print("the ray caster is not installed (pip install 'pftrack-sim[warp]'): nothing to measure")
        return
    try:
        load(options.scenario)
    except PftrackError as error:
        parser.error(str(error))
    from pftrack_sim.render.warp import rays

    device = rays.wp.get_device()
    on_gpu = bool(device.is_cuda)
    worlds = options.worlds or (ON_GPU if on_gpu else ON_CPU)
    processes = options.processes or ((os.cpu_count() or 1) if on_gpu else 1)
    print(f"{options.scenario}, {options.size}x{options.size}, with shadows as the scenario has them, on {device.name}")
    if not on_gpu:
        print("NOT RUN ON A GPU: Warp finds none here, and the times are those of the processor.")
    print(f"{'worlds':>6} {'processes':>9} {'frames/s':>9} {'cast':>5} {'reset s':>8} {'host MB':>8} {'device MB':>9}")
    begin, best, per_world_s, per_world_mb = time.perf_counter(), 0.0, 0.0, (0.0, 0.0)
    for count in worlds:
        left_s = options.seconds - (time.perf_counter() - begin)
        if (needed_s := per_world_s * count / min(count, processes)) > left_s:
            print(f"stopped before {count} worlds: about {needed_s:.0f} s, and {left_s:.0f} s are left (--seconds)")
            break
        rooms = _free_mb(device)
        if short := [name for name, mb in zip(rooms, per_world_mb, strict=True) if mb * count > rooms[name]]:
            print(f"stopped before {count} worlds: not enough memory ({', '.join(short)})")
            break
        try:
            found = measure_all(options.scenario, options.size, count, processes)
        except RuntimeError as error:
            print(f"stopped at {count} worlds: {error}")
            break
        per_world_s = sum(one.reset_s + 2.0 * one.step_s for one in found) / count
        step_s = max(one.step_s for one in found)
        speed, cast = count * STEPS / step_s, sum(one.cast_s for one in found) / sum(one.step_s for one in found)
        host, used = (sum(getattr(one, name) for one in found) / count for name in ("host_mb", "device_mb"))
        per_world_mb, best = (host, used), max(best, speed)
        reset_s = sum(one.reset_s for one in found) / count
        print(f"{count:6d} {len(found):9d} {speed:9.1f} {cast:5.0%} {reset_s:8.2f} {host:8.1f} {used:9.1f}", flush=True)
    if on_gpu:
        print(f"at most {best:,.0f} frames/s; the aim is {AIM:,} at 84x84 on one data-centre card")


def _count(text: str) -> int:
    count = int(text) if text.isdecimal() else 0
    if count < 1:
        raise argparse.ArgumentTypeError(f"a whole number above 0 is wanted, got {text!r}")
    return count


def _counts(text: str) -> list[int]:
    return [_count(one) for one in text.split(",")]


def _free_mb(device: Any) -> dict[str, float]:
    """Memory that is left, of the host and of the device; unlimited where it is not known."""
    pages = {name: os.sysconf(name) for name in ("SC_AVPHYS_PAGES", "SC_PAGE_SIZE") if name in os.sysconf_names}
    host = pages["SC_AVPHYS_PAGES"] * pages["SC_PAGE_SIZE"] / 1e6 if len(pages) == 2 else float("inf")
    return {"host": host, "device": device.free_memory / 1e6 if device.is_cuda else float("inf")}


if __name__ == "__main__":
    main()
