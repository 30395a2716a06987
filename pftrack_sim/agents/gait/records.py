"""Records of people, which the kernels of the walk and of the body read and write."""

from __future__ import annotations

from typing import Any, TypeAlias

from numpy.typing import NDArray

from pftrack_sim.core.compiled import record_type

_PERSON_FIELDS = (
    # Body [m]: segments as in `Anatomy`, the arcs of the sole, shoulder joints in the torso's frame, hips on a seat.
    # The longest reach of a leg relative to the sum of its links.
    "height_m", "pelvis_m", "torso_m", "thigh_m", "shank_m", "upper_arm_m", "hip_half_m", "ankle_m",
    "heel_x", "heel_radius", "toe_x", "toe_radius", "shoulder_x", "shoulder_half_m", "shoulder_z", "seated_m",
    # Elbow to grip.
    "reach", "grip_m",
    # Habits: roll of the upper arms outward [rad], their swing relative to other people's, forward lean [rad], rates
    # [rad/s] and phases of breathing and glances, ankles beside the line of progress walking and standing [m], and the
    # phase at which a steady walk starts.
    "arm_roll", "arm_swing", "lean", "breath_rate", "breath_phase", "glance_rate", "glance_phase",
    "walk_half_m", "stand_half_m", "start_phase",
    # Numbers of a `Posture`; 1 for running.
    "crouch", "bend", "look", "sit", "runs",
    # Of who rides: 1, and where the pelvis is ahead of and to the left of x, y [m]. 0 on foot.
    "rides", "ahead_m", "aside_m",
    # Where the body is to be at the end of the tick: x, y [m] and heading [rad].
    "to_x", "to_y", "to_heading",
    # The walk: place and heading, smoothed velocity [m/s] and turn rate [rad/s], fraction of the stride since the left
    # heel strike, stride frequency, share of running, and 1 at rest.
    "x", "y", "heading", "velocity_x", "velocity_y", "speed", "turn", "phase", "rate_hz", "running", "resting",
    # The gait at this speed: stride length (two steps), share of stance, toes-up angle at heel strike and heel-up angle
    # at toe-off [rad], lowest and highest hips, height of the sole in mid-swing, and lateral amplitude of the pelvis
    # [m], amplitude of the rotations of pelvis, trunk and arms (1 at natural speed), phase at which the body is above
    # the ankle of the flat foot, and distance of the ankles from the line of progress [m]. At the present phase, the
    # height of an upright person's hips.
    "stride_m", "stance_fraction", "heel_strike_rad", "toe_off_rad", "hip_low_m", "hip_high_m", "clearance_m",
    "sway_m", "amplitude", "mid_stance", "half_m", "hip_m",
)  # fmt: skip
PERSON = record_type([(name, "f8") for name in _PERSON_FIELDS])
"""One person: body, habits, posture, walk, and the gait at the present speed."""

FOOT = record_type(
    [
        ("toe_out", "f8"),  # yaw of the foot relative to the body [rad]
        ("in_stance", "?"),
        ("toe_off_phase", "f8"),  # at which the foot left the ground
        ("foothold_x", "f8"),  # where the foot stands, or stood before its swing [m]
        ("foothold_y", "f8"),
        ("foothold_yaw", "f8"),
        ("ankle_x", "f8"),
        ("ankle_y", "f8"),
        ("ankle_z", "f8"),
        ("yaw", "f8"),
        ("pitch", "f8"),  # toes up
    ]
)
"""One foot."""

ARM = record_type([(name, "f8") for name in ("share", "shoulder", "elbow", "outward", "forearm")])
"""An `Arm`; the share of an arm that swings is 0."""

GRIP = record_type([(name, "f8") for name in ("on", "x", "y", "z")])
"""Where a hand holds something [m], if `on` is 1."""

_PART_FIELDS = (
    "x", "y", "z", "forward_x", "left_x", "up_x", "forward_y", "left_y", "up_y", "forward_z", "left_z", "up_z",
)  # fmt: skip
PART = record_type([(name, "f8") for name in _PART_FIELDS])
"""A part of the body: its place [m] and the directions of its axes, which are columns of its rotation."""

Records: TypeAlias = NDArray[Any]

PARTS = 13
"""Parts of a body, in the order of `person.PARTS`."""
