"""Field books of crews of their own, on tanks of known volume: nothing of the package's model.

    tank = CrewTank(rng)
    book = strapping_book(tank, rng)        lines_book, hits_book, tangents_book
    parts = book.parts()

The shell is slightly oval, its courses are not alike, its vertical seams are drawn in, and it
leans. The tape lies on the convex hull of the outline with its weld caps, sights are followed until
they meet or touch the wall. Instruments are off by what the book says of them.
"""

import copy
from dataclasses import dataclass, field

import numpy as np
from generated_hits import Surface, Tool, observe, take_hits
from generated_tangents import Circle, ring_of_stations, take_tangents
from job_builder import SETTINGS, Parts
from scipy.spatial import ConvexHull

FULL_TURN = 2 * np.pi
ARCSEC = np.pi / 180 / 3600
ALPHA, TAPE_ALPHA, TAPE_MM = 1.1e-5, 1.15e-5, 0.2
CAP_MM, CAP_WIDTH_MM, PAINT_MM = 1.2, 12.0, 0.25
PLACES = (0.2, 0.8)  # of a course
TAPE = {
    "kind": "tape", "certificate": "L 88", "certified_temperature_c": 20.0, "tension_n": 50.0,
    "expansion_per_k": TAPE_ALPHA, "correction": 3e-5, "u_scale_ppm": 10.0,
    "thickness_mm": TAPE_MM, "section_mm2": 2.6, "e_gpa": 206.0,
}  # fmt: skip
STATION = {"kind": "total_station", "certificate": "ET 5", "u_scale_ppm": 10.0, "s_mm": 1.0,
           "s_arcsec": 5.0, "u_incidence_mm": 1.0}  # fmt: skip


class CrewTank:
    """A tank of 10 to 35 m: `radius` is that of its outside, or its inside, in metres."""

    def __init__(self, rng):
        self.nominal_m = float(rng.choice([5.1, 6.4, 8.5, 12.2, 17.5]))
        self.courses, self.course_m = int(rng.integers(4, 8)), float(rng.choice([1.5, 1.8, 2.4]))
        self.celsius = float(rng.integers(16, 34))
        bottom = 4.9 * 2 * self.nominal_m * self.courses * self.course_m / 137 + 1
        share = 1 - 0.8 * np.arange(self.courses) / self.courses
        self.plate_mm = np.maximum(6.0, np.round(max(7.0, bottom) * share))
        self.mean_m = self.nominal_m + rng.uniform(-0.0015, 0.0015)
        self.mean_m = self.mean_m + rng.normal(0, 7e-4, self.courses)
        order = np.arange(1, 7)
        self.oval_m = rng.uniform(0.002, 0.006) * rng.normal(size=6) / order**1.3
        self.oval_rad = rng.uniform(0, FULL_TURN, 6)
        self.own_m = rng.normal(0, 8e-4, (self.courses, 4))
        self.own_rad = rng.uniform(0, FULL_TURN, (self.courses, 4))
        self.seams = max(4, round(FULL_TURN * self.nominal_m / 6))
        self.first_seam = rng.uniform(0, FULL_TURN, self.courses)
        self.drawn_in_m = -np.abs(rng.normal(0.0015, 0.001, (self.courses, self.seams)))
        self.bulge_m = rng.normal(8e-4, 5e-4, self.courses)
        self.slope = tuple(rng.normal(0, 0.0015, 2))

    def radius(self, azimuth, z, *, outside, caps=False):
        azimuth, z = np.broadcast_arrays(np.asarray(azimuth, float), np.asarray(z, float))
        course = np.clip((z / self.course_m).astype(int), 0, self.courses - 1)
        zeta = 2 * (z / self.course_m - course) - 1
        found = self.mean_m[course] + self.bulge_m[course] * (1 - zeta**2)
        for order, (size, phase) in enumerate(zip(self.oval_m, self.oval_rad, strict=True), 2):
            found = found + size * np.cos(order * azimuth - phase)
        for place in range(4):
            phase = self.own_rad[course, place]
            found = found + self.own_m[course, place] * np.cos((place + 2) * azimuth - phase)
        for seam in range(self.seams):
            away = azimuth - self.first_seam[course] - FULL_TURN * seam / self.seams
            arc = self.nominal_m * np.angle(np.exp(1j * away))
            found = found + self.drawn_in_m[course, seam] * np.exp(-np.abs(arc) / 0.25)
            if caps:
                found = found + np.where(np.abs(arc) < CAP_WIDTH_MM / 2000, CAP_MM / 1000, 0.0)
        return found + outside * (self.plate_mm[course] + PAINT_MM) / 1000

    def surface(self, *, outside):
        return Surface(lambda a, z: self.radius(a, z, outside=outside), (0.0, 0.0), self.slope)

    def volume_m3(self, celsius=20.0):
        """Of the full tank, its shell at that temperature."""
        height, azimuth = self.courses * self.course_m, FULL_TURN * np.arange(720) / 720
        z = (np.arange(2000) + 0.5) / 2000 * height
        inside = self.radius(azimuth[None, :], z[:, None], outside=0)
        grown = 1 + ALPHA * (celsius - self.celsius)
        return float(np.pi * np.mean(inside**2) * height * grown**2)

    def girth(self, z):
        """Length of a tape that lies on the hull of the outside and its weld caps."""
        count = int(FULL_TURN * self.nominal_m / 0.003)
        azimuth = FULL_TURN * np.arange(count) / count
        radius = self.radius(azimuth, z, outside=1, caps=True)
        return ConvexHull(
            np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth)])
        ).area

    @property
    def shape_mm(self):
        """Standard deviation of the radius round the wall."""
        azimuth = FULL_TURN * np.arange(720) / 720
        middle = (np.arange(self.courses) + 0.4) * self.course_m
        return 1000 * float(np.mean(np.std(self.radius(azimuth, middle[:, None], outside=0), 1)))

    def levels(self, places=PLACES):
        """[(course, height)] of what is read."""
        return [(c, (c + part) * self.course_m) for c in range(self.courses) for part in places]


