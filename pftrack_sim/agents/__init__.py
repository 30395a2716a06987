"""Everything that moves: robot, pedestrians, carts."""
