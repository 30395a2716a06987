"""What is said of results: claims of papers, comparisons of trackers, degradation over axes, profiles of videos."""
