"""Cameras: which parameters belong, are two calibrations the same, what does a wrong one do."""

FORMAT = "tankcal-camera/1"  # of the plain data that every analysis gives
