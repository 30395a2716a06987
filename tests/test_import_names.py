"""Names that others rely on."""

import inspect

from pftrack_sim import policies, trackers
from pftrack_sim.core import records


def test_public_surface():
    assert {"oracle", "stay", "opencv-mil", "ko2012"} <= set(trackers.names())
    assert {"name", "seed", "preset"} <= set(inspect.signature(trackers.make).parameters)
    assert {"TrackingPolicy", "FollowPolicy"} <= set(vars(policies))
    wanted = (
        "box amodal_box visible_box swept_box visible_fraction truncation state occluders distance_m T_world_camera "
        "T_world_target K distortion time_s image_motion_px luminance"
    )
    assert set(wanted.split()) <= set(records.Truth.__dataclass_fields__)
