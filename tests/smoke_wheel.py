"""One step of every environment and shipped scenario, run against an installed wheel from outside the checkout."""

import gymnasium as gym

import pftrack_sim
from pftrack_sim import scenario

names = scenario.names()
assert names, "the wheel ships no scenario"
for name in names:
    for kind in ("Track-v0", "Follow-v0", "TrackAndFollow-v0"):
        env = gym.make(f"pftrack_sim/{kind}", scenario=name)
        env.reset(seed=0)
        env.step(env.action_space.sample())
        env.close()
    print(f"{name}: reset and stepped")
print(f"pftrack_sim {pftrack_sim.__version__}: {len(names)} scenarios from {pftrack_sim.__file__}")
