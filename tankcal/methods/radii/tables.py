"""Table of the courses with former radii, and with the results of a new survey."""

from tankcal.report.tables import Column, Table
from tankcal.report.tables.facts import radii_source_text


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


# ---- former radii in the report: source, assumed change, and results


def facts(paper):
    """Block of source, temperature, common uncertainty and assumed change of the radii."""
    radii = paper.record["radii"]
    change = radii["change"] or {}
    return paper.facts(
        [
            ("radii_source", radii_source_text(paper)),
            ("radii_temperature", paper.number(radii["temperature_c"], "degC", digits=3)),
            ("radii_u_common", _type_b_text(paper, radii["u_common_m"])),
            ("change_common", _type_b_text(paper, change.get("common_m"))),
            ("change_own", _type_b_text(paper, change.get("own_m"))),
            ("change_shared", _type_b_text(paper, change.get("shared_m") or None)),
        ]
    )


def courses(paper):
    """Table of the courses, with the results of a new survey if there is any."""
    change = paper.record["radii"]["change"]
    if change is None:
        return paper.show(RADII)
    limit = paper.number(change["limit_w"], "", decimals=0)
    return paper.show(RADII, on="radii_updated", limit=limit)


def _type_b_text(paper, u_m):
    if u_m is None:
        return None
    return paper.word("texts.of_type_b", u=paper.number(u_m, "mm", digits=2))
