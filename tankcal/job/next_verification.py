"""Last day of the next verification, for the certificate: of a named rule, or of the customer.

A certificate has no recommendation of a calibration interval of the laboratory's own.
"""

from datetime import date

from tankcal.job.model.settings import NextVerification
from tankcal.job.rule_files import find_rule
from tankcal.messages import message

_KEY = "certificate.next_verification_rule"
_LYING = ("horizontal", "inclined")
_KINDS = {  # kinds of tank in the terms of the rules: without, and with a floating roof
    "vertical": (("vertical_fixed_roof",), ("vertical_floating_roof",)),
    "horizontal": (_LYING, _LYING),
    "sphere": (("sphere",), ("sphere",)),
    "mesh": (("other",), ("other",)),
}


def read_next_verification(raw, values, log):
    """Return the next verification of a job, and the fingerprint of a rule beside the job.

    Parameters
    ----------
    raw : RawJob
    values : dict of {str: dict}
        {section: {key: value}} of the settings.
    log : Log
        Receives the problems; also a warning for a rule that was not compared with its text, whose
        date no certificate states.

    Returns
    -------
    tuple of (NextVerification or None, tuple or None)
    """
    certificate = values["certificate"]
    wished, name = certificate["next_verification"], certificate["next_verification_rule"]
    if name is None:
        return (None if wished is None else NextVerification(str(wished))), None
    row = raw.settings["certificate"]["next_verification_rule"].row
    if wished is not None:
        expected = message(
            "two_next_verifications",
            "given together with next_verification; expected the rule or the date for which the "
            "customer asked",
        )
        log.problem(raw.settings_file, expected, row, _KEY)
        return None, None
    named = find_rule(raw, name, log, _KEY)
    day = values["survey"]["date"]
    if named is None or day is None or values["tank"]["kind"] is None:
        return None, None
    rule, file = named
    period = _shortest_period(rule, values)
    if period is None:
        text = message(
            "no_period_for_tank",
            "the rule has no period for the whole of a tank of this kind; the certificate states "
            "no date",
        )
    elif not period.verified:
        text = message(
            "period_not_read",
            "the period of the rule was not compared with its text; the certificate states no date",
        )
    else:
        last = _add_years(date.fromisoformat(str(day)), period.years)
        return NextVerification(str(last), rule.name, period.clause, period.years), file
    log.warning(raw.settings_file, text, row, _KEY)
    return None, file


def _shortest_period(rule, values):
    """Return the shortest Period of the whole tank, or None."""
    has_roof = values["roof"]["mass_kg"] is not None
    kinds = _KINDS[values["tank"]["kind"]][has_roof]
    periods = [
        period
        for period in rule.periods
        if period.of == "all" and (not period.tanks or set(kinds) & set(period.tanks))
    ]
    return min(periods, key=lambda period: period.years, default=None)


def _add_years(day, years):
    """Return the day after a number of years; fractions of a year count as whole months."""
    months = day.month - 1 + round(12 * years)
    year, month = day.year + months // 12, months % 12 + 1
    last_of_month = (date(year + month // 12, month % 12 + 1, 1) - date(year, month, 1)).days
    return date(year, month, min(day.day, last_of_month))
