"""Jobs of strapped spheres: tables of great circles and one tape.

parts = sphere_parts({"E": (None, 62.8507), "M0": (0, 62.8287)})
"""

import numpy as np
from job_builder import job_parts
from scipy.special import ellipe

TAPE = {
    "kind": "tape",
    "certificate": "T 1/2026",
    "certified_temperature_c": 20,
    "expansion_per_k": 1.15e-5,
    "u_scale_ppm": 5,
    "thickness_mm": 0.0,  # so that a reading is a circumference
}
OVER = float(4 * 10.003 * ellipe(1 - (9.996 / 10.003) ** 2))  # the poles of a published example
FOUR = {"E": (None, 20.006 * np.pi), "M0": (0, OVER), "M60": (60, OVER), "M120": (120, OVER)}
COLUMNS = ["circle", "kind", "azimuth_deg", "reading_m", "s_mm", "use"]


def sphere_parts(circles=FOUR, *, settings=None, tape=None, s_mm=0.5, repeats=1):
    """Parts of a job whose sphere was strapped; bare plates of 0, no temperature but the tape's.

    circles  {name: (azimuth or None of the equator, reading)}
    """
    given = {
        "survey.side": "outside",
        "survey.shell_temperature_c": 20.0,
        "table.reference_temperature_c": 20.0,
        "sphere.diameter_m": None,
        "sphere.thickness_mm": 0.0,
        "table.monte_carlo": False,
        "table.step_m": 0.25,
    }
    parts = job_parts(kind="sphere", settings=given | (settings or {}))
    rows = []
    for name, (azimuth, reading) in circles.items():
        kind = "equator" if azimuth is None else "meridian"
        for _ in range(repeats):
            rows.append([name, kind, azimuth, reading, s_mm, None])
    parts.tables["great_circles"] = [list(COLUMNS), *rows]
    given = {key: value for key, value in (TAPE | (tape or {})).items() if value is not None}
    parts.registers["instruments"] = {"T": given}
    return parts


def lengths_of(axes_m, azimuth_deg, circles):
    """Lengths of great circles of an ellipsoid by chains of chords: {name: length}.

    axes_m  a (towards the azimuth), b, c; circles  {name: azimuth or None}
    """
    turn = np.linspace(0, 2 * np.pi, 100_001)
    found = {}
    for name, azimuth in circles.items():
        first, second = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
        if azimuth is not None:
            u = np.radians(azimuth)
            first, second = np.array([np.sin(u), np.cos(u), 0.0]), np.array([0.0, 0.0, 1.0])
        way = np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second)
        t = np.radians(azimuth_deg)
        along = way[:, 0] * np.sin(t) + way[:, 1] * np.cos(t)
        across = way[:, 0] * np.cos(t) - way[:, 1] * np.sin(t)
        parts = zip((along, across, way[:, 2]), axes_m, strict=True)
        radius = sum((part / axis) ** 2 for part, axis in parts) ** -0.5
        places = radius[:, None] * way
        found[name] = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
    return found