@dataclass
class Book:
    """What a crew brings home: settings, tables as rows {column: value}, and instruments."""

    tank: CrewTank
    settings: dict
    tables: dict
    instruments: dict = field(default_factory=dict)

    def copy(self):
        return copy.deepcopy(self)

    def times(self, table, column, factor, digits=5):
        for row in self.tables[table]:
            row[column] = round(row[column] * factor, digits)

    def parts(self):
        tables = {}
        for name, rows in self.tables.items():
            columns = list(dict.fromkeys(column for row in rows for column in row))
            tables[name] = [columns, *([row.get(column) for column in columns] for row in rows)]
        tables = {name: rows for name, rows in tables.items() if len(rows) > 1}
        return Parts(self.settings, tables, registers={"instruments": self.instruments})


def _book(tank, side):
    settings = SETTINGS | {
        "tank.nominal_diameter_m": 2 * tank.nominal_m,
        "tank.nominal_height_m": round(tank.courses * tank.course_m, 3),
        "survey.side": side,
        "survey.shell_temperature_c": tank.celsius,
        "material.expansion_per_k": ALPHA,
        "material.e_gpa": 206.0,
        "table.step_m": 0.1,
    }
    courses = [
        {"course": str(c + 1), "height_m": tank.course_m, "thickness_mm": float(plate),
         "paint_mm": PAINT_MM} for c, plate in enumerate(tank.plate_mm)
    ]  # fmt: skip
    return Book(tank, settings, {"courses": courses})


def _strap(book, rng, courses, repeats):
    tank, off = book.tank, 1e-5 * rng.normal()
    book.tables["circumferences"], book.tables["obstructions"] = [], []
    book.instruments["T-88"] = dict(TAPE)
    unit = (1 + 3e-5 + off) * (1 + TAPE_ALPHA * (tank.celsius - 20))
    for course, z in tank.levels():
        if course not in courses:
            continue
        length = tank.girth(z) + np.pi * TAPE_MM / 1000
        name = f"{course + 1}-{z / tank.course_m - course:.1f}"
        for _ in range(repeats):
            reading = round(length / unit + 5e-4 * rng.normal(), 4)
            book.tables["circumferences"].append(
                {"circumference": name, "course": str(course + 1), "level_m": round(z, 3),
                 "reading_m": reading, "s_mm": 0.5, "tension_n": 50.0, "instrument": "T-88"}
            )  # fmt: skip
        book.tables["obstructions"].append(
            {"circumference": name, "kind": "weld", "count": float(tank.seams),
             "thickness_mm": CAP_MM, "width_mm": CAP_WIDTH_MM}
        )  # fmt: skip


def strapping_book(tank, rng):
    """Two circumferences of each course, each read twice."""
    book = _book(tank, "outside")
    book.settings["shell.shape_sd_mm"] = round(tank.shape_mm, 1)
    _strap(book, rng, range(tank.courses), 2)
    return book


