"""Segmentations without OpenGL and without colours, drawn by the processor."""
