import numpy as np
import pytest

from pftrack_sim.agents.clock import Clock
from pftrack_sim.agents.robot.robot import CommandDelay

CLOCK = Clock.for_rate(30.0)


@pytest.mark.parametrize("latency_ms", [0.0, 2.0, 20.0, 100.0 / 3.0, 55.0, 120.0])
@pytest.mark.parametrize("delay_s", [0.0, 0.007, 0.03])
def test_commands_are_delayed_by_the_latency_and_the_delay_within_the_tick(latency_ms: float, delay_s: float):
    delay = CommandDelay(CLOCK, latency_ms)
    numbers: list[float] = []
    for tick in range(12):
        for steps, speeds in delay.segments((tick + 1.0, 0.0, 0.0, 0.0), delay_s):
            numbers += [speeds[0] - 1.0] * steps
    delay_steps = round(latency_ms * 1e-3 / CLOCK.step_s) + round(delay_s / CLOCK.step_s)
    # Number of the command in force at each physics step; -1 before the first.
    undelayed = np.arange(12 * CLOCK.steps) // CLOCK.steps
    np.testing.assert_array_equal(numbers, np.concatenate([np.full(delay_steps, -1), undelayed])[: undelayed.size])