def lines_book(tank, rng):
    """Two circumferences of the first course, and lines on both faces."""
    book = _book(tank, "outside")
    book.settings["shell.shape_sd_mm"] = round(tank.shape_mm, 1)
    _strap(book, rng, [0], 3)
    count = 12 if tank.nominal_m < 9 else 20 if tank.nominal_m < 13 else 24
    levels, collimation = tank.levels(), 6 * ARCSEC * rng.normal()
    azimuth = FULL_TURN * np.arange(count) / count
    ray, z = (
        np.column_stack([np.sin(azimuth), np.cos(azimuth)]),
        np.array([one for _, one in levels]),
    )
    foot = np.array(tank.slope) * z[0]
    line_m = tank.radius(azimuth, z[0], outside=1) + rng.uniform(0.17, 0.27, count)
    low = np.full((count, len(z)), 0.9 * tank.nominal_m)
    high = np.repeat(line_m[:, None], len(z), axis=1) + 0.5
    for _ in range(40):
        middle = (low + high) / 2
        place = foot + middle[..., None] * ray[:, None, :]
        place = np.concatenate([place, np.broadcast_to(z[None, :, None], (*low.shape, 1))], axis=2)
        within = tank.surface(outside=1).beyond(place.reshape(-1, 3)).reshape(low.shape) < 0
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    book.tables["lines"] = [
        {"line": f"G{j + 1}", "azimuth_deg": round(float(np.degrees(one)), 2), "side": "outside"}
        for j, one in enumerate(azimuth)
    ]
    book.tables["offsets"] = [
        {"line": f"G{j + 1}", "course": str(course + 1), "level_m": round(float(z[k]), 3),
         "offset_mm": round(float(1000 * (line_m[j] - low[j, k]
             + (3 - 2 * face) * (z[k] - z[0]) * collimation + 4e-4 * rng.normal())), 1),
         "s_mm": 0.5, "face": float(face), "reference": True if k == 0 else None}
        for j in range(count) for k, (course, _) in enumerate(levels) for face in (1, 2)
    ]  # fmt: skip
    return book


def hits_book(tank, rng, setups=1):
    """Hits from one set-up and two circumferences, or from three that share targets."""
    book = _book(tank, "inside")
    book.instruments["ET-5"] = dict(STATION)
    if setups == 1:
        _strap(book, rng, [0], 3)
    else:
        book.instruments["ET-5"]["u_offset_mm"] = 0.7
    offset = (0.002 if setups == 1 else 0.0007) * rng.normal()
    tool = Tool(offset, 1e-5 * rng.normal(), 7e-4 * rng.normal(), 0.001, 5 * ARCSEC)
    surface, radius = tank.surface(outside=0), tank.nominal_m
    at = 0.4 * radius if setups > 1 else 0.18 * radius
    stations = ring_of_stations(setups, at, 1.6, turn=rng.uniform(0, 6))
    zeros = rng.uniform(0, FULL_TURN, setups)
    count = 12 if radius < 7 else 20 if radius < 13 else 28
    book.tables |= {"setups": [], "wall_hits": [], "control": []}
    for i, (station, zero) in enumerate(zip(stations, zeros, strict=True)):
        book.tables["setups"].append(_setup(i, "ET-5", station[2]))
        for course, z in tank.levels((0.22, 0.78)):
            azimuth = FULL_TURN * np.arange(i, count, setups) / count + rng.uniform(0, 0.05)
            aims = surface.at(azimuth, np.full(len(azimuth), z))
            for sight in take_hits(surface, station, aims, tool, rng, zero):
                book.tables["wall_hits"].append(
                    {"setup": f"E{i + 1}", "course": str(course + 1), **_sight(sight)}
                )
    book.tables["control_readings"] = list(_read_again(setups, *rng.spawn(1)))
    if setups > 1:
        targets = [(0.8 * radius, 0.3, 0.6), (0.8 * radius, 1.9, 2.2), (0.8 * radius, 3.4, 1.1),
                   (0.8 * radius, 5.2, 2.9)]  # fmt: skip
        targets = np.array([[r * np.sin(a), r * np.cos(a), z] for r, a, z in targets])
        prisms = Tool(0.0, tool.scale, 0.0, 6e-4, 3 * ARCSEC)
        sights = [
            (i, f"Q{j + 1}", one)
            for i in range(setups)
            for j, one in enumerate(observe(stations[i], targets, prisms, rng, zeros[i]))
        ]
        _tie(book, stations - [0, 0, 1.6], sights, 3.0, 0.7)
    return book


