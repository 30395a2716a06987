"""Names of trackers as parts of topics and paths in logs."""

from __future__ import annotations

import re
from collections.abc import Iterable


def topics_of(labels: Iterable[str], prefix: str = "/trackers/") -> dict[str, str]:
    """A topic for each label, all different: letters, digits and underscores only, as ROS 2 demands.

    >>> topics_of(["ko2012[alpha=0.3]", "2d", "2d!"])
    {'ko2012[alpha=0.3]': '/trackers/ko2012_alpha_0_3', '2d': '/trackers/t2d', '2d!': '/trackers/t2d_2'}
    """
    topics: dict[str, str] = {}
    for label in labels:
        name = re.sub(r"[^A-Za-z0-9]+", "_", label).strip("_") or "tracker"
        topic = prefix + (f"t{name}" if name[0].isdigit() else name)
        count = sum(1 for taken in topics.values() if taken == topic or re.fullmatch(rf"{topic}_\d+", taken))
        topics[label] = topic if not count else f"{topic}_{count + 1}"
    return topics
