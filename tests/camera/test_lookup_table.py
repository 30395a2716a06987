"""A table looked up at every pixel."""

import numpy as np

from pftrack_sim.camera.lookup_table import look_up


def test_it_is_the_table_at_every_pixel():
    rng = np.random.default_rng(0)
    table = rng.integers(0, 256, 65536, dtype=np.uint8)
    wanted = rng.integers(0, 65536, (7, 5, 3), dtype=np.uint16)
    wanted[0, 0] = 0, 65535, 1
    assert (look_up(wanted, table) == table[wanted]).all()
    assert look_up(wanted, table).shape == wanted.shape
