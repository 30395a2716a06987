"""Closed loop: the tracker drives the robot that carries the camera, so overlap and following belong to one episode."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pftrack_sim import controllers, policies
from pftrack_sim.benchmark.drive_log import Log, Shown
from pftrack_sim.benchmark.plan import Episode
from pftrack_sim.benchmark.tracker_runner import TrackerRun
from pftrack_sim.benchmark.video import VideoWriter
from pftrack_sim.core.errors import TrackerError
from pftrack_sim.core.records import Estimate, Image, Truth
from pftrack_sim.env import TrackAndFollowEnv
from pftrack_sim.env.base import checked_command
from pftrack_sim.render.overlay import draw_frame

STANDING = {"box": np.zeros(4), "command": np.zeros(4)}
"""What is answered from the first failure on."""


class _Asked:
    """A contest's entry as the tracker of a policy: it is asked only for the frames that it takes."""

    def __init__(self, entry: TrackerRun) -> None:
        self.entry = entry
        self._truth: NDArray[np.float64] = np.zeros(4)

    def receive_truth(self, box: ArrayLike) -> None:
        """The true box, for a tracker that asks for it."""
        self._truth = np.asarray(box, dtype=np.float64)

    def init(self, image: Image, box: ArrayLike) -> None:
        """See `Tracker`."""
        self._truth = np.asarray(box, dtype=np.float64)
        self.update(image)

    def update(self, image: Image) -> Estimate:
        """See `Tracker`.

        Raises:
            TrackerError: It failed.
        """
        said = self.entry.see(image, self._truth, True)
        if said is None:
            raise TrackerError((self.entry.failure or "").partition(": ")[2])
        return said


def drive(
    episode: Episode, entry: TrackerRun, video: Path | None, backend: str | None, on_frame: Callable[[], None]
) -> Shown:
    """Drive an episode with its only tracker.

    What the tracker or the controller does wrong is written down; from there on the robot stands still.

    Args:
        episode: Which.
        entry: Its tracker, fresh.
        video: MP4 to write, or None.
        backend: Renderer, by name.
        on_frame: Called after every frame.
    """
    (contestant,) = episode.trackers
    assert contestant.controller is not None
    charged = episode.condition.latency_ms
    latency_ms = contestant.latency_ms if charged is None else charged
    with ExitStack() as open_things:
        env = TrackAndFollowEnv(episode.scenario, backend=backend)
        open_things.callback(env.close)
        observation, info = env.reset(seed=episode.seed)
        settings = env.simulation.settings
        rig = policies.robot_parameters(settings, latency_ms)
        inner = policies.TrackAndFollowPolicy(_Asked(entry), controllers.make(contestant.controller), rig)
        policy = policies.LatencyWrapper(inner, latency_ms, settings.camera.rate_hz)
        writer = None
        if video is not None:
            writer = open_things.enter_context(VideoWriter(video, settings.camera.rate_hz))
        heard, log = TrackerRun(entry.name, entry.tracker), Log()
        truths: list[Truth] = []
        pixels = hashlib.blake2b(digest_size=16)
        while not truths or info["outcome"] is None:
            frame = env.simulation.frame
            pixels.update(np.ascontiguousarray(frame.image).data)
            action = _answer(policy, observation, info, heard, entry)
            estimate = heard.estimates[-1]
            if writer is not None:
                writer.add(draw_frame(frame, {} if estimate is None else {entry.name: estimate}))
            truths.append(frame.truth)
            pose = env.simulation.world.robot_pose()
            observation, _, _, _, info = env.step(action)
            log.add(frame.truth, pose, action, info, env.simulation.world.robot_pose())
            on_frame()
        scores = log.scores(settings.follow, env.simulation.frame_count, info)
        ran = {"controller": contestant.controller, "latency_ms": latency_ms}
        return Shown(truths, [heard], pixels.hexdigest(), env.simulation.graphics, log.table(), {**ran, **scores})


def _answer(
    policy: policies.LatencyWrapper,
    observation: dict[str, Any],
    info: dict[str, Any],
    heard: TrackerRun,
    entry: TrackerRun,
) -> dict[str, Any]:
    """The action for a frame; what counts as said of it is written down in `heard`."""
    asked, action = len(entry.ms), STANDING
    if heard.failure is None:
        try:
            action = policy(observation, info)
            checked_command(action["command"])
        except Exception as error:  # noqa: BLE001 - a stranger's controller may raise anything
            said = str(error) if entry.failure is not None else f"{type(error).__name__}: {error}"
            heard.failure, action = f"frame {len(heard.ms)}: {said}", STANDING
    failed, thought = heard.failure is not None, len(entry.ms) > asked
    heard.estimates.append(policy.estimate if entry.started and not failed else None)
    heard.ms.append(entry.ms[-1] if thought else 0.0)
    heard.statuses.append(
        "failed" if failed else entry.statuses[-1] if thought else "busy" if entry.started else "waiting"
    )
    return action
