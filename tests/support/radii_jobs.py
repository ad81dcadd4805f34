"""Jobs of tank S-1 by the radii of its courses, alone or with its first course strapped again."""

import numpy as np
from job_builder import S_1, strapped_parts

RADII_M = (7.203189, 7.203171, 7.203422, 7.203563, 7.203165)  # of S-1 at 20 degrees, inside
HEIGHTS_M = np.array([row[0] for row in S_1])
PLATES_M = np.array([row[1] for row in S_1]) / 1000
GIVEN = {"radii__source": "table", "radii__u_common_mm": 0.7}
CHANGE = {"change__common_mm": 0.8, "change__own_mm": 0.3}


def radii_parts(radius_m=RADII_M, u_mm=0.3, **settings):
    """Parts of S-1 by its radii alone; settings with dots for "__"."""
    parts = strapped_parts(**GIVEN | {"shell__shape_sd_mm": None} | settings)
    rows = [[str(i + 1), radius, u_mm] for i, radius in enumerate(radius_m)]
    tables = {"courses": parts.tables["courses"], "radii": [["course", "radius_m", "u_mm"], *rows]}
    parts.tables, parts.registers = tables, {}
    return parts


def partial_parts(courses=("1",), **settings):
    """Parts of S-1 by its radii, with the straps of some courses beside them."""
    parts = strapped_parts(**GIVEN | CHANGE | {"shell__shape_sd_mm": 0.0} | settings)
    tables = radii_parts().tables
    for name, column in (("circumferences", 1), ("obstructions", 0)):
        heading, *rows = parts.tables[name]
        tables[name] = [heading, *(row for row in rows if row[column][0] in courses)]
    parts.tables = tables
    return parts


def closed_volume_m3(dip_m, radius_m=RADII_M, rho=0.0, e_pa=206e9):
    """Volume below a dip, exactly: pi (r + dr)^2, dr = rho g (h - z) r^2 / (E t)."""
    found, bottom, r = 0.0, 0.0, np.asarray(radius_m)
    for radius, height, plate in zip(r, HEIGHTS_M, PLATES_M, strict=True):
        top = min(bottom + height, dip_m)
        if top > bottom:
            k = rho * 9.80665 * radius**2 / (e_pa * plate)
            high, low = dip_m - bottom, dip_m - top
            moments = [(high**n - low**n) / n for n in (1, 2, 3)]
            terms = (radius**2, 2 * radius * k, k**2)
            found += np.pi * float(np.dot(terms, moments))
        bottom += height
    return found
