"""Appearance models that know no filter: what a box of an image looks like, and how alike two boxes are."""
