"""Closed-loop episodes of the page: the path from above, distance and bearing, and where the target was lost."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from functools import cache, partial
from typing import Any

import numpy as np

from pftrack_sim.benchmark import Result, RunStore
from pftrack_sim.benchmark.reading.failures import Failure, failures
from pftrack_sim.scenario import Scenario
from pftrack_sim.score.following import losses

MAX_EPISODES = 120
"""More make the page heavy; episodes with a video come first."""
MAX_POINTS = 400
"""Points of each curve."""

_COLUMNS = ("frame", "time_s", "robot_x_m", "robot_y_m", "gaze_rad", "target_x_m", "target_y_m", "state", "occluders")
_AFTER = ("after_s", "after_distance_m", "after_bearing_rad", "after_seen")


def following_episodes(store: RunStore, numbers: Mapping[tuple[str, str, int], int]) -> list[dict[str, Any]]:
    """Data of the closed-loop episodes, numbered by scenario, condition and seed; empty in open loop."""
    if store.plan.kind != "follow":
        return []
    results = sorted(store.results, key=lambda result: store.video_of(result) is None)[:MAX_EPISODES]
    chosen = {id(result) for result in results}
    trackers = list(dict.fromkeys(result.label for result in store.results))
    failed = failures(store)
    scene = cache(partial(_scene, store))
    return [
        {"episode": numbers[result.scenario, result.condition.name, result.seed]}
        | {"tracker": trackers.index(result.label), **scene(result.scenario, result.seed)}
        | _episode(store, result)
        | {"ending": _ending(result, failed.get(result.key))}
        for result in store.results
        if id(result) in chosen
    ]


def video_link(store: RunStore, result: Result) -> str | None:
    """Link from the page to a result's video, if there is one."""
    video = store.video_of(result)
    return os.path.relpath(video, store.path).replace(os.sep, "/") if video is not None else None


def _episode(store: RunStore, result: Result) -> dict[str, Any]:
    table = store.frame_columns(result, (*_COLUMNS, *_AFTER))
    every = slice(None, None, math.ceil(len(table["frame"]) / MAX_POINTS))

    def curve(name: str, digits: int = 2, scale: float = 1.0) -> list[float | None]:
        values = scale * np.asarray(table[name], dtype=np.float64)
        return [round(value, digits) if math.isfinite(value) else None for value in values[every].tolist()]

    return {
        "name": f"{result.label}, {result.scenario}, {result.condition.name}, seed {result.seed}",
        "video": video_link(store, result),
        "rate_hz": result.number("rate_hz"),
        "time": curve("time_s", 3),
        "robot": [curve("robot_x_m"), curve("robot_y_m")],
        "target": [curve("target_x_m"), curve("target_y_m")],
        "gaze": curve("gaze_rad", 3),
        "after": curve("after_s", 3),
        "distance": curve("after_distance_m"),
        "bearing": curve("after_bearing_rad", 1, math.degrees(1.0)),
        "lost": _lost(table),
    }


def _scene(store: RunStore, name: str, seed: int) -> dict[str, float]:
    """Half the camera's horizontal field of view [rad], the wanted distance, and the limits of both errors."""
    scenario = store.plan.scenarios[name]
    resolved = Scenario(scenario.name, scenario.tree).resolve(seed)
    return {"half_fov": resolved.camera.half_view_rad[0], **resolved.follow.model_dump()}


def _lost(table: dict[str, Any]) -> list[dict[str, Any]]:
    """When, where and why the target was lost."""
    times = np.asarray(table["time_s"], dtype=np.float64)
    found: list[dict[str, Any]] = []
    for since, until in losses(table["after_s"], table["after_seen"]):
        frame = min(int(np.searchsorted(times, since - 1e-9)), len(times) - 1)
        end = None if math.isnan(until) else round(until, 2)
        behind = [str(one) for one in table["occluders"][frame] if one is not None]
        why = f"behind {', '.join(behind)}" if behind else str(table["state"][frame]).replace("_", " ")
        found.append(
            {
                "since": round(since, 2),
                "until": end,
                "x": round(float(table["target_x_m"][frame]), 2),
                "y": round(float(table["target_y_m"][frame]), 2),
                "why": f"lost at {since:.1f} s, {table['after_distance_m'][max(frame - 1, 0)]:.1f} m away: {why}; "
                + ("never found again" if end is None else f"found again at {end:.1f} s"),
            }
        )
    return found


def _ending(result: Result, failure: Failure | None) -> str:
    """The outcome, and what made it fail, in words."""
    touched = result.values.get("collided_with")
    outcome = {
        "finished": "driven to the end",
        "collision": f"ended by a collision with {touched}" if touched else "ended by a collision",
        "lost": "ended because the target was out of view for too long",
    }[str(result.values["outcome"])]
    error = f"; error: {result.error}" if result.error else ""
    tracked = f"{result.number('follow_tracking_rate'):.0%} tracked"
    why = f"failed: {failure.statement}" if failure else "success"
    return f"{outcome}; {why}; {tracked}{error}"
