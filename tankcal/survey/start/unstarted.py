"""Messages about unknowns without start values."""

import numpy as np

from tankcal.errors import SolutionError
from tankcal.messages import join_with_or, list_some, message
from tankcal.survey.network.survey import FEWEST
from tankcal.survey.observations import Distances, HeightDifferences, VerticalAngles
from tankcal.survey.start.single_points import SHOWN

LISTED = 10


class SeveralPlacesError(SolutionError):
    """Several positions fit the measurements: not a mistake, but one reading too few."""


def refuse_missing(survey, sights, xyz_m, piece, sets, reasons, why=lambda point: None):
    """Complete coordinates, or raise an error that lists the missing start values.

    Points with too few observations take the mean position; the adjustment later omits them by
    name.

    Parameters
    ----------
    survey : network.Survey
    sights : sequence of Sight
    xyz_m : ndarray, shape (points, 3)
    piece : Piece
    sets : ndarray, shape (sets,)
    reasons : list of str
    why : callable
        why(point) returns the error of a point without position, see `unfixed_point_error`, or
        None.

    Returns
    -------
    ndarray, shape (points, 3)

    Raises
    ------
    SolutionError
        If a photo, a point with enough observations, or a circle has no start value.
    """
    hopeless = survey.values_of_points() < FEWEST
    missing = np.isnan(xyz_m) & ~hopeless[:, None]
    told = []
    known = np.isfinite(xyz_m).all(axis=1)
    for photo in np.flatnonzero(~piece.oriented):
        count = known[sights[photo].point].sum()
        name = survey.photos.names[photo]
        if count == 3:
            told.append(
                message(
                    "photo_of_three",
                    "photo {name} (3 known points, which several positions explain)",
                    name=name,
                )
            )
        else:
            told.append(
                message(
                    "photo_of_points", "photo {name} ({count} known points)", name=name, count=count
                )
            )
    without_plan = np.flatnonzero(missing[:, :2].any(axis=1))
    points = [message("named_point", "point {point}", point=survey.points[i]) for i in without_plan]
    told += points if len(points) <= LISTED else [list_some(points, LISTED)]
    flat = np.isfinite(xyz_m[:, :2]).all(axis=1) & np.isnan(xyz_m[:, 2])
    level = np.flatnonzero(flat if (flat & ~hopeless).any() else flat & ~hopeless)
    # Circles follow from points, so they are listed only if no point is missing.
    if not told:
        unknown = [
            message("named_set", "orientation of direction set {number}", number=number)
            for number in np.flatnonzero(np.isnan(sets)) + 1
        ]
        told += unknown if len(unknown) <= LISTED else [list_some(unknown, LISTED)]
    sentences = (
        [message("not_started", "no approximate values for {told}", told=[*told])] if told else []
    )
    if len(level):
        sentences.append(_no_heights(survey, level))
    if sentences:
        errors = [item for item in map(why, without_plan[:LISTED]) if item is not None]
        several = len(errors) == len(told) and all(
            isinstance(item, SeveralPlacesError) for item in errors
        )
        kind = SeveralPlacesError if several and errors else SolutionError
        texts = [
            *sentences,
            *(item.args[0] for item in errors),
            *(item for item in reasons if item),
        ]
        raise kind(join_with_semicolons(texts))
    # Points without observations need finite coordinates only.
    middle = np.nanmean(xyz_m, axis=0) if known.any() else np.zeros(3)
    return np.where(np.isnan(xyz_m), middle, xyz_m)


def unfixed_point_error(survey, sought, point, centre_m):
    """SolutionError of a point that its observations to known points do not determine, or None.

    Parameters
    ----------
    survey : network.Survey
    found : Sought
    point : int
    centre_m : ndarray, shape (3,)
        Added to the coordinates.
    """
    name = survey.points[point]
    if not sought.unknowns:
        return None
    if sought.rows < sought.unknowns:
        return SolutionError(
            message(
                "point_short_of_readings",
                "point {name} has {rows} reading to known points, and {unknowns} are needed"
                if sought.rows == 1
                else "point {name} has {rows} readings to known points, and {unknowns} are needed",
                name=name,
                rows=sought.rows,
                unknowns=sought.unknowns,
            )
        )
    if len(sought.rivals_m) > SHOWN or len(sought.rivals_m) == 1:
        return SolutionError(
            message(
                "point_moves_freely",
                "the readings between point {name} and known points leave it free to move (lines "
                "or circles that coincide, or hardly cross): another reading is needed",
                name=name,
            )
        )
    if not len(sought.rivals_m):
        return SolutionError(
            message(
                "point_fits_nowhere",
                "no place of point {name} agrees with the readings between it and known points",
                name=name,
            )
        )
    places = [
        "(" + ", ".join(f"{value:.2f}" for value in place[np.isfinite(place)]) + ")"
        for place in sought.rivals_m + centre_m
    ]
    return SeveralPlacesError(
        message(
            "point_at_several_places",
            "point {name} may be at {places}, which fit equally well: another reading is "
            "needed, or approximate coordinates (in control.csv, standard deviations blank)",
            name=name,
            places=join_with_or(places),
        )
    )


def loose_frame_sentence(survey, local, known):
    """Sentence about points (points,) of a local frame in plan that is not joined."""
    names = [str(survey.points[i]) for i in np.flatnonzero(local & ~known)]
    some = list_some(names, LISTED)
    common = int((local & known).sum())
    if common > 1:
        return message(
            "either_side",
            "points {some} may be on either side of the line through the known ones: give "
            "one of them approximate coordinates (in control.csv, standard deviations blank)",
            some=some,
        )
    if common == 1:
        return message(
            "points_share_one",
            "points {some} are connected to each other, but share only 1 known point with "
            "the rest: 2 are needed, or 1 and an azimuth",
            some=some,
        )
    return message(
        "points_share_few",
        "points {some} are connected to each other, but share only {common} known points "
        "with the rest: 2 are needed, or 1 and an azimuth",
        some=some,
        common=common,
    )


def join_with_semicolons(parts):
    """Join parts with semicolons."""
    *first, last = parts
    if not first:
        return last
    before = join_with_semicolons(first)
    return message("and_also", "{before}; {last}", before=before, last=last)


def _no_heights(survey, level):
    """Sentence about points without heights, with the reason and a remedy."""
    names = list_some([str(survey.points[i]) for i in level], LISTED)
    kinds = (HeightDifferences, VerticalAngles)
    observed = any(isinstance(item, kinds) and len(item) for item in survey.observations)
    spatial = any(
        isinstance(item, Distances) and not item.horizontal for item in survey.observations
    )
    why = message(
        "no_height_observed",
        "no zenith angle, vertical angle or levelled height difference was observed",
    )
    if observed:
        why = message("heights_hang_free", "they are not connected to any point with a known z")
    end = (
        message(
            "distances_taken_spatial",
            "; distances are taken as spatial ones unless kind = horizontal",
        )
        if spatial
        else ""
    )
    return message(
        "heights_not_determined",
        "the heights (z) of {names} are not determined: {why}; give their z as control{end}",
        names=names,
        why=why,
        end=end,
    )
