"""Report of a run folder: one HTML page that opens from disk with its videos beside it, and figures for papers."""

from pftrack_sim.report.build import write_report, write_scored
from pftrack_sim.report.comparison import write_comparison
from pftrack_sim.report.figure import FIGURES, write_figure

__all__ = ["FIGURES", "write_comparison", "write_figure", "write_report", "write_scored"]
