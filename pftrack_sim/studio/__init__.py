"""A live view of an episode in the browser, whose settings change while it runs (`pftrack-sim studio`)."""

from pftrack_sim.studio.serve import Studio
from pftrack_sim.studio.session import Moment, Session
from pftrack_sim.studio.settings import Settings

__all__ = ["Moment", "Session", "Settings", "Studio"]
