"""Closed-loop episodes for the page: the way from above, distance and bearing, and where and why a target was lost."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np

from pftrack_sim.report.data import EpisodeKey, Row, Run
from pftrack_sim.scenario import Scenario
from pftrack_sim.scenario import load as load_scenario
from pftrack_sim.score.following import losses

MOST = 120
"""More drives make the page heavy; those with a video come first."""
POINTS = 400
"""Of each curve, at most."""

_COLUMNS = ("frame", "time_s", "robot_x_m", "robot_y_m", "gaze_rad", "target_x_m", "target_y_m", "state", "occluders")
_AFTER = ("after_s", "after_distance_m", "after_bearing_rad", "after_seen")


def drives(run: Run) -> list[dict[str, Any]]:
    """What the page shows of drives; empty where the robot had a script.

    Args:
        run: The run folder.
    """
    if run.plan.kind != "follow":
        return []
    rows = sorted(run.rows, key=lambda row: run.video(row) is None)[:MOST]
    chosen = {id(row) for row in rows}
    fovs: dict[tuple[str, int], float] = {}
    return [_drive(run, row, fovs) for row in run.rows if id(row) in chosen]


def _drive(run: Run, row: Row, fovs: dict[tuple[str, int], float]) -> dict[str, Any]:
    table = run.columns(str(row.values["file"]), (*_COLUMNS, *_AFTER))
    every = slice(None, None, math.ceil(len(table["frame"]) / POINTS))
    video = run.video(row)
    at = (row.key.scenario, row.key.seed)
    if at not in fovs:
        fovs[at] = _half_fov(run, row.key)

    def curve(name: str, digits: int = 2, scale: float = 1.0) -> list[float | None]:
        values = scale * np.asarray(np.ma.filled(table[name], np.nan), dtype=np.float64)
        return [round(value, digits) if math.isfinite(value) else None for value in values[every].tolist()]

    return {
        "name": f"{row.tracker}, {row.key.scenario}, {row.key.condition}, seed {row.key.seed}",
        "tracker": run.trackers.index(row.tracker),
        "video": os.path.relpath(video, run.path).replace(os.sep, "/") if video is not None else None,
        "rate_hz": row.number("rate_hz"),
        "half_fov": fovs[at],
        "time": curve("time_s", 3),
        "robot": [curve("robot_x_m"), curve("robot_y_m")],
        "target": [curve("target_x_m"), curve("target_y_m")],
        "gaze": curve("gaze_rad", 3),
        "after": curve("after_s", 3),
        "distance": curve("after_distance_m"),
        "bearing": curve("after_bearing_rad", 1, math.degrees(1.0)),
        "lost": _lost(table),
        "ending": _ending(row),
    }


def _half_fov(run: Run, key: EpisodeKey) -> float:
    """Half the camera's horizontal angle of view [rad]."""
    stages = {stage.name: stage.tree for batch in run.plan.batches for stage in batch.scenarios}
    camera = load_scenario(Scenario(key.scenario, stages[key.scenario])).resolve(key.seed).camera
    return math.atan(math.tan(math.radians(camera.fovy_deg) / 2) * camera.width_px / camera.height_px)


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


def _ending(row: Row) -> str:
    """How it ended, in words."""
    touched = row.values.get("collided_with")
    how = {
        "finished": "driven to the end",
        "collision": f"ended by a collision with {touched}" if touched else "ended by a collision",
        "lost": "ended because the target was out of view for too long",
    }[str(row.values["outcome"])]
    failure = f"; failure: {row.values['failure']}" if row.values.get("failure") else ""
    return (
        f"{how}; success {row.number('follow_success'):.0f}, {row.number('follow_tracking_rate'):.0%} tracked{failure}"
    )
