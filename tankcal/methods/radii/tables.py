"""Table of the courses with former radii, and with the results of a new survey."""

from tankcal.report.tables import Column, Table


def _radii_column(key, heading, unit="", **more):
    return Column(key, unit, heading=f"radii_{heading}", sheet=True, **more)


RADII = Table(
    "radii",
    (
        _radii_column("course", "course", width=9),
        _radii_column("former_radius_m", "former", "m", u="u_former_m", least=4),
        _radii_column("u_former_m", "u_former", "mm", digits=2),
        _radii_column("u_before_m", "u_before", "mm", digits=2, optional=True),
        _radii_column("found_m", "found", "m", u="u_found_m", least=4, optional=True),
        _radii_column("u_found_m", "u_found", "mm", digits=2, optional=True),
        _radii_column("misclosure_m", "misclosure", "mm", decimals=2, optional=True),
        _radii_column("w", "w", decimals=2, optional=True, width=8),
        _radii_column("radius_m", "radius", "m", u="u_m", least=4),
        _radii_column("u_m", "u", "mm", digits=2),
    ),
    rows=lambda record: _radii_rows(record["radii"]),
)


def _radii_rows(radii):
    """Return the rows, without the keys of a new survey if no survey exists."""
    if radii["change"] is not None:
        return radii["courses"]
    kept = ("course", "former_radius_m", "u_former_m", "radius_m", "u_m")
    return [{key: course[key] for key in kept} for course in radii["courses"]]
