"""Planning of occluders: where they stand, and how pedestrians and carts cross the line of sight."""
