"""Radii out of a former table, a record or a declaration, and what a new survey made of them."""

import numpy as np

from tankcal.record.schema import Saved, key


class CourseByRadius(Saved):
    """A course: its radius as it was, and as it is in the table."""

    course: str = key("name")
    former_radius_m: float | None = key("as declared; null: not known")
    u_former_m: float | None = key("standard uncertainty of that, of what all share, too")
    radius_m: float = key("in the table: inside, shell empty, at temperature_c")
    u_m: float = key("standard uncertainty of that, without declared inputs that are in the budget")


class RadiiRecord(Saved):
    """The radii that the table is made of."""

    source: str = key("table, record or declared: where they come from")
    note: str = key("as given")
    temperature_c: float = key("shell temperature that they are for")
    u_common_m: float = key("standard uncertainty that the former radii have in common")
    courses: list[CourseByRadius] = key("from the bottom up")


def radii_of(result):
    """`RadiiRecord` of a result; None: its wall is no wall of declared radii."""
    wall, given = result.radii, result.job.radii
    if wall is None:
        return None
    variances = np.diag(given.covariance_m2) + given.u_common_m**2
    known, u = given.is_known, np.sqrt(np.diag(wall.covariance_m2))
    courses = [
        CourseByRadius(
            course.name,
            given.radius_m[i] if known[i] else None,
            np.sqrt(variances[i]) if known[i] else None,
            wall.radius_m[i],
            u[i],
        )
        for i, course in enumerate(result.job.courses)
    ]
    return RadiiRecord(given.source, given.note, given.temperature_c, given.u_common_m, courses)
