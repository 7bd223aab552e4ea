"""What a run keeps of each scene beside its scores, for figures, calibration, report and view."""
