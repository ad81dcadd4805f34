"""The network: everything that was observed on site, in one adjustment."""

from tankcal.network.adjusting import adjust
from tankcal.network.cleaning import Cleaned, snoop
from tankcal.network.reliability import Residuals
from tankcal.network.results import Adjusted
from tankcal.network.starting import approximate
from tankcal.network.survey import Camera, ImagePoints, Instrument, Photos, Survey, System

__all__ = [
    "Adjusted",
    "Camera",
    "Cleaned",
    "ImagePoints",
    "Instrument",
    "Photos",
    "Residuals",
    "Survey",
    "System",
    "adjust",
    "approximate",
    "snoop",
]
