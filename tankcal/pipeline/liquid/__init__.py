"""Calibration by metered liquid: its adjustment with the geometry of the tank."""
