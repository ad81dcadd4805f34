"""Plausibility of dates and of the heights of bottom, dip plate, shell top and reference point."""

import datetime

import numpy as np

from tankcal.job.checking import has_rows, places_of, tell
from tankcal.job.checks.settings import bottoms_z
from tankcal.job.contract.bottom import STEEP_FACTOR
from tankcal.job.plausibility import (
    DAYS_AHEAD,
    DAYS_TO_ISSUE,
    DIP_PLATE,
    DIP_PLATE_M,
    FIRST_YEAR,
    RIM,
    RIM_MISS_M,
    SLOPE_UP,
    TOP_MISS_M,
    YEARS_PLANNED,
    reference_doubt,
)
from tankcal.messages import message

# Dates of survey and issue, compared with today.


def check_dates(values, raw, log):
    """Check the dates of survey and issue.

    A survey lies in the past, after the first tank calibrations; a planned survey may lie in the
    future. The date of issue is close to today.
    """
    today = datetime.date.today()
    surveyed = _day(values["survey"]["date"])
    is_late = surveyed is not None and (surveyed - today).days > DAYS_AHEAD
    if raw.is_planned and is_late:
        if surveyed.year > today.year + YEARS_PLANNED:
            text = message(
                "survey_date_far",
                "found {found}; expected a day within {years} years of today, {today}",
                found=surveyed.isoformat(),
                years=YEARS_PLANNED,
                today=today.isoformat(),
            )
            tell(log.problem, raw, "survey", "date", text)
    elif is_late or (surveyed is not None and surveyed.year < FIRST_YEAR):
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


MIN_RIM = 6  # smallest number of bottom points near the wall


def check_levels(values, tables, extent, kind, raw, log):
    """Check the heights of the datum; parameters as for `checks.check_tank`."""
    _check_dip_plate(values, tables, extent, kind, raw, log)
    _check_reference(values, extent, raw, log)
    if kind == "vertical":
        _check_top(values, raw, log)
        _check_slope(values, raw, log)
        if has_rows(tables["bottom"]):
            _check_rim(values, tables["bottom"], log)


def _check_reference(values, extent, raw, log):
    reference = values["datum"]["reference_height_m"]
    if None in (reference, extent.top_m):
        return
    text = reference_doubt(reference, extent.top_m, values["tank"]["nominal_diameter_m"])
    if text is not None:
        tell(log.warning, raw, "datum", "reference_height_m", text)


def _check_dip_plate(values, tables, extent, kind, raw, log):
    plate, bottoms = values["datum"]["dip_plate_z_m"], bottoms_z(values, tables, kind)
    if plate is None or not bottoms:
        return
    away = max(plate - max(bottoms), min(bottoms) - plate)
    most = DIP_PLATE_M
    if kind in ("horizontal", "sphere") and extent.height_m is not None:
        most = min(most, DIP_PLATE * extent.height_m)
    if away > most * (1 + 1e-9):
        text = message(
            "dip_plate_far",
            "{away_m:.3g} m from the bottom, expected at most {most_m:.3g} m: all dips of "
            "the table count from it",
            away_m=away,
            most_m=most,
        )
        tell(log.warning, raw, "datum", "dip_plate_z_m", text)


def _check_top(values, raw, log):
    top, bottom = values["checks"]["top_z_m"], values["datum"]["bottom_z_m"]
    height = values["tank"]["nominal_height_m"]
    if None in (top, bottom, height) or abs(bottom + height - top) <= TOP_MISS_M:
        return
    text = message(
        "top_not_met",
        "with tank.nominal_height_m = {height_m:g} m the shell ends at z = {end_m:.4g} m, "
        "checks.top_z_m is {top_m:.4g} m: they differ by {miss_m:+.3f} m",
        height_m=height,
        end_m=bottom + height,
        top_m=top,
        miss_m=bottom + height - top,
    )
    tell(log.warning, raw, "datum", "bottom_z_m", text)


def _check_slope(values, raw, log):
    """Compare the slope of a bottom with the drawing, or with the steepest usual slope."""
    centre, edge = values["bottom"]["centre_z_m"], values["datum"]["bottom_z_m"]
    diameter, declared = values["tank"]["nominal_diameter_m"], values["checks"]["bottom_slopes"]
    if None in (centre, edge) or centre == edge:
        return
    found = "up" if centre > edge else "down"
    if declared is not None and declared != found:
        text = message(
            "bottom_slopes_otherwise",
            "{rise_m:+.3g} m from the edge (datum.bottom_z_m), so the bottom slopes {found} "
            "to its centre, but checks.bottom_slopes is {drawn}; expected both to agree",
            rise_m=centre - edge,
            found=found,
            drawn=declared,
        )
        tell(log.problem, raw, "bottom", "centre_z_m", text)
    elif declared is None and diameter is not None and centre - edge > SLOPE_UP * diameter / 2:
        text = message(
            "bottom_rises_much",
            "{rise_m:+.3g} m from the edge (datum.bottom_z_m), which is steep for a bottom that "
            "slopes up to its centre: does it slope down? Then say so in checks.bottom_slopes",
            rise_m=centre - edge,
        )
        tell(log.warning, raw, "bottom", "centre_z_m", text)

    elif declared is None and (diameter is None or abs(centre - edge) <= STEEP_FACTOR * diameter):
        text = message(  # a steeper bottom is reported elsewhere
            "bottom_slopes_unsaid",
            "blank; the bottom slopes {found} to its centre by {rise_m:.3g} m, and no other "
            "entry confirms it; expected up or down, as on the drawing",
            found=found,
            rise_m=abs(centre - edge),
        )
        tell(log.warning, raw, "checks", "bottom_slopes", text)


def _check_rim(values, table, log):
    """Compare bottom points near the wall with the bottom of the shell."""
    edge, diameter = values["datum"]["bottom_z_m"], values["tank"]["nominal_diameter_m"]
    xyz = places_of(table)
    if None in (edge, diameter) or len(xyz) < MIN_RIM or table.columns["x_m"] is None:
        return
    low, high = xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)
    is_near_wall = np.hypot(*(xyz[:, :2] - (low + high) / 2).T) > RIM * diameter / 2
    if is_near_wall.sum() < MIN_RIM:
        return
    miss = float(np.median(xyz[is_near_wall, 2]) - edge)
    if abs(miss) > RIM_MISS_M:
        text = message(
            "rim_off",
            "the points near the wall lie {miss_m:+.3g} m from datum.bottom_z_m (median): is it the"
            " height of the first course?",
            miss_m=miss,
        )
        log.warning(table.file, text, None, "z_m")
