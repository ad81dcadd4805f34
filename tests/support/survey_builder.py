"""A small survey as plain data, of every kind of file, for tests of its reading.

Eight wall points on a cylinder of R 6.5 m, two stations, four photos of two cameras. Angles and
distances follow from the coordinates, so that nothing contradicts; image coordinates are arbitrary.
"""

import numpy as np
from job_builder import Parts, job_parts

WALL = {
    f"W{i + 1}": (6.5 * np.sin(t), 6.5 * np.cos(t), 1.0 + 0.9 * i)
    for i, t in enumerate(np.radians(np.arange(0, 360, 45)))
}
PLACES = WALL | {"S1": (12.0, 9.0, 0.4), "S2": (-13.0, 8.0, 0.6)}
CAMERAS = {
    "UMK 10/1318": {
        "format_mm": [180.0, 130.0],
        "c_mm": 100.12,
        "x0_mm": 0.013,
        "y0_mm": -0.02,
        "K1_mm-2": 1.1e-7,
        "P1_mm-1": -2e-6,
        "A": 1e-4,
        "affinity": "both_y",
        "radial_balance_mm": 60.0,
        "convention": "correction_added",
        "s_K1": 1e-9,
    },
    "D": {
        "format_px": [6000, 4000],
        "pixel_um": 4.0,
        "c_mm": 28.0,
        "convention": "distortion_of_ideal",
    },
}
INSTRUMENTS = {
    "tape 1": {
        "kind": "tape",
        "certificate": "C-17",
        "certified_temperature_c": 20.0,
        "tension_n": 50.0,
        "expansion_per_k": 1.15e-5,
        "correction": 2e-5,
        "correction_mm": -0.3,
        "u_scale_ppm": 15.0,
        "u_offset_mm": "free",
    },
    "TS": {"kind": "total station", "u_scale_ppm": 2.0, "u_offset_mm": 0.5},
}


def vector(one, other):
    """From one point to another, m."""
    return np.subtract(PLACES[other], PLACES[one])


def azimuth(one, other):
    """Degrees clockwise from +y, 0 to 360."""
    dx, dy, _ = vector(one, other)
    return float(np.degrees(np.arctan2(dx, dy)) % 360)


def zenith(one, other):
    """Degrees from the zenith."""
    dx, dy, dz = vector(one, other)
    return float(np.degrees(np.arctan2(np.hypot(dx, dy), dz)))


def length(one, other):
    """Metres."""
    return float(np.linalg.norm(vector(one, other)))


