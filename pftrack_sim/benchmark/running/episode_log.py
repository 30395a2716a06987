"""A log of an episode as a sink of its rollout."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from pftrack_sim.benchmark.kept.files import atomic_write
from pftrack_sim.benchmark.running.rollout import Sink, Step
from pftrack_sim.benchmark.running.tracker_runner import TrackerRunner
from pftrack_sim.logs import LogFrame, LogInfo, log_format, log_writer
from pftrack_sim.scenario import ResolvedScenario


@contextmanager
def episode_log(path: Path, name: str, settings: ResolvedScenario, runners: Sequence[TrackerRunner]) -> Generator[Sink]:
    """Write a log of an episode; the file appears under its name when it is complete.

    Args:
        path: File to write; its suffix gives the format.
        name: Of the episode, for people.
        settings: The resolved scenario.
        runners: The trackers.

    Yields:
        A sink for samples with proprioception and robot pose.

    Raises:
        ParameterError: No format has this suffix.
        RunError: The format's library is missing, or the file cannot be written.
    """
    robot = settings.robot
    turn, pan, tilt = (math.radians(one) for one in (robot.max_turn_deg_s, robot.max_pan_deg_s, robot.max_tilt_deg_s))
    labels = tuple(runner.spec.label for runner in runners)
    info = LogInfo(name, settings.camera.rate_hz, labels, (robot.max_speed_m_s, turn, pan, tilt))
    form = log_format(path)
    with atomic_write(path) as part, log_writer(form, part, info) as add:

        def sink(step: Step) -> None:
            sample = step.sample
            assert sample.frame is not None
            add(
                LogFrame(
                    sample.frame,
                    sample.info["robot_pose"],
                    np.asarray(sample.observation["proprio"], dtype=np.float64),
                    {runner.spec.label: runner.estimates[-1] for runner in runners},
                    {runner.spec.label: runner.ms[-1] for runner in runners},
                    None if step.info is None else np.asarray(step.info["command"], dtype=np.float64),
                )
            )

        yield sink
