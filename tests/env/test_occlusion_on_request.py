"""A requested occlusion is in the truth of the frames, as low as asked; for its times see `test_occlusion_axis`."""

from typing import Any

import observing
import pytest

from pftrack_sim.core.errors import ScenarioError

MIDDLE_S = 3.5


def walk(route: dict[str, Any], **occluder: Any) -> dict[str, Any]:
    """A walk across the open square, without distractors, and one occlusion."""
    return {
        "title": "one occlusion",
        "duration_s": 5.5,
        "place": {"kind": "plaza", "clutter": 0.0},
        "robot": {"route": route},
        "camera": {"width_px": 240, "height_px": 180, "rate_hz": 15.0},
        "lights": {"shadows": False},
        "target": {"path_m": [[4.0, 1.0], [20.0, 1.0]], "speed_m_s": 1.1},
        "distractors": {"count": 0},
        "occluders": [{"at_s": 3.0, "duration_s": 1.0, **occluder}],
    }


@pytest.mark.parametrize("share", [0.35, 0.6])
@pytest.mark.parametrize("kind", ["wall", "boxes"])
def test_a_low_occluder_covers_the_requested_share_of_the_height(kind: str, share: float):
    tree = walk({"kind": "beside", "distance_m": 3.6, "lead_m": -0.4}, kind=kind, share=share)
    before, *_, middle = observing.truths(tree, {}, 0, 2.0, MIDDLE_S)[1:]
    assert before.visible_fraction > 0.98
    assert middle.occluders[0] == f"occluder-{kind}-1"
    assert middle.visible_box[3] / middle.amodal_box[3] == pytest.approx(1.0 - share, abs=0.06)


def test_an_impossible_occlusion_is_an_error_with_the_reason():
    with pytest.raises(ScenarioError, match=r"occluders\.0.*walker"):
        observing.truths(walk({"kind": "trail", "distance_m": 3.5}, kind="pillar"), {}, 0, 0.0, 0.1)
