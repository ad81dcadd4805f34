"""Saved part of wall hits inside horizontal tanks and spheres, and the tables that print it."""

import numpy as np

from tankcal.methods.hits import saved as of_upright_tanks
from tankcal.methods.hits.saved import (
    HitSetupUsed,
    IncidenceClass,
    incidence_classes,
    setups_used,
)
from tankcal.record.schema import Saved, key
from tankcal.report.tables.table import DEPARTURE, ROW, SETUP, Table


class ComparedInside(Saved):
    """A hit that was only compared with the solid."""

    setup: str = key("name")
    departure_m: float = key("outwards, from the fitted solid")
    row: int | None = key("of the file")


class InsideHitsRecord(Saved):
    """Hits of the bare wall from set-ups inside a horizontal tank or a sphere."""

    setups: list[HitSetupUsed] = key("in the order of their hits")
    incidence: list[IncidenceClass] = key("histogram of the angles to the normal of the solid")
    compared: list[ComparedInside] = key("hits with use = check")


def save_inside_hits(result):
    """Return the `InsideHitsRecord` of a result."""
    from tankcal.methods.inside_hits.solid import is_accepted

    hits = result.job.surveys["inside_hits"]
    sighting = result.sights["inside_hits"]
    return InsideHitsRecord(
        setups=setups_used(hits, sighting.poses, is_accepted(result.job, result.scan, sighting)),
        incidence=incidence_classes(sighting.incidence_rad),
        compared=_compare_hits(hits, sighting.points.xyz_m, result.scan.fit),
    )


def _compare_hits(hits, xyz_m, fit):
    """`ComparedInside` of each hit that is only compared."""
    from tankcal.pipeline.scanned_solids import offsets

    compared = np.flatnonzero(hits.check)
    departures_m = offsets(fit, xyz_m[compared])
    return [
        ComparedInside(setup=hits.setup[index], departure_m=departure, row=hits.rows[index])
        for index, departure in zip(compared, departures_m, strict=True)
    ]


SETUPS = Table(
    "hit_setups",
    of_upright_tanks.SETUPS.columns,
    rows=lambda record: record["inside_hits"]["setups"],
)

INCIDENCE = Table(
    "hit_incidence",
    of_upright_tanks.INCIDENCE.columns,
    rows=lambda record: record["inside_hits"]["incidence"],
)

COMPARED = Table(
    "inside_hits_compared",
    (SETUP, ROW, DEPARTURE),
    rows=lambda record: record["inside_hits"]["compared"],
)
