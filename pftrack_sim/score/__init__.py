"""Scores of trackers and robots, and statistics over seeds; what other rooms use is exported here.

`frames`: overlap and errors of single frames, of a box that stays, and of several episodes on the same frames.
`curves`: success and precision of OTB, TrackingNet and GOT-10k. `events`: recoveries and drift over time.
`episode`: all measures of an episode in one row. `following`: measures of a driven robot. `statistics`: intervals,
paired comparisons. `profile`: how hard a video is.
"""

from pftrack_sim.score.curves import (
    LOOSE_OVERLAP,
    PRECISION_THRESHOLDS_PX,
    SUCCESS_THRESHOLDS,
    area_under_success,
    precision_curve,
    roc_area,
    success_curve,
)
from pftrack_sim.score.definitions import (
    DEFINITIONS,
    FOLLOWING_DEFINITIONS,
    INTERVALS,
    MEASURE_DEFINITIONS,
    PEOPLE_DEFINITIONS,
    VERDICTS,
)
from pftrack_sim.score.episode import Measures, Summary, mean_summary, measure, summarise
from pftrack_sim.score.frames import Arm, counted_frames, frame_scores, overlaps_on_common_frames, stay_overlaps
from pftrack_sim.score.statistics import (
    LEAST_FOR_INTERVAL,
    LEAST_FOR_VERDICT,
    LEVEL,
    SeedMean,
    bounds_of,
    compare,
    corrected,
    mean_over_seeds,
    paired_difference,
    proportion_over_seeds,
    skill_over_seeds,
    student_quantile,
)

__all__ = [
    "DEFINITIONS",
    "FOLLOWING_DEFINITIONS",
    "INTERVALS",
    "LEAST_FOR_INTERVAL",
    "LEAST_FOR_VERDICT",
    "LEVEL",
    "LOOSE_OVERLAP",
    "MEASURE_DEFINITIONS",
    "PEOPLE_DEFINITIONS",
    "PRECISION_THRESHOLDS_PX",
    "SUCCESS_THRESHOLDS",
    "VERDICTS",
    "Arm",
    "Measures",
    "SeedMean",
    "Summary",
    "area_under_success",
    "bounds_of",
    "compare",
    "corrected",
    "counted_frames",
    "frame_scores",
    "mean_over_seeds",
    "mean_summary",
    "measure",
    "overlaps_on_common_frames",
    "paired_difference",
    "precision_curve",
    "proportion_over_seeds",
    "roc_area",
    "skill_over_seeds",
    "stay_overlaps",
    "student_quantile",
    "success_curve",
    "summarise",
]
