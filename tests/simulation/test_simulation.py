"""Laws of the episode loop."""

import mujoco
import pytest

from pftrack_sim import scenario
from pftrack_sim.simulation import Simulation

SMALL = {"camera.width_px": 64, "camera.height_px": 48, "lights.shadows": False, "distractors.count": 0}
LOSSY = {**SMALL, "duration_s": 2.0, "axes.stream": {"severity": 1.0, "dropped_share": 0.5, "jpeg_quality": 100}}


def test_a_collision_in_a_lost_frame_is_reported_with_the_next_delivered_frame(monkeypatch: pytest.MonkeyPatch):
    with Simulation(scenario.load("plaza-walk", LOSSY)) as simulation:
        last_s = simulation.reset(1).time_s
        period_s = 1.0 / simulation.settings.camera.rate_hz

        def collision_in_first_period(data: mujoco.MjData) -> str | None:
            return "pillar-1" if simulation.world.time_s < last_s + 0.5 * period_s else None

        monkeypatch.setattr(simulation.world.robot, "collision", collision_in_first_period)
        lost = 0
        while simulation.frame.index + 1 < simulation.frame_count:
            frame = simulation.advance()
            assert simulation.collision() == "pillar-1"
            lost += round((frame.time_s - last_s) / period_s) - 1
            last_s = frame.time_s
        assert lost > 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_an_occluder_covers_the_target_at_its_time_whatever_the_operator_does(seed: int):
    operator = {"character": "hasty", "glances_per_minute": 0.0}
    walker = {"kind": "walker", "at_s": 5.0, "duration_s": 0.8}
    loaded = scenario.load(
        "easy/plaza-walk", {**SMALL, "robot.operator": operator, "occluders": [walker], "duration_s": 6.5}
    )
    states = {}
    with Simulation(loaded) as simulation:
        frame = simulation.reset(seed)
        for _ in range(simulation.frame_count - 1):
            frame = simulation.advance()
            states[round(frame.time_s, 2)] = frame.truth.visible_fraction
    covered = [time_s for time_s, visible in states.items() if visible < 0.5]
    assert 4.7 < min(covered) < 5.2
    assert 5.6 < max(covered) < 6.1
