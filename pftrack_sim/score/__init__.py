"""Scores of trackers and robots, and statistics over seeds.

`frames`: overlap and errors of single frames. `reference`: a box that stays. `ceilings`: best possible scores of a
box of fixed shape. `curves`: success and precision of OTB, TrackingNet and GOT-10k. `events`: failures, recoveries,
drift over time. `episode`: all measures of an episode in one row. `following`: measures of a driven robot.
`paired`: several episodes on the same frames. `statistics`: intervals, paired comparisons, rank correlation.
"""

from pftrack_sim.score.ceilings import Ceiling, fixed_shape_ceiling
from pftrack_sim.score.curves import (
    LOOSE_OVERLAP,
    NORMALISED_PRECISION_THRESHOLDS,
    PRECISION_PX,
    PRECISION_THRESHOLDS_PX,
    SUCCESS_OVERLAP,
    SUCCESS_THRESHOLDS,
    area_under_success,
    average_overlap,
    normalised_precision,
    precision,
    precision_curve,
    strict_success_rate,
    success_curve,
    success_rate,
)
from pftrack_sim.score.episode import Measures, Summary, mean_summary, measure, summarise
from pftrack_sim.score.events import (
    Recovery,
    drift_per_second,
    failures,
    occlusions,
    recovered_within,
    recoveries,
    share_permanently_lost,
)
from pftrack_sim.score.frames import FrameScores, centre_errors, frame_scores, normalised_centre_errors, overlaps
from pftrack_sim.score.paired import Arm, overlaps_on_common_frames
from pftrack_sim.score.reference import DEFINITIONS, counted_frames, skill, stay_overlaps
from pftrack_sim.score.statistics import (
    Comparison,
    RankAgreement,
    bootstrap_interval,
    compare,
    holm,
    paired_difference,
    proportion_interval,
    rank_agreement,
    rank_correlation,
    win_matrix,
)

__all__ = [
    "DEFINITIONS",
    "LOOSE_OVERLAP",
    "NORMALISED_PRECISION_THRESHOLDS",
    "PRECISION_PX",
    "PRECISION_THRESHOLDS_PX",
    "SUCCESS_OVERLAP",
    "SUCCESS_THRESHOLDS",
    "Arm",
    "Ceiling",
    "Comparison",
    "FrameScores",
    "Measures",
    "RankAgreement",
    "Recovery",
    "Summary",
    "area_under_success",
    "average_overlap",
    "bootstrap_interval",
    "centre_errors",
    "compare",
    "counted_frames",
    "drift_per_second",
    "failures",
    "fixed_shape_ceiling",
    "frame_scores",
    "holm",
    "mean_summary",
    "measure",
    "normalised_centre_errors",
    "normalised_precision",
    "occlusions",
    "overlaps",
    "overlaps_on_common_frames",
    "paired_difference",
    "precision",
    "precision_curve",
    "proportion_interval",
    "rank_agreement",
    "rank_correlation",
    "recovered_within",
    "recoveries",
    "share_permanently_lost",
    "skill",
    "stay_overlaps",
    "strict_success_rate",
    "success_curve",
    "success_rate",
    "summarise",
    "win_matrix",
]
