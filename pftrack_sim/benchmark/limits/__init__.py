"""Breaking points: which level of a stress axis a tracker can take, by a run that chooses its own episodes."""
