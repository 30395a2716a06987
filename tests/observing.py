"""Truth: made up, of one frame of a stage, of many of an episode; and MuJoCo's own renderer to compare with."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
import pytest
from mujoco.rendering.classic import renderer as mujoco_renderer
from render_stage import HEIGHT, WIDTH, K, Stage

from pftrack_sim import scenario
from pftrack_sim.core.records import Truth
from pftrack_sim.render.culling import PixelRect, View
from pftrack_sim.render.gl.context import open_context
from pftrack_sim.render.gl.rasteriser import Rasteriser
from pftrack_sim.render.segmentation import Segmenter, draw_triangles
from pftrack_sim.scenario import ScenarioLike
from pftrack_sim.simulation.simulation import Simulation
from pftrack_sim.truth.observer import TruthObserver

Drawing = Callable[[Stage], Rasteriser]

PLACES = [name for name in scenario.names() if name.startswith("easy/")]
"""One scenario for each place; the suites use the same places."""
SMALL: dict[str, Any] = {"camera.width_px": 160, "camera.height_px": 120, "lights.shadows": False}
TINY: dict[str, Any] = {"camera.width_px": 96, "camera.height_px": 72, "lights.shadows": False}
ALONE: dict[str, Any] = {"distractors.count": 0, "occluders": []}
"""Nobody and nothing but the target."""
CALM: dict[str, Any] = {**SMALL, **ALONE, "jitter.angular_rms_deg": 0.0, "jitter.translational_rms_mm": 0.0}
"""Nobody and nothing but the target, seen by a small steady camera."""
SMALL_WALK: dict[str, Any] = {
    "extends": "plaza-walk",
    "camera": {"width_px": 160, "height_px": 120, "rate_hz": 10.0},
    "lights": {"shadows": False, "schedule": []},
    "target": {"actions": []},
    "occluders": [],
}
"""A scenario in which nothing happens to the target, and others walk."""


def on_axis(axis: str, **keys: Any) -> dict[str, Any]:
    """Overrides of the keys of a stress axis."""
    return {f"axes.{axis}.{key}": value for key, value in keys.items()}


def made_truth(**values: Any) -> Truth:
    """A truth with these values; all four boxes are the `box` where nothing else is given."""
    box = values.get("box", (100.0, 60.0, 40.0, 90.0))
    plain = {
        **dict.fromkeys(("box", "amodal_box", "visible_box", "swept_box"), box),
        **dict.fromkeys(("T_world_camera", "T_world_target"), np.eye(4)),
        "name": "target",
        "visible_fraction": 0.6,
        "truncation": 0.0,
        "state": "visible",
        "occluders": ("pillar-3",),
        "distance_m": 4.0,
        "K": np.eye(3),
        "distortion": np.zeros(5),
        "time_s": 0.0,
        "image_motion_px": 0.0,
        "luminance": 0.4,
    }
    return Truth(**plain | values)


def box_of(mask: np.ndarray) -> np.ndarray:
    """`(4,)` extent of the true pixels of an `(H, W)` mask; NaN when there are none."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not rows.size:
        return np.full(4, np.nan)
    return np.array([columns[0], rows[0], np.ptp(columns) + 1.0, np.ptp(rows) + 1.0])


def observed(stage: Stage, pose: np.ndarray) -> dict[str, Truth]:
    """Truth by name, from a new observer."""
    observer = TruthObserver(stage.model, stage.people, K, (WIDTH, HEIGHT))
    people = observer.observe(stage.data, pose, None, 0.0, stage.roots())
    assert people[0].name == stage.people[0]
    return {truth.name: truth for truth in people}


def truths(name: ScenarioLike, overrides: Mapping[str, Any], seed: int, from_s: float, until_s: float) -> list[Truth]:
    """Truth of the target, without images, in the first frame and in those from a time on."""
    with Simulation(scenario.load(name, overrides), image=False) as simulation:
        observed, rate_hz = [simulation.reset(seed).truth], simulation.settings.camera.rate_hz
        for _ in range(round(from_s * rate_hz) - 1):
            simulation.world.advance()
        return observed + [simulation.advance().truth for _ in range(round((until_s - from_s) * rate_hz))]


def finer_ids(segmenter: Segmenter, view: View, rect: PixelRect, shapes: np.ndarray, finer: int) -> np.ndarray:
    """Geom at each pixel of a rectangle, -1 for none, of pixels that are so many times finer along an edge.

    Shapes are those of `Detail`.
    """
    drawn = segmenter.nothing(rect)
    fx, fy, cx, cy = (finer * value for value in view.intrinsics)
    window = fx, fy, cx - rect.left, cy - rect.top
    poses = view.geom_xpos, view.geom_xmat.reshape(-1, 3, 3), np.array(view.T_world_camera, order="C")
    draw_triangles(shapes, segmenter.triangles, *poses, window, segmenter.near_m, drawn.ids, drawn.inverse_depth)
    return drawn.ids


class _Borrowed:
    """A context of its own for `mujoco.Renderer`, which would choose one by an environment variable."""

    def __init__(self, width: int, height: int) -> None:
        with ThreadPoolExecutor(1) as pool:
            self._context = pool.submit(open_context).result()

    def make_current(self) -> None:
        self._context._context.make_current()

    def as_current(self) -> object:
        return self._context.current()

    def free(self) -> None:
        self._context.close()


class MujocosRenderer:
    """`mujoco.Renderer` through the first camera of a model, whose pose is changed."""

    def __init__(self, renderer: mujoco.Renderer) -> None:
        self._renderer = renderer

    def _drawn(self, data: mujoco.MjData, pose: np.ndarray) -> np.ndarray:
        data.cam_xpos[0] = pose[:3, 3]
        data.cam_xmat[0] = (pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])).ravel()
        self._renderer.update_scene(data, 0)
        return self._renderer.render().copy()

    def image(self, data: mujoco.MjData, pose: np.ndarray) -> np.ndarray:
        """`(H, W, 3)` colours."""
        return self._drawn(data, pose)

    def ids(self, data: mujoco.MjData, pose: np.ndarray, geoms: np.ndarray | None = None) -> np.ndarray:
        """`(H, W)` geom at each pixel, -1 for none; only of some geoms, if given as a mask."""
        model = self._renderer.model
        groups = model.geom_group.copy()
        if geoms is not None:
            model.geom_group[~geoms] = 5
        self._renderer.enable_segmentation_rendering()
        found = self._drawn(data, pose)
        self._renderer.disable_segmentation_rendering()
        model.geom_group[:] = groups
        return np.where(found[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM), found[..., 0], -1)

    def depth_m(self, data: mujoco.MjData, pose: np.ndarray) -> np.ndarray:
        """`(H, W)` depth along the optical axis."""
        self._renderer.enable_depth_rendering()
        found = self._drawn(data, pose)
        self._renderer.disable_depth_rendering()
        return found


@contextmanager
def mujocos_renderer(model: mujoco.MjModel, width: int = WIDTH, height: int = HEIGHT) -> Iterator[MujocosRenderer]:
    """MuJoCo's renderer of a model, in a context of this package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mujoco_renderer.gl_context, "GLContext", _Borrowed)
        with mujoco_renderer.Renderer(model, height, width) as renderer:
            yield MujocosRenderer(renderer)
