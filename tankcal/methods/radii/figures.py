"""Former radii in the report: source, assumed change, and results."""

from tankcal.methods.radii.tables import RADII
from tankcal.report.tables.facts import radii_source_text


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
