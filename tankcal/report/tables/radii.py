"""Table of the radii of the courses: former, measured and adopted radii."""

from tankcal.report.tables.table import Column, Table


def _named(key, heading, unit="", **more):
    return Column(key, unit, heading=f"radii_{heading}", sheet=True, **more)


RADII = Table(
    "radii",
    (
        _named("course", "course", width=9),
        _named("former_radius_m", "former", "m", u="u_former_m", least=4),
        _named("u_former_m", "u_former", "mm", digits=2),
        _named("u_before_m", "u_before", "mm", digits=2, optional=True),
        _named("found_m", "found", "m", u="u_found_m", least=4, optional=True),
        _named("u_found_m", "u_found", "mm", digits=2, optional=True),
        _named("misclosure_m", "misclosure", "mm", decimals=2, optional=True),
        _named("w", "w", decimals=2, optional=True, width=8),
        _named("radius_m", "radius", "m", u="u_m", least=4),
        _named("u_m", "u", "mm", digits=2),
    ),
    rows=lambda record: _rows(record["radii"]),
)


def _rows(radii):
    """Return the rows, without the keys of a new survey if no survey exists."""
    if radii["change"] is not None:
        return radii["courses"]
    kept = ("course", "former_radius_m", "u_former_m", "radius_m", "u_m")
    return [{key: course[key] for key in kept} for course in radii["courses"]]
