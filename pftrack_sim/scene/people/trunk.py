"""Torso and hips as lofts.

Profiles are in statures of a person of average build, drawn by eye from anatomical charts; a person's segment lengths
and girth stretch them. Columns of a profile: height, x and y of the centre, reach to the front, back and sides.
"""

from __future__ import annotations

import numpy as np

from pftrack_sim.scene.people.anatomy import Anatomy
from pftrack_sim.scene.people.atlas import BOTTOM, TOP
from pftrack_sim.scene.people.clothes import Outfit
from pftrack_sim.scene.people.materials import cloth
from pftrack_sim.scene.people.mesh import TriangleMesh, ovals


def torso(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """Waist (the origin) to the base of the neck, in a top whose hem hangs over the trousers."""
    h, g, f, ease = anatomy.height_m, anatomy.girth, anatomy.figure, 0.0015 + 0.007 * outfit.looseness
    bust = 0.010 * f
    shoulder = anatomy.shoulder_half_m / h
    waist, hips = 1.0 - 0.10 * f, 1.0 + 0.03 * f
    belly = 0.05 * (g - 1.0)
    rows = np.array(
        [
            (-0.046, 0.000, 0.0, 0.030, 0.030, 0.050),
            (-0.050, -0.001, 0.0, 0.071 + ease, 0.074 + ease, (0.096 + ease) * hips),
            (-0.026, 0.000, 0.0, 0.067 + ease + belly, 0.067 + ease, (0.092 + ease) * hips),
            (0.010, 0.004, 0.0, 0.061 + ease + belly, 0.058 + ease, (0.085 + ease) * waist),
            (0.060, 0.002, 0.0, 0.063 + ease, 0.062 + ease, (0.089 + ease) * waist),
            (0.105, 0.000, 0.0, 0.067 + ease + bust, 0.066 + ease, 0.097 + 0.6 * ease),
            (0.140, -0.003, 0.0, 0.064 + ease + 0.7 * bust, 0.066 + ease, 0.098 + 0.4 * ease),
            (0.165, -0.006, 0.0, 0.060 + 0.5 * ease, 0.063 + ease, shoulder - 0.006),
            (0.186, -0.008, 0.0, 0.052, 0.057, shoulder + 0.005),
            (0.200, -0.009, 0.0, 0.044, 0.050, shoulder + 0.004),
            (0.210, -0.010, 0.0, 0.037, 0.042, shoulder - 0.008),
            (0.219, -0.010, 0.0, 0.034, 0.038, 0.070),
            (0.227, -0.009, 0.0, 0.033, 0.036, 0.047),
            (0.234, -0.008, 0.0, 0.0325, 0.035, 0.0365),
            (0.229, -0.008, 0.0, 0.000, 0.000, 0.000),
        ]
    )
    rows[:, 3:] *= (1.0 + 0.85 * (g - 1.0)) * h
    rows[:, 0] *= anatomy.torso_m / 0.230
    rows[:, 1] *= h
    # The shoulders' width is the skeleton's; only what lies below them grows with girth.
    rows[7:, 5] /= 1.0 + 0.85 * (g - 1.0)
    rings = ovals(rows, 14, power=2.35)
    return cloth(rings, TOP, 256.0, 0.245 * anatomy.torso_m / 0.230)


def pelvis(anatomy: Anatomy, outfit: Outfit) -> TriangleMesh:
    """Hips in trousers; the origin lies midway between the hip joints."""
    h, g, f = anatomy.height_m, anatomy.girth, anatomy.figure
    hips = 1.0 + 0.04 * f
    rows = np.array(
        [
            (0.088, 0.000, 0.0, 0.026, 0.026, 0.040),
            (0.086, 0.000, 0.0, 0.048, 0.046, 0.070),
            (0.052, 0.000, 0.0, 0.054, 0.054, 0.078 * hips),
            (0.018, -0.003, 0.0, 0.060, 0.069, 0.091 * hips),
            (-0.015, -0.006, 0.0, 0.058, 0.076, 0.096 * hips),
            (-0.038, -0.008, 0.0, 0.052, 0.070, 0.090 * hips),
            (-0.056, -0.008, 0.0, 0.042, 0.052, 0.070),
            (-0.066, -0.006, 0.0, 0.026, 0.030, 0.040),
            (-0.070, -0.004, 0.0, 0.0, 0.0, 0.0),
        ]
    )
    rows[:, 3:] *= 1.0 + 0.9 * (g - 1.0)
    rings = ovals(rows * h, 12, power=2.25)
    return cloth(rings, BOTTOM, 256.0, 0.10 * h)
