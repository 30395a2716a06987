"""What all tests share."""

import os

from hypothesis import settings

# A machine may be busy: how long an example takes says nothing about the code.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

if "PYTEST_XDIST_WORKER" in os.environ:
    # Tests side by side already keep every core busy: Mesa's software rasteriser draws in the thread that asks.
    os.environ.setdefault("LP_NUM_THREADS", "0")
