"""Prediction of a planned survey: the covariance of its adjustment, without observations."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.survey.datum import Frame, make_frame
from tankcal.survey.network import Adjusted, predict
from tankcal.survey.network_of_survey import GatheredSurvey, gather
from tankcal.survey.start_values import finish_start_values


@dataclass(frozen=True)
class Nominal:
    """Planned positions.

    Attributes
    ----------
    points : dict
        {name: (3,) coordinates, m}, including the set-ups.
    photos : dict
        {name: ((3,) projection centre, m, (3, 3) rotation)}.
    """

    points: dict
    photos: dict


@dataclass(frozen=True)
class Predicted:
    """Prediction of a survey.

    Attributes
    ----------
    adjusted : Adjusted
        network.Adjusted at the nominal values; its residuals and sigma0 have no meaning.
    gathered : GatheredSurvey
        Its `aside` lists points that cannot be determined.
    frame : Frame
        Datum of the survey.
    """

    adjusted: Adjusted
    gathered: GatheredSurvey
    frame: Frame


def predict_survey(measurements, nominal):
    """Predict the adjustment of a planned survey; observed values are ignored.

    Parameters
    ----------
    measurements : Measurements
    nominal : Nominal
        Planned positions.

    Returns
    -------
    Predicted

    Raises
    ------
    InputError
        If a point or photo has no nominal position.
    SolutionError
        If the survey does not determine the unknowns.
    """
    gathered = gather(measurements)
    if not gathered.survey.points:
        raise InputError(
            Problem(
                "plan.toml", message("no_observations_planned", "the survey has no observations")
            )
        )
    survey = finish_start_values(place_at_nominal(gathered.survey, nominal), gathered, measurements)
    frame = make_frame(survey, gathered, measurements.settings)
    return Predicted(predict(frame.survey, **frame.options), gathered, frame)


def place_at_nominal(survey, nominal):
    """Return a network survey with nominal values as start values."""
    photos = survey.photos
    missing = [name for name in survey.points if name not in nominal.points]
    missing += [
        name_of_photo
        for name_of_photo in (photos.names if photos else ())
        if name_of_photo not in nominal.photos
    ]
    if missing:
        expected = f"no nominal place is known of {', '.join(missing[:5])}"
        raise InputError(Problem("plan.toml", expected))
    xyz = np.array([nominal.points[name] for name in survey.points], dtype=float)
    changes = {"xyz_m": xyz, "sets": np.zeros(len(survey.sets))}
    if photos is not None:
        places = [nominal.photos[name] for name in photos.names]
        changes["photos"] = replace(
            photos,
            xyz_m=np.array([xyz for xyz, _ in places], dtype=float),
            rotation=np.array([rotation for _, rotation in places], dtype=float),
        )
    return replace(survey, **changes)