def _read_again(setups, rng):
    """Rows of four control targets that each set-up reads three times."""
    for i in range(setups):
        for target in range(4):
            for hour in (10, 11, 12):
                off = rng.normal(size=3) * (5 * ARCSEC, 5 * ARCSEC, 6e-4)
                sight = _sight((1.5 * target + off[0], 1.5 + off[1], 6 + off[2]))
                yield {"setup": f"E{i + 1}", "target": f"K{target + 1}", **sight,
                       "time": f"2026-01-05T{hour}:00"}  # fmt: skip


def tangents_book(tank, rng, stations=8):
    """Both limbs of two levels of each course, from a traverse whose distances give the scale."""
    book = _book(tank, "outside")
    book.instruments["ET-5"] = {"kind": "total_station", "certificate": "ET 5", "u_scale_ppm": 5.0}
    places = ring_of_stations(stations, 1.95 * tank.nominal_m, 0.0, turn=0.3)
    places[:, :2] += 0.04 * tank.nominal_m * rng.normal(size=(stations, 2))
    places[:, 2] = np.round(rng.uniform(-0.2, 0.2, stations), 3)
    above = np.round(rng.uniform(1.4, 1.7, stations), 3)
    eyes, zeros = places + above[:, None] * [0, 0, 1], rng.uniform(0, FULL_TURN, stations)
    prisms = Tool(0.0, 5e-6 * rng.normal(), 0.0, 5e-4, 2 * ARCSEC)
    book.tables |= {"setups": [], "tangents": [], "control": []}
    sights, levels = [], [z for _, z in tank.levels()]
    given = tank.surface(outside=1), tank.nominal_m
    for i in range(stations):
        book.tables["setups"].append(_setup(i, "ET-5", above[i]))
        read = take_tangents(
            given[0], eyes[i], levels, given[1], Circle(4 * ARCSEC), rng, zeros[i], steps=150
        )
        for z, side, direction, zenith in read:
            angles = _sight((direction, zenith), 5)
            book.tables["tangents"].append(
                {"setup": f"E{i + 1}", "course": str(int(z / tank.course_m) + 1),
                 "level_m": round(float(z), 3), "side": side, **angles, "s_arcsec": 4.0}
            )  # fmt: skip
        for k in ((i - 1) % stations, (i + 1) % stations):
            seen = observe(eyes[i], eyes[k][None], prisms, rng, zeros[i])[0]
            sights.append((i, f"P{k + 1}", seen))
    heights = {f"P{i + 1}": float(one) for i, one in enumerate(above)}
    _tie(book, places, sights, 2.0, 0.5, heights)
    return book


def _setup(index, instrument, height_m):
    return {"setup": f"E{index + 1}", "station": f"P{index + 1}", "instrument": instrument,
            "instrument_height_m": round(float(height_m), 3)}  # fmt: skip


def _sight(sight, digits=4):
    names = ("direction_deg", "zenith_deg", "distance_m")[: len(sight)]
    angles = [round(float(np.degrees(one)), digits) for one in sight[:2]]
    values = [*angles, *(round(float(one), 4) for one in sight[2:])]
    return dict(zip(names, values, strict=True))


def _tie(book, stations, sights, s_arcsec, s_mm, heights=None):
    """Readings of a network, and about where its stations are; the first one is fixed.

    sights   (index of the set-up, name of the target, (direction, zenith angle, distance))
    heights  {target: height above its mark}
    """
    tables = {"directions": [], "zenith_angles": [], "slope_distances": []}
    for i, to, sight in sights:
        read = _sight(sight, 5)
        above = {} if heights is None else {"target_height_m": heights[to]}
        for table, column in zip(tables, read, strict=True):
            sd = {"s_mm": s_mm} if column == "distance_m" else {"s_arcsec": s_arcsec}
            row = {"setup": f"E{i + 1}", "to": to, column: read[column], **sd, **above}
            tables[table].append(row)
    book.tables |= tables
    for i, place in enumerate(stations):
        fixed = {} if i else {"sx_mm": 0.0, "sy_mm": 0.0, "sz_mm": 0.0}
        x, y, z = (round(float(one), 3 if i == 0 else 2) for one in place)
        book.tables["control"].append({"point": f"P{i + 1}", "x_m": x, "y_m": y, "z_m": z, **fixed})
    along = "y" if np.ptp(stations[:2, 0]) > np.ptp(stations[:2, 1]) else "x"
    book.settings |= {
        "adjustment.datum": "minimal",
        "adjustment.datum_points": f"P1:xyz; P2:{along}",
    }


BOOKS = {
    "strapping": strapping_book,
    "lines": lines_book,
    "hits": hits_book,
    "three set-ups": lambda tank, rng: hits_book(tank, rng, 3),
    "tangents": tangents_book,
}
