"""Saved part of wall hits inside horizontal tanks and spheres."""

import numpy as np

from tankcal.methods.hits.saved import CLASS_DEG, LAST_DEG, HitSetupUsed, IncidenceClass
from tankcal.record.schema import Saved, key


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
        setups=_setups(hits, sighting.poses, is_accepted(result.job, result.scan, sighting)),
        incidence=_incidence_classes(sighting.incidence_rad),
        compared=_compare_hits(hits, sighting.points.xyz_m, result.scan.fit),
    )


def _setups(hits, poses, is_used):
    """`HitSetupUsed` of each set-up; `is_used` (n,) is the mask of the accepted hits."""
    setup = np.array(hits.setup)
    first = {}
    for index, (name, _) in enumerate(poses.keys):
        first.setdefault(name, index)
    rows = []
    for name, index in first.items():
        declared, is_here = hits.setups[name], setup == name
        x_m, y_m, z_m = poses.xyz_m[index].tolist()
        rows.append(
            HitSetupUsed(
                setup=name,
                station=declared.station,
                instrument=declared.instrument,
                certificate=hits.instruments[declared.instrument].certificate,
                x_m=x_m,
                y_m=y_m,
                z_m=z_m,
                tie=poses.ties[index],
                hits=np.count_nonzero(is_here & is_used),
                rejected=np.count_nonzero(is_here & ~hits.check & ~is_used),
                checks=np.count_nonzero(is_here & hits.check),
            )
        )
    return rows


def _incidence_classes(incidence_rad):
    """Histogram of angles of incidence, up to the last class with hits."""
    edges = np.arange(0, LAST_DEG + 1, CLASS_DEG)
    counts = np.histogram(np.degrees(incidence_rad), edges)[0]
    last = np.flatnonzero(counts)[-1] + 1
    return [
        IncidenceClass(low_deg=float(low), high_deg=float(low + CLASS_DEG), hits=count)
        for low, count in zip(edges[:last], counts[:last], strict=True)
    ]


def _compare_hits(hits, xyz_m, fit):
    """`ComparedInside` of each hit that is only compared."""
    from tankcal.pipeline.scanned_solids import offsets

    compared = np.flatnonzero(hits.check)
    departures_m = offsets(fit, xyz_m[compared])
    return [
        ComparedInside(setup=hits.setup[index], departure_m=departure, row=hits.rows[index])
        for index, departure in zip(compared, departures_m, strict=True)
    ]
