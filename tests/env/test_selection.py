"""What the user selects in the first frame: the whole person or the torso, in mid-stride."""

from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from pftrack_sim import scenario
from pftrack_sim.core.records import Frame
from pftrack_sim.render.culling import PixelRect, View
from pftrack_sim.render.segmentation import Segmenter
from pftrack_sim.scene.build import NEAR_M
from pftrack_sim.scene.layout import PEOPLE_GROUP
from pftrack_sim.scene.people.person import TRUNK
from pftrack_sim.simulation.simulation import Simulation

SMALL: dict[str, Any] = {
    "camera.width_px": 200,
    "camera.height_px": 150,
    "lights.shadows": False,
    "camera.rate_hz": 15.0,
}


@cache
def frames(init: str) -> tuple[Frame, ...]:
    """The first stride of a target seen from the side."""
    with Simulation(scenario.load("easy/warehouse", {**SMALL, "target.init": init})) as simulation:
        return simulation.reset(0), *(simulation.advance() for _ in range(17))


def test_selected_in_mid_stride_the_box_seen_from_the_side_has_its_median_width():
    width = np.array([one.truth.amodal_box[2] * one.truth.distance_m for one in frames("body")])
    assert width.max() / width.min() > 1.8
    assert width[0] / np.median(width) == pytest.approx(1.0, abs=0.05)


def test_the_torso_is_selected_scored_and_steadier_while_everything_else_stays():
    whole, torso = frames("body"), frames("torso")
    for one, other in zip(whole, torso, strict=True):
        assert (one.image == other.image).all()
        body, trunk = one.truth.amodal_box, other.truth.amodal_box
        assert (trunk[:2] > body[:2]).all()
        assert (trunk[:2] + trunk[2:] < body[:2] + body[2:]).all()
        assert 0.25 < trunk[3] / body[3] < 0.45
        assert one.truth.visible_fraction == other.truth.visible_fraction
        assert (one.truth.visible_box == other.truth.visible_box).all()
        assert one.people[1:] == other.people[1:]
    aspect = np.array([[one.truth.amodal_box[2] / one.truth.amodal_box[3] for one in run] for run in (whole, torso)])
    swing = np.ptp(aspect, axis=1) / aspect.mean(axis=1)
    assert swing[1] < 0.3 * swing[0]


@pytest.mark.parametrize("lens", [{}, {"axes.distortion.severity": 1.0}], ids=["pinhole", "distorted"])
@pytest.mark.slow
def test_the_torsos_box_is_the_extent_of_its_pixels(lens: dict[str, float]):
    with Simulation(scenario.load("easy/warehouse", {**SMALL, **lens, "target.init": "torso"})) as simulation:
        truth = simulation.reset(1).truth
        model, data = simulation.world.model, simulation.world.data
        trunk = np.isin(model.geom_bodyid, [model.body(f"target/{part}").id for part in TRUNK])
        view = View(data.geom_xpos, data.geom_xmat, truth.T_world_camera, truth.K, NEAR_M)
        geoms = np.flatnonzero(trunk & (model.geom_group == PEOPLE_GROUP))
        shown = Segmenter(model).segment(
            view, PixelRect(0, 0, SMALL["camera.width_px"], SMALL["camera.height_px"]), geoms
        )
        rows, columns = np.nonzero(shown.ids >= 0)
    drawn = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1], dtype=float)
    box = truth.amodal_box
    extent = np.array([*box[:2], *(box[:2] + box[2:])])
    # Near the centre of the image the lens moves the outline by a few pixels only.
    assert np.abs(extent - drawn).max() < (4.0 if lens else 1.0)
    assert (truth.swept_box == box).all()


@pytest.mark.slow
def test_the_environment_hands_out_and_rewards_the_torso():
    env = gym.make("pftrack_sim/Track-v0", scenario="easy/warehouse", overrides={**SMALL, "target.init": "torso"})
    observation, info = env.reset(seed=1)
    assert (observation["init_box"] == info["truth"].box).all()
    assert env.step(observation["init_box"])[1] == pytest.approx(1.0)
    env.close()


def test_a_person_whose_trunk_is_outside_is_seen_as_much_as_the_rest_of_them():
    """The camera looks up from behind, so that only the head is in the image."""
    seen = {}
    for init in ("body", "torso"):
        changes = {**SMALL, "target.init": init, "camera.fovy_deg": 20.0, "camera.tilt_deg": 14.0}
        with Simulation(scenario.load("plaza-walk", changes)) as simulation:
            seen[init] = simulation.reset(1).truth
    whole, torso = seen["body"], seen["torso"]
    assert (whole.state, torso.state) == ("visible", "out_of_view")
    assert torso.visible_fraction == whole.visible_fraction > 0.5
    assert (torso.visible_box == whole.visible_box).all()
    assert torso.box[2] * torso.box[3] == 0.0
