"""How well boxes agree with the truth, and which tracker is better.

`episode`: one tracker on one sequence, in one row; `measures`: everything of a simulated episode. `curves`: success and
precision over their thresholds, and the measures of OTB, TrackingNet and GOT-10k that are read off them. `course`: what
happens over time: failures, recovery after an occlusion, drift, loss for good. `compare`: intervals over seeds, and
differences between trackers paired by seed. `agreement`: whether two scores put trackers in the same order.
`following`: how well a robot followed.
"""

from pftrack_sim.score.agreement import Agreement, rank_agreement, rank_correlation
from pftrack_sim.score.compare import (
    Comparison,
    bootstrap_interval,
    compare,
    holm,
    paired_difference,
    share_interval,
    wins,
)
from pftrack_sim.score.course import (
    Recovery,
    drift_per_second,
    failures,
    occlusions,
    recoveries,
    share_lost_for_good,
)
from pftrack_sim.score.curves import (
    NORMALISED_PRECISION_THRESHOLDS,
    PRECISION_THRESHOLDS_PX,
    SUCCESS_THRESHOLDS,
    area_under_success,
    average_overlap,
    normalised_centre_errors,
    normalised_precision,
    precision_curve,
    strict_success_rate,
    success_curve,
)
from pftrack_sim.score.episode import (
    PRECISION_PX,
    SUCCESS_OVERLAP,
    Summary,
    centre_errors,
    overlaps,
    precision,
    success_rate,
    summarise,
)
from pftrack_sim.score.measures import FrameScores, Measures, frame_scores, measure

__all__ = [
    "NORMALISED_PRECISION_THRESHOLDS",
    "PRECISION_PX",
    "PRECISION_THRESHOLDS_PX",
    "SUCCESS_OVERLAP",
    "SUCCESS_THRESHOLDS",
    "Agreement",
    "Comparison",
    "FrameScores",
    "Measures",
    "Recovery",
    "Summary",
    "area_under_success",
    "average_overlap",
    "bootstrap_interval",
    "centre_errors",
    "compare",
    "drift_per_second",
    "failures",
    "frame_scores",
    "holm",
    "measure",
    "normalised_centre_errors",
    "normalised_precision",
    "occlusions",
    "overlaps",
    "paired_difference",
    "precision",
    "precision_curve",
    "rank_agreement",
    "rank_correlation",
    "recoveries",
    "share_interval",
    "share_lost_for_good",
    "strict_success_rate",
    "success_curve",
    "success_rate",
    "summarise",
    "wins",
]
