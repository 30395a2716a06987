"""Human gait: from positions on the ground to poses of body parts."""
