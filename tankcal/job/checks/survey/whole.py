"""All checks of the files of a survey, in the order of their reports."""

from tankcal.job.checks.survey.cameras import check_cameras, check_depth_of_field
from tankcal.job.checks.survey.datum import check_datum, check_held, check_known
from tankcal.job.checks.survey.doubtful import check_doubtful
from tankcal.job.checks.survey.files import SurveyFiles, check_names
from tankcal.job.checks.survey.images import check_images
from tankcal.job.checks.survey.readings import (
    check_correlated,
    check_instruments,
    check_readings,
    check_stadia,
)


def check_files(values, tables, registers, raw, log, reported):
    """Check the files of a survey.

    Parameters
    ----------
    values, tables, registers, raw, log
        As for `checks.check_all`.
    reported : frozenset of (str, int)
        File and row of each problem reported before.
    """
    files = SurveyFiles(values, tables, registers, raw, log, reported)
    check_cameras(files)
    check_depth_of_field(files)
    check_instruments(files)
    check_images(files)
    check_readings(files)
    check_stadia(files)
    check_known(files)
    check_names(files)
    check_held(files)
    check_correlated(files)
    check_datum(files)
    check_doubtful(files)
