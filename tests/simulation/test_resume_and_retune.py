"""An episode that begins later, or whose camera changes on the way."""

import numpy as np
import pytest

from pftrack_sim import scenario as scenarios
from pftrack_sim.core.errors import ScenarioError
from pftrack_sim.core.records import Frame
from pftrack_sim.simulation.simulation import LIVE_AXES, Simulation

SMALL = {"camera.width_px": 96, "camera.height_px": 72, "duration_s": 2.0}


def equal(one: Frame, other: Frame) -> bool:
    same = np.array_equal(one.image, other.image) and one.people == other.people
    return same and one.index == other.index and one.time_s == other.time_s


@pytest.mark.parametrize(
    "axes",
    [
        pytest.param({}, marks=pytest.mark.slow),
        {"axes.blur.severity": 1.0, "axes.jitter.severity": 1.0, "axes.noise.severity": 0.5},
        {"axes.light.severity": 1.0, "axes.light.at_s": 0.1},
        {"axes.stream.severity": 2.0},
    ],
)
def test_an_episode_resumed_later_has_the_frames_of_one_that_was_rendered(axes: dict[str, float]):
    scenario = scenarios.load("easy/corridor", {**SMALL, **axes})
    drive, nothing = np.array([0.4, 0.1, -0.2, 0.0]), np.zeros(4)
    commands: list[np.ndarray | None] = []
    with Simulation(scenario) as whole, Simulation(scenario) as later:
        frame = whole.reset(3)
        for step in range(8):
            command = (None, drive, nothing)[step % 3]
            before = whole.periods
            frame = whole.advance(command)
            commands += [command] * (whole.periods - before)
        assert equal(later.resume(3, commands), frame)
        for command in (drive, None):
            assert equal(later.advance(command), whole.advance(command))
        assert np.array_equal(later.world.data.qpos, whole.world.data.qpos)


def test_resuming_at_nothing_is_a_reset():
    scenario = scenarios.load("easy/corridor", SMALL)
    with Simulation(scenario) as one:
        assert equal(one.reset(1), one.resume(1, []))


@pytest.mark.slow
def test_a_retuned_axis_acts_from_the_next_frame_and_the_base_returns_to_the_bit():
    # Without a road: the suspension would remember it.
    base = scenarios.load("easy/corridor", {**SMALL, "axes.jitter.sources": ["wind", "ground"]})
    base = scenarios.load(base, {"axes.jitter.severity": 0.0})
    with Simulation(base) as plain, Simulation(base) as tuned:
        plain.reset(2), tuned.reset(2)
        for axis in LIVE_AXES:
            tuned.retune(scenarios.load(base, {f"axes.{axis}.severity": 3.0}), 2)
            before, after = plain.advance(), tuned.advance()
            while after.time_s > before.time_s + 1e-9:  # the link has lost frames
                before = plain.advance()
            assert not np.array_equal(before.image, after.image), axis
            assert np.array_equal(plain.world.data.qpos, tuned.world.data.qpos)
            tuned.retune(base, 2)
            assert np.array_equal(plain.advance().image, tuned.advance().image), axis
            assert equal(plain.advance(), tuned.advance()), axis


def test_the_last_frame_stays_as_it_was_until_the_next():
    base = scenarios.load("easy/corridor", SMALL)
    with Simulation(base, image=False) as plain, Simulation(base, image=False) as simulation:
        plain.reset(2), simulation.reset(2)
        alone, frame = plain.advance(), simulation.advance()
        depth_m, seen = simulation.depth(), set(simulation.silhouettes)
        simulation.retune(scenarios.load(base, {"axes.distortion.severity": 1.0}), 2)
        assert "target" in seen
        assert set(simulation.silhouettes) == seen
        assert np.array_equal(simulation.depth(), depth_m)
        assert np.array_equal(simulation.frame.truth.box, frame.truth.box)
        simulation.advance()
        assert not np.array_equal(simulation.depth(), depth_m)
        # Everybody is found when asked for, here after the change.
        assert [one.box.tolist() for one in frame.people] == [one.box.tolist() for one in alone.people]


def test_what_is_compiled_into_the_world_cannot_be_retuned():
    base = scenarios.load("easy/corridor", SMALL)
    with Simulation(base) as simulation:
        frame = simulation.reset(2)
        with pytest.raises(ScenarioError, match="only jitter, blur"):
            simulation.retune(scenarios.load(base, {"axes.occlusion.severity": 1.0, "axes.occlusion.end_s": 1.5}), 2)
        assert simulation.frame is frame
