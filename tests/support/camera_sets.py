"""Calibrations of a camera that differ a little, by names that paper must show literally."""

import numpy as np

from tankcal.calibration.stability.fits import Grid
from tankcal.camera.model import Form
from tankcal.survey.measurements import CameraSetup
from tankcal.survey.network.survey import Camera

HOSTILE = ("=1+1", "<b>bold</b>", "#typst [x] *a*", "$x$ _y_", "n" * 60, "@cmd|' /C calc'!A0")
Q = np.array([4.4, 0.03, -0.02, -2e-3, 3e-5, 1e-6, 0, 8e-4, -6e-4, 0, 0, 8e-5, -5e-5])
SD = np.array([1e-3, 4e-4, 4e-4, 7e-5, 1e-5, 1e-6, np.nan, 7e-6, 7e-6, np.nan, np.nan, 1e-5, 1e-5])
PIXEL_MM = np.array([0.0013, 0.0013])
SMALL = Grid(12, 9, (192.0, 192.0), 384.0)


def sets(names):
    """Calibrations of those names, each a little different from the first; the first twice."""
    steps = np.arange(len(names)) - (np.arange(len(names)) > 0)
    return [
        CameraSetup(
            Camera(Q * (1 + 0.02 * step), Form("correction_subtracted", "both_x"), SD, name=name),
            np.array([4608, 3456]) * PIXEL_MM,
            PIXEL_MM,
        )
        for name, step in zip(names, steps, strict=True)
    ]
