"""Appearance models without any knowledge of filters: features of boxes in an image, and their similarity."""
