"""Run episodes: rollouts, worker processes, clusters."""
