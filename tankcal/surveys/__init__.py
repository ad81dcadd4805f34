"""Surveys: from what was measured on site to adjusted points with their covariance."""

from tankcal.surveys.adjusting import adjust_survey
from tankcal.surveys.dependence import Dependence, datum_dependence
from tankcal.surveys.predicting import Nominal, Predicted, predict_survey
from tankcal.surveys.results import Adjustment, Cause, Reading
from tankcal.surveys.walls import wall_points

__all__ = [
    "Adjustment",
    "Cause",
    "Dependence",
    "Nominal",
    "Predicted",
    "Reading",
    "adjust_survey",
    "datum_dependence",
    "predict_survey",
    "wall_points",
]
