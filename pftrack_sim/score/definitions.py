"""What the columns of tables and pages mean, in words: printed wherever they are."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from pftrack_sim.score import curves, following
from pftrack_sim.score.statistics import LEAST_FOR_INTERVAL, LEAST_FOR_VERDICT, LEVEL

DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {
        "stay": "mean overlap of the first box in every frame, on the same frames",
        "skill": "(overlap - stay) / (1 - stay)",
        "tracked": f"share of frames with overlap >= {curves.SUCCESS_OVERLAP:g} (or {curves.LOOSE_OVERLAP:g})",
        "inside": "share of frames in which the centre of the estimate lies inside the true box",
        "fixed size": "share of frames in which the best box of the first one's size, at the true centre, reaches an "
        f"overlap of {curves.SUCCESS_OVERLAP:g}; trackers that change the size can exceed it",
    }
)
"""Columns beside the mean overlap."""

FOLLOWING_DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {
        "success": "share of drives that reach the episode's end without a collision and follow in the last frame",
        "collided": f"share of drives that touch something or come within {following.COLLISION_M:g} m of the target",
        "tracked": "share of a whole episode's frames in which the robot follows: part of the target can be seen, no "
        "farther than the wanted distance + 1 m",
        "within": "share of the frames driven in which the target can be seen within the scenario's limits of distance "
        "and bearing (follow.distance_limit_m, follow.bearing_limit_deg)",
        "RMS": "root mean square of the distance's error",
        "jerk": "root mean square of the third derivative of the robot's path, over half a second",
        "nearest bystander": "least distance in a drive from the robot to a person but the target",
        "losses": f"times per drive that the target is out of sight for longer than {following.FOUND_S:g} s",
    }
)
"""Columns of the tables of following."""

PEOPLE_DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {
        "HOTA": "geometric mean of DetA and AssA, mean over overlap thresholds of 0.05 to 0.95 (Luiten et al. 2021)",
        "DetA": "share of the true and the estimated boxes that are matched",
        "AssA": "over the matched boxes, the share of both tracks' boxes that are matched to each other",
        "IDF1": "F1 score of boxes with the right identity, one for each person (Ristani et al. 2016)",
        "MOTA": "1 - (missed + false + switches) / true boxes (Bernardin & Stiefelhagen 2008)",
        "switches": "times per episode that a person gets another identity",
    }
)
"""Columns of the tables of everybody in view; in lower case, those of the summary."""

INTERVALS = f"its 95 % interval (Hall 1992), or its values where they are fewer than {LEAST_FOR_INTERVAL}"
"""What stands beside a mean over seeds or sequences."""

VERDICTS = (
    f"A difference counts as shown from {LEAST_FOR_VERDICT} seeds or sequences on, where its p, corrected for all that "
    f"are compared together (Holm 1979), is below {LEVEL:g}"
)
"""When a difference over seeds or sequences counts as shown."""

MEASURE_DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {
        "mean_overlap": "intersection over union of estimate and true box, mean over the frames in which the target is "
        "visible",
        "success": f"share of frames with an overlap of at least {curves.SUCCESS_OVERLAP:g}",
        "stay": DEFINITIONS["stay"],
        "centre_inside": DEFINITIONS["inside"],
        "fixed_size": DEFINITIONS["fixed size"],
        "follow_success": FOLLOWING_DEFINITIONS["success"],
        "follow_collision": FOLLOWING_DEFINITIONS["collided"],
        "follow_tracking_rate": FOLLOWING_DEFINITIONS["tracked"],
        "follow_within": FOLLOWING_DEFINITIONS["within"],
        "follow_distance_rms_m": FOLLOWING_DEFINITIONS["RMS"],
        "follow_jerk_rms_m_s3": FOLLOWING_DEFINITIONS["jerk"],
        "follow_bystander_m": FOLLOWING_DEFINITIONS["nearest bystander"],
        "follow_losses": FOLLOWING_DEFINITIONS["losses"],
        **{head.lower(): words for head, words in PEOPLE_DEFINITIONS.items()},
    }
)
"""Columns of the summary; others have names that tell what they are."""
