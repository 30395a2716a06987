"""A run folder as a page worth reading: one HTML file that opens from disk, videos beside it, figures for papers."""

from pftrack_sim.report.build import write_report
from pftrack_sim.report.figure import FIGURES, write_figure

__all__ = ["FIGURES", "write_figure", "write_report"]
