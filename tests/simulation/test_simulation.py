"""Laws of the episode loop."""

import mujoco
import pytest

from pftrack_sim import scenario
from pftrack_sim.simulation import Simulation

LOSSY = {
    "duration_s": 2.0,
    "camera.width_px": 64,
    "camera.height_px": 48,
    "lights.shadows": False,
    "distractors.count": 0,
    "axes.stream": {"severity": 1.0, "dropped_share": 0.5, "jpeg_quality": 100},
}


def test_a_collision_in_a_lost_frame_is_reported_with_the_next_delivered_frame(monkeypatch: pytest.MonkeyPatch):
    with Simulation(scenario.load("plaza-walk", LOSSY)) as simulation:
        last_s = simulation.reset(1).time_s
        drive, period_s = simulation.world.robot.drive, 1.0 / simulation.settings.camera.rate_hz

        def collision_in_first_period(data: mujoco.MjData) -> str | None:
            return "pillar-1" if simulation.world.time_s < last_s + 0.5 * period_s else None

        monkeypatch.setattr(drive, "collision", collision_in_first_period)
        lost = 0
        while simulation.frame.index + 1 < simulation.frame_count:
            frame = simulation.advance()
            assert simulation.collision() == "pillar-1"
            lost += round((frame.time_s - last_s) / period_s) - 1
            last_s = frame.time_s
        assert lost > 0
