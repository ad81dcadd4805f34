"""The network: everything that was observed on site, in one adjustment."""

from tankcal.network.adjusting import adjust
from tankcal.network.results import Adjusted
from tankcal.network.survey import Camera, ImagePoints, Instrument, Photos, Survey, System

__all__ = [
    "Adjusted",
    "Camera",
    "ImagePoints",
    "Instrument",
    "Photos",
    "Survey",
    "System",
    "adjust",
]
