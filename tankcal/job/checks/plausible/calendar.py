"""Days of the survey and of issue, against today's."""

import datetime

from tankcal.job.checks.common import tell
from tankcal.job.plausibility import DAYS_AHEAD, DAYS_TO_ISSUE, FIRST_YEAR
from tankcal.messages import message


def check_dates(values, raw, log):
    """A survey lies in the past, and not before tanks were calibrated; an issue is near."""
    today = datetime.date.today()
    surveyed = _day(values["survey"]["date"])
    if surveyed is not None and not (
        surveyed.year >= FIRST_YEAR and (surveyed - today).days <= DAYS_AHEAD
    ):
        text = message(
            "survey_date_impossible",
            "found {found}; expected a day from the year {first} to today, {today}",
            found=surveyed.isoformat(),
            first=str(FIRST_YEAR),
            today=today.isoformat(),
        )
        tell(log.problem, raw, "survey", "date", text)
    issued = _day(values["certificate"].get("date_of_issue"))
    if issued is not None and (issued - today).days > DAYS_TO_ISSUE:
        text = message(
            "issue_date_far",
            "{found} is {days} days from today: is the year right?",
            found=issued.isoformat(),
            days=(issued - today).days,
        )
        tell(log.warning, raw, "certificate", "date_of_issue", text)


def _day(text):
    return None if text is None else datetime.date.fromisoformat(text)
