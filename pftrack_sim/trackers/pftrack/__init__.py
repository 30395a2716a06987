"""The project's own tracker: a correlation filter with colour, scale, camera motion and an occlusion test."""
