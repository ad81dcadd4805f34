"""Surveys: from what was measured on site to adjusted points with their covariance."""

from tankcal.survey.adjustment import adjust_survey
from tankcal.survey.prediction import Nominal, Predicted, predict_survey
from tankcal.survey.results import Adjustment, Cause, Dependence, Reading, datum_dependence
from tankcal.survey.wall import wall_points

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
