"""Planning of occluders: static ones, and pedestrians and carts that cross the line of sight."""
