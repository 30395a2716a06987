"""What all tests share."""

from hypothesis import settings

# A machine may be busy: how long an example takes says nothing about the code.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")
