"""Inspection by the calibration survey: plumbness, roundness, peaking and settlement with U."""
