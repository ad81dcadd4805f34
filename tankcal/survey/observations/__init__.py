"""Kinds of observation: their equations and derivatives."""

from tankcal.survey.observations.base import NUISANCES, Layout, Observations, State
from tankcal.survey.observations.coordinates import (
    ControlCoordinates,
    HeightDifferences,
    KnownUnknowns,
    PlumbLines,
    SystemCoordinates,
    Vectors,
)
from tankcal.survey.observations.correlated import Block, Correlated
from tankcal.survey.observations.kinds import KINDS, Kind
from tankcal.survey.observations.photographs import (
    HeldOrientation,
    ImageCoordinates,
    PhotoOrientation,
    PhotoRotation,
)
from tankcal.survey.observations.sights import (
    Azimuths,
    Directions,
    Distances,
    HorizontalAngles,
    Sights,
    VerticalAngles,
)
from tankcal.survey.observations.trace import Source, Trace

__all__ = [
    "KINDS",
    "NUISANCES",
    "Azimuths",
    "Block",
    "ControlCoordinates",
    "Correlated",
    "Directions",
    "Distances",
    "HeightDifferences",
    "HeldOrientation",
    "HorizontalAngles",
    "ImageCoordinates",
    "Kind",
    "KnownUnknowns",
    "Layout",
    "Observations",
    "PhotoOrientation",
    "PhotoRotation",
    "PlumbLines",
    "Sights",
    "Source",
    "State",
    "SystemCoordinates",
    "Trace",
    "Vectors",
    "VerticalAngles",
]