def _tables():
    rng = np.random.default_rng(7)
    in_mm = rng.uniform(-60, 60, (3, 8, 2)).round(4).tolist()
    images = [
        ["photo", "point", "x_mm", "y_mm", "sx_um", "sy_um", "column_px", "line_px", "s_px", "use"]
    ]
    for photo, coordinates in zip(("F1", "F2", "F3"), in_mm, strict=True):
        images += [
            [photo, name, *xy, 3.0, 4.0, None, None, None, "check" if name == "W8" else None]
            for name, xy in zip(WALL, coordinates, strict=True)
        ]
    images += [
        ["D1", name, None, None, None, None, 700.0 * i, 450.25 * i, 0.5 if i else None, "adjust"]
        for i, name in enumerate(WALL)
    ]
    stations, names = ("S1", "S2"), list(WALL)
    sights = [(s, n) for s in stations for n in names]
    return {
        "targets": [["point", "section", "generatrix", "z_m", "offset_mm"]]
        + [[name, "R1", f"G{i}", 1.0 + i, 2.5 if i else None] for i, name in enumerate(names)],
        "photos": [
            [
                "photo",
                "camera",
                "x_m",
                "y_m",
                "z_m",
                "omega_deg",
                "phi_gon",
                "kappa_deg",
                "sx_m",
                "s_omega_deg",
                "s_phi_gon",
            ],
            ["F1", "UMK 10/1318", 20.0, 1.0, 1.6, 90.0, 100.0, 0.5, 0.0, 0.01, 0.0],
            ["F2", "UMK 10/1318", 0.0, 21.0, 1.6, None, None, None, 0.05, None, None],
            ["F3", "UMK 10/1318", None, None, None, None, None, None, None, None, None],
            ["D1", "D", -19.0, 2.0, 1.5, -90.0, 50.0, 1.0, None, None, None],
        ],
        "image_points": images,
        "control": [
            ["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm", "system"],
            *([name, *map(float, PLACES[name]), 1.0, 1.0, 2.0, None] for name in names[:3]),
            ["W4", float(PLACES["W4"][0]), None, 3.7, 0.0, None, None, None],
            ["W1", 100.0, 200.0, 50.0, 1.5, 1.5, None, "plant"],
        ],
        "check": [["point", "x_m", "y_m", "z_m"], ["W5", *map(float, PLACES["W5"])]],
        "setups": [
            ["setup", "station", "instrument", "instrument_height_m"],
            ["1", "S1", "TS", 1.55],
            ["2", "S2", None, None],
        ],
        "distances": [
            ["from", "to", "distance_m", "s_mm", "kind", "instrument", "temperature_c", "use"],
            ["W1", "W2", length("W1", "W2"), 1.0, None, "tape 1", 24.5, None],
            ["W2", "W1", length("W1", "W2") + 1e-4, 1.0, "spatial", "tape 1", 24.5, None],
            [
                "S1",
                "S2",
                float(np.hypot(*vector("S1", "S2")[:2])),
                2.0,
                "horizontal",
                None,
                None,
                "check",
            ],
        ],
        "slope_distances": [["setup", "to", "distance_m", "s_mm", "target_height_m"]]
        + [[s[1], n, length(s, n), 1.5, 0.02 if n == "W1" else None] for s, n in sights],
        "directions": [["setup", "set", "to", "direction_deg", "s_arcsec"]]
        + [[s[1], "a", n, (azimuth(s, n) + 17.0) % 360, 3.0] for s, n in sights],
        "zenith_angles": [["setup", "to", "zenith_gon", "s_arcsec", "target_height_m", "use"]]
        + [[s[1], n, zenith(s, n) / 0.9, 3.0, None, None] for s, n in sights],
        "azimuths": [
            ["from", "to", "azimuth_dms", "s_arcsec"],
            ["S1", "S2", dms(azimuth("S1", "S2")), 10.0],
        ],
        "horizontal_angles": [
            ["at", "from", "to", "angle_gon", "s_arcsec"],
            ["S1", "W1", "W2", (azimuth("S1", "W2") - azimuth("S1", "W1")) % 360 / 0.9, 5.0],
        ],
        "vertical_angles": [
            ["from", "to", "angle_deg", "s_arcsec"],
            ["S1", "W3", 90 - zenith("S1", "W3"), 5.0],
        ],
        "height_differences": [
            ["from", "to", "dz_m", "s_mm"],
            ["W1", "S1", float(vector("W1", "S1")[2]), 0.5],
        ],
        "plumb_lines": [["from", "to", "s_mm"], ["W1", "W5", 0.3]],
        "vectors": [
            ["from", "to", "dx_m", "dy_m", "dz_m", "sx_mm", "sy_mm", "sz_mm", "r_xy", "r_yz"],
            *(
                ["S1", n, *map(float, vector("S1", n)), 3.0, 3.0, 5.0, 0.2, None]
                for n in ("W1", "S2")
            ),
        ],
        "correlated_readings": [
            ["table_1", "row_1", "value_1", "table_2", "row_2", "value_2", "r"],
            ["vectors", 2.0, "x", "vectors", 3.0, "x", 0.5],
        ],
    }


def dms(degrees):
    """The text of an angle, to 1e-6 seconds."""
    seconds = round(abs(degrees) * 3600, 6)
    minutes, seconds = divmod(seconds, 60)
    sign = "-" if degrees < 0 else ""
    return f"{sign}{int(minutes // 60)} {int(minutes % 60):02d} {seconds:09.6f}"


def survey_parts(settings=None, tank=True):
    """Parts of a vertical tank with a survey in place of its points; without a tank on demand."""
    given = {
        "adjustment.image_sd_um": 5.0,
        "adjustment.datum": "control",
        "adjustment.refraction": 0.13,
        "adjustment.camera.default": "camera free",
        "adjustment.camera.K3": "off",
        "adjustment.camera.K1": "block weighted",
        "adjustment.camera.A": "camera fixed",
    } | (settings or {})
    given = {key: value for key, value in given.items() if value is not None}
    registers = {
        "cameras": {name: dict(camera) for name, camera in CAMERAS.items()},
        "instruments": {name: dict(tool) for name, tool in INSTRUMENTS.items()},
    }
    registers["cameras"]["D"] |= {"K1_mm-2": 1.1e-7, "s_K1": 1e-9}
    if not tank:
        return Parts(given, _tables(), registers=registers)
    parts = job_parts(settings=given)
    del parts.tables["points"]
    parts.tables |= _tables()
    parts.registers = registers
    return parts


MARKS = {"1": [-84.0, -59.0], "2": [84.0, -59.0], "3": [84.0, 59.0], "4": [-84.0, 59.0]}


def read_on_comparator(parts):
    """The same with marks in the photos of the film camera, and a flat film in the other one.

    The comparator's zero is the middle of the photo, so that image coordinates stay what they are.
    """
    parts.registers["cameras"]["UMK 10/1318"] |= {f"marks.{k}": xy for k, xy in MARKS.items()}
    parts.tables["fiducials"] = [["photo", "mark", "x_mm", "y_mm", "s_um"]] + [
        [photo, mark, *xy, 2.0 if mark == "1" else None]
        for photo in ("F1", "F2", "F3")
        for mark, xy in MARKS.items()
    ]
    parts.tables["film"] = [["camera", "photo", "x_mm", "y_mm", "height_um"]] + [
        ["D", None, x, y, 0.0] for x, y in ((-13.0, -9.0), (13.0, -9.0), (-13.0, 9.0), (13.0, 9.0))
    ]
    return parts
