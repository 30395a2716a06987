import numpy as np
import pytest

from pftrack_sim.core.photometry import LUMINANCE, chromaticity, tint


@pytest.mark.parametrize(
    ("kelvin", "x", "y"),
    [(2000.0, 0.5267, 0.4133), (2856.0, 0.4476, 0.4074), (4000.0, 0.3805, 0.3768), (6500.0, 0.3135, 0.3237),
     (10000.0, 0.2807, 0.2884)],
)  # fmt: skip
def test_black_bodies_lie_on_their_locus(kelvin: float, x: float, y: float):
    # Wyszecki and Stiles, "Color Science", 2nd edition, table of the Planckian locus; 2856 K is CIE illuminant A.
    assert chromaticity(kelvin) == pytest.approx((x, y), abs=1e-3)


def test_warm_light_is_red_cold_light_is_blue_and_grey_stays_as_bright():
    reds = [tint(kelvin, 6504.0)[0] for kelvin in (2000.0, 3000.0, 6504.0, 12000.0, 25000.0)]
    blues = [tint(kelvin, 6504.0)[2] for kelvin in (2000.0, 3000.0, 6504.0, 12000.0, 25000.0)]
    assert (np.diff(reds) < 0.0).all()
    assert (np.diff(blues) > 0.0).all()
    assert min(blues) > 0.0
    for kelvin in (2000.0, 3000.0, 9000.0):
        assert LUMINANCE @ tint(kelvin, 6504.0) == pytest.approx(1.0)
    assert abs(tint(6504.0, 6504.0) - 1.0).max() < 1e-12
