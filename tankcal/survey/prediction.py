"""A survey predicted where it is planned: what its adjustment would give, without observations."""

from dataclasses import dataclass, replace

import numpy as np

from tankcal.errors import InputError, Problem
from tankcal.messages import message
from tankcal.survey.datum import Frame, make_frame
from tankcal.survey.network import Adjusted, predict
from tankcal.survey.network_of_survey import Gathered, gather
from tankcal.survey.start_values import finish_start_values


@dataclass(frozen=True)
class Nominal:
    """Where things will stand.

    Attributes
    ----------
    points : dict
        {name: (3,)} m, those of set-ups among them.
    photos : dict
        {name: ((3,) projection centre, (3, 3) rotation)}.
    """

    points: dict
    photos: dict


@dataclass(frozen=True)
class Predicted:
    """A survey before it is made.

    Attributes
    ----------
    adjusted : Adjusted
        network.Adjusted at the nominal values; its residuals and sigma0 mean nothing.
    gathered : Gathered
        What cannot be determined is in `aside`.
    frame : Frame
        What holds the datum.
    """

    adjusted: Adjusted
    gathered: Gathered
    frame: Frame


def predict_survey(measurements, nominal):
    """The Predicted of job.Measurements whose observed values do not matter.

    Parameters
    ----------
    nominal
        Nominal; a point or photo without a place there is an InputError.

    Raises
    ------
    SolutionError
        When the survey would not determine what is asked for, in words.
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
    """A network survey with the nominal values as its start values."""
    photos = survey.photos
    missing = [name for name in survey.points if name not in nominal.points]
    missing += [one for one in (photos.names if photos else ()) if one not in nominal.photos]
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
