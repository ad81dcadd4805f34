"""Radii out of a former table, a record or a declaration, and what a new survey made of them."""

import numpy as np

from tankcal.record.schema import Saved, key


class CourseByRadius(Saved):
    """A course: its radius as it was, as a survey found it, and as it is in the table."""

    course: str = key("name")
    former_radius_m: float | None = key("as declared; null: not known")
    u_former_m: float | None = key("standard uncertainty of that, what all share included")
    u_before_m: float | None = key("with the declared change; null: nothing was measured again")
    found_m: float | None = key("by the new survey alone; null: not measured again")
    u_found_m: float | None = key("standard uncertainty of that")
    misclosure_m: float | None = key("found less former")
    w: float | None = key("misclosure over what was expected of it")
    radius_m: float = key("in the table: inside, shell empty, at temperature_c")
    u_m: float = key("standard uncertainty of that")


class ChangeOfRadii(Saved):
    """How the radii may have changed since the former table: declared, type B."""

    common_m: float = key("standard uncertainty, all together")
    own_m: float = key("standard uncertainty, each for itself")
    shared_m: float = key("what the former radii and the new survey have in common")
    limit_w: float = key("of |w|: beyond it there is no table")


class RadiiRecord(Saved):
    """The radii that the table is made of."""

    source: str = key("table, record or declared: where they come from")
    note: str = key("as given")
    temperature_c: float = key("shell temperature that they are for")
    u_common_m: float = key("standard uncertainty that the former radii have in common")
    change: ChangeOfRadii | None = key("null: nothing was measured again")
    courses: list[CourseByRadius] = key("from the bottom up")


def radii_of(result):
    """`RadiiRecord` of a result; None: its wall is no wall of declared radii."""
    wall, given, change = result.radii, result.job.radii, None
    if wall is None:
        return None
    if wall.updated is not None:
        from tankcal.pipeline.radii_update import LARGEST_W

        declared = result.job.change
        change = ChangeOfRadii(declared.common_m, declared.own_m, declared.shared_m, LARGEST_W)
    return RadiiRecord(
        given.source, given.note, given.temperature_c, given.u_common_m, change, _courses(result)
    )


def _courses(result):
    wall, given = result.radii, result.job.radii
    former = np.sqrt(np.diag(given.covariance_m2) + given.u_common_m**2)
    u = np.sqrt(np.diag(wall.covariance_with(result.job.inputs)))
    found = []
    for i, course in enumerate(result.job.courses):
        known = given.is_known[i]
        found.append(
            CourseByRadius(
                course.name,
                given.radius_m[i] if known else None,
                former[i] if known else None,
                **_found(wall.updated, i, known),
                radius_m=wall.radius_m[i],
                u_m=u[i],
            )
        )
    return found


def _found(updated, course, known):
    """What a new survey says of a course, by the keys of `CourseByRadius`."""
    names = ("u_before_m", "found_m", "u_found_m", "misclosure_m", "w")
    found = dict.fromkeys(names)
    if updated is None:
        return found
    if known:
        found["u_before_m"] = updated.u_before_m[course]
    for k in np.flatnonzero(updated.update.measured == course):
        found |= {"found_m": updated.found_m[k], "u_found_m": updated.u_found_m[k]}
        if known:
            found["misclosure_m"] = updated.update.misclosure_m[k]
            found["w"] = updated.update.w[k]
    return found
