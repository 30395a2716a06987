"""How well identity, colours, both and the people met tell a target from others; prints the numbers of docs/pftrack.md.

python tests/trackers/identities.py
"""

from __future__ import annotations

import numpy as np

from pftrack_sim import controllers, policies, scenario, trackers
from pftrack_sim.core import boxes
from pftrack_sim.env import TrackAndFollowEnv
from pftrack_sim.trackers.recognition.person import PROBABLY, SURE, UNSURE, KnownPerson
from pftrack_sim.trackers.recognition.pyramid import ImagePyramid
from pftrack_sim.trackers.recognition.search import ramp

COURSES, SEEDS = ("corridor", "plaza", "street", "warehouse"), range(30, 46)
AGO_S = 2.0  # People who were first seen so long ago have been met before
EVERY, FROM_S, KEPT = 4, 5.0, 0.95  # Frames, start of what counts, and share of the target's views that are kept
SIZE = {"camera.width_px": 320, "camera.height_px": 240, "camera.rate_hz": 15}


def views(name: str, seed: int) -> list[tuple[bool, float, float, bool, bool]]:
    """Of everybody in full view behind a robot that follows by the truth: whether it is the target, and likenesses.

    Then whether somebody who was met is more alike, and whether the person is one of those, or the target.
    """
    loaded = scenario.load(name, SIZE)
    env = TrackAndFollowEnv(loaded)
    robot = policies.robot_parameters(loaded.resolve(seed))
    policy = policies.TrackAndFollowPolicy(trackers.make("oracle"), controllers.make("servo-avoid"), robot)
    observation, info = env.reset(seed=seed)
    known: KnownPerson | None = None
    found: list[tuple[bool, float, float, bool, bool]] = []
    met: dict[str, tuple[float, np.ndarray]] = {}
    ended = False
    while not ended:
        frame = env.simulation.frame
        pyramid = ImagePyramid(frame.image)
        for one in frame.people if frame.index % EVERY == 0 else ():
            box, own = one.amodal_box, one.name == frame.truth.name
            if one.visible_fraction < 0.7 or one.truncation > 0.1 or box[3] < 30.0 or not (known or own):
                continue
            centre, size = boxes.centre(box), box[2:]
            if known is None:
                known = KnownPerson.found(pyramid, centre, size)
                continue
            view = known.describe(pyramid, centre, size)
            since_s, mean = met.get(one.name, (frame.time_s, view.identity))
            known._others = np.array([other / np.linalg.norm(other) for _, other in met.values()]).reshape(-1, 32)
            if frame.time_s > FROM_S:
                before = own or frame.time_s > since_s + AGO_S
                found.append((own, *known.alike(view), known.is_other(view, PROBABLY), before))
            if not own:
                met[one.name] = since_s, mean + 0.1 * (view.identity - mean)
            if own and (trust := ramp(known.likeness(view), UNSURE, SURE)) > 0.0:
                known.learn(view, trust)
        observation, _, terminated, truncated, info = env.step(policy(observation, info))
        ended = terminated or truncated
    env.close()
    return found


def main() -> None:
    """Share of the views of others above what keeps most of the target's own."""
    rows = np.array([row for course in COURSES for seed in SEEDS for row in views(f"follow/{course}", seed)])
    own = rows[:, 0] > 0.0
    print(f"{int(own.sum())} views of targets, {int((~own).sum())} of others")  # noqa: T201
    for name, likeness in (("identity", rows[:, 1]), ("colours", rows[:, 2]), ("both", rows[:, 1:3].mean(axis=1))):
        taken = (likeness[~own] >= np.quantile(likeness[own], 1.0 - KEPT)).mean()
        print(f"{name}: {100.0 * taken:.0f} % of others at {100 * KEPT:.0f} % of the own")  # noqa: T201
    before = rows[:, 4] > 0.0
    for name, which in (("others met before", ~own & before), ("the own", own)):
        print(f"{100.0 * rows[which, 3].mean():.1f} % of {int(which.sum())} views of {name} are more like somebody met")  # noqa: T201


if __name__ == "__main__":
    main()
