"""Tables of a planned survey, generated from a `Design`: one row per reading.

Values in these rows are placeholders; `nominal_readings` replaces them by nominal readings.
"""

import datetime
from itertools import islice

import numpy as np

from tankcal.job.tables import Table
from tankcal.planning.places import find_hidden
from tankcal.planning.wall.filling import rows_of_runs
from tankcal.survey.measurements import angle_of_distance_rad
from tankcal.survey.reference_line import MOST_OFFSETS
from tankcal.survey.strapping import MOST_STRAPS
from tankcal.survey.tangents import MOST_TANGENTS
from tankcal.survey.wall_hits import MOST_HITS
from tankcal.tank.liquid import MOST_ROWS

OFF_WALL_M = 0.2  # distance of a reference line from the wall
USUAL_BAR_M = 2.0  # length of an undescribed stadia; the job reports the missing description
STEEPEST = np.radians(55.0)  # default largest horizontal angle of incidence from a set-up
TIE_HEIGHTS_M = (0.4, 1.4, 2.4)  # heights of tie targets above the foot of the instrument
FIRST_ROUND = datetime.datetime(2000, 1, 1)  # arbitrary origin of times; only intervals matter
CONTROL_SIGHT = {"zenith_deg": 88.0, "distance_m": 10.0}


class DesignTables:
    """Tables of a design on a tank.

    Attributes
    ----------
    design : Design
    courses : tuple
        ((name, height_m), ...) from the bottom up.
    radius_m : float
        Nominal radius.
    bottom_m : float
        z of the bottom.
    zero_m : float
        Height of the table's zero above the bottom.
    volume_at : callable or None
        Function of a dip that returns the approximate volume, m3; None without liquid.
    obstacles : tuple of Box or Pillar
        Sights that they cut are left out.
    bars : dict
        {name: length, m} of stadias.
    """

    def __init__(
        self, design, courses, radius_m, bottom_m, zero_m, volume_at=None, obstacles=(), bars=None
    ):
        self.design, self.radius_m, self.volume_at = design, radius_m, volume_at
        self.bars, self.obstacles = bars or {}, obstacles
        self.bottom_m, self.zero_m = bottom_m, zero_m
        self.foot, foot = {}, 0.0
        for name, height in courses:
            self.foot[name] = (foot, height)
            foot += height

    def tables(self):
        """Return {name: Table}, with decimal points."""
        parts = {  # part of the design: its tables, and the most rows of each
            "straps": (lambda: {"circumferences": self._straps()}, MOST_STRAPS),
            "lines": (lambda: {"lines": self._lines(), "offsets": self._offsets()}, MOST_OFFSETS),
            "hits": (self._tables_of_hits, MOST_HITS),
            "tangents": (lambda: {"tangents": self._tangents()} | self._traverse(), MOST_TANGENTS),
            "runs": (
                lambda: {"liquid": rows_of_runs(self.design.runs, self.volume_at)},
                MOST_ROWS,
            ),
        }
        return {
            name: _table(name, islice(rows, most + 1))
            for part, (make_tables, most) in parts.items()
            if getattr(self.design, part)
            for name, rows in make_tables().items()
        }

    def _tables_of_hits(self):
        """Return {table: rows} of the hits, their set-ups and targets."""
        tables = {
            "wall_hits": self._hits(),
            "setups": self._setups(),
            "control": self._stations(),
            "control_readings": self._control_readings(),
        }
        return tables if self.design.ties is None else tables | self._ties()

    def _height(self, course, percent):
        """Height above the bottom of a percentage of a course; nan for an unknown course."""
        foot, height = self.foot.get(course, (np.nan, np.nan))
        return foot + percent / 100 * height

    def _level(self, course, percent):
        return round(float(self._height(course, percent)) - self.zero_m, 4)

    def _straps(self):
        around = 2 * np.pi * self.radius_m
        for strap in self.design.straps:
            row = {
                "circumference": strap.name,
                "course": strap.course,
                "level_m": self._level(strap.course, strap.at_percent),
                "reading_m": around,
                "s_mm": strap.sd_mm,
            } | dict(strap.more)
            for _ in range(strap.readings):
                yield row

    def _sees(self, place, target):
        """Whether no obstacle lies between two positions (3,)."""
        target = np.array([target])
        return not any(find_hidden(obstacle, place, target)[0] for obstacle in self.obstacles)

    def _lines_in_sight(self):
        """Yield (name, azimuth in degrees, [visible (course, percent)]) of each line.

        A line without sight to the reference level gives no information and is left out.
        """
        lines, (reference, levels) = self.design.lines, self._levels_of_lines()
        off = self.radius_m + (-OFF_WALL_M if lines.side == "inside" else OFF_WALL_M)
        for number in range(lines.count):
            azimuth = (lines.first_deg + 360 * number / lines.count) % 360
            x, y = off * np.sin(np.radians(azimuth)), off * np.cos(np.radians(azimuth))
            foot = np.array([x, y, self.bottom_m])
            seen = [
                level
                for level in levels
                if self._sees(foot, [x, y, foot[2] + self._height(*level)])
            ]
            if reference in seen:
                yield str(number + 1), azimuth, seen

    def _lines(self):
        lines = self.design.lines
        for name, azimuth, _ in self._lines_in_sight():
            yield {
                "line": name,
                "azimuth_deg": azimuth,
                "instrument": lines.instrument,
                "side": lines.side,
            }

    def _levels_of_lines(self):
        """Return the reference level of the lines, and all (course, percent) from the bottom up.

        The reference level is that of the first strap on a level of the lines; this makes U
        smallest.
        """
        lines = self.design.lines
        levels = [(course, percent) for course in self.foot for percent in lines.at_percent]
        strapped = [(strap.course, strap.at_percent) for strap in self.design.straps]
        of_course = [level for level in levels if level[0] in {name for name, _ in strapped}]
        return next(
            (level for level in strapped if level in levels), (of_course or levels)[0]
        ), levels

    def _offsets(self):
        lines, (reference, _) = self.design.lines, self._levels_of_lines()
        for name, _, seen in self._lines_in_sight():
            for face in range(1, lines.faces + 1):
                for course, percent in seen:
                    row = {
                        "line": name,
                        "course": course,
                        "level_m": self._level(course, percent),
                        "offset_mm": 200.0,
                        "s_mm": lines.sd_mm,
                        "face": face,
                        "reference": "true" if (course, percent) == reference else "false",
                    }
                    for _ in range(lines.readings):
                        yield row

    def _setups_of_hits(self):
        """Yield (ring, name of set-up, azimuth of set-up) of all set-ups."""
        for number, ring in enumerate(self.design.hits, 1):
            for k, turn in enumerate(_azimuths_of_ring(ring.start_deg, ring.setups), 1):
                yield ring, f"{number}-{k}", turn

    def _ground_position(self, ring, azimuth):
        """Position (2,) in a ring at an azimuth, unrounded."""
        return ring.radius_m * np.array([np.sin(azimuth), np.cos(azimuth)])

    def _instrument_position(self, ring, azimuth):
        """Position (3,) of the instrument, over the station as rounded in control.csv."""
        station = self._ground_position(ring, azimuth).round(4)
        return np.append(station, self.bottom_m + ring.height_m)

    def _setups(self):
        for ring, name, _ in self._setups_of_hits():
            yield _setup_row(name, ring)

    def _stations(self):
        for ring, name, azimuth in self._setups_of_hits():
            x, y = self._ground_position(ring, azimuth).round(4)
            yield {"point": f"S{name}", "x_m": x, "y_m": y, "z_m": self.bottom_m}

    def _hits(self):
        for ring, name, turn in self._setups_of_hits():
            aims = self._azimuths(ring, turn)
            station = self._instrument_position(ring, turn)
            for course in ring.courses:
                for percent in ring.at_percent:
                    z = self.bottom_m + self._height(course, percent)
                    for aim in aims:
                        aimed = [self.radius_m * np.sin(aim), self.radius_m * np.cos(aim), z]
                        if self._sees(station, aimed):
                            yield {"setup": name, "course": course} | _sight(station, aimed)

    def _control_readings(self):
        """Return the readings of all control targets of a set-up at placeholder positions."""
        control = self.design.control
        for ring, name, turn in self._setups_of_hits():
            for minutes in control.times_min(ring):
                time = (FIRST_ROUND + datetime.timedelta(minutes=float(minutes))).isoformat()
                for number in range(control.targets):
                    aim = np.degrees(turn) + 360 * number / control.targets
                    target = {"setup": name, "target": f"K{name}-{number + 1}"}
                    yield target | CONTROL_SIGHT | {"direction_deg": aim % 360, "time": time[:16]}

    def _azimuths(self, ring, turn):
        """Azimuths (hits,) about the axis, evenly over the full turn or the visible part of it."""
        inside, spread = ring.radius_m < self.radius_m, ring.spread_deg
        if inside and (spread is None or spread >= 360):
            # A set-up at a share of the turn starts at that share of a step: the hits interleave.
            step = 2 * np.pi / ring.hits
            return turn + step * (np.arange(ring.hits) + turn / 2 / np.pi)
        wide = np.radians(spread) if spread is not None else 2 * self._visible_half(ring)
        if ring.hits == 1:
            return np.array([turn])
        return turn + wide * (np.arange(ring.hits) / (ring.hits - 1) - 0.5)

    def _visible_half(self, ring):
        """Half the range of azimuths visible from an outside set-up under at most STEEPEST."""
        # Law of sines in the triangle of axis, set-up and point of the wall: the angle at the
        # set-up has the sine (wall / ring) sin(incidence); the angle at the axis is the rest.
        part = self.radius_m / ring.radius_m
        return STEEPEST - np.arcsin(part * np.sin(STEEPEST))

    def _traverse_stations(self):
        """Yield (name, instrument position (3,)) of the stations of a traverse."""
        for ring in filter(None, (self.design.tangents,)):
            for k, turn in enumerate(_azimuths_of_ring(ring.start_deg, ring.stations), 1):
                yield str(k), self._instrument_position(ring, turn)

    def _tangents(self):
        """Return readings of both limbs at each level, by station, with repetitions."""
        ring = self.design.tangents
        for name, station in self._traverse_stations():
            for course in self.foot:
                for percent in ring.at_percent:
                    z = self.bottom_m + self._height(course, percent)
                    for side in ("left", "right"):
                        if not self._sees(station, self._limb(station, z, side)):
                            continue
                        row = {
                            "setup": name,
                            "course": course,
                            "level_m": self._level(course, percent),
                            "side": side,
                        }
                        row |= tangent_sight(station, z, self.radius_m, side == "right")
                        row["s_arcsec"] = ring.sd_arcsec
                        for _ in range(ring.readings):
                            yield row

    def _limb(self, station, z, side):
        """Point (3,) where a sight from a station touches the wall at a height."""
        azimuth, length = limb_of_circle(station[:2], self.radius_m, is_right=side == "right")
        x, y = station[:2] + length * np.array([np.sin(azimuth), np.cos(azimuth)])
        return np.array([x, y, z])

    def instrument_positions(self):
        """Return (name, instrument position (3,)) of set-ups of hits and stations of tangents."""
        for ring, name, turn in self._setups_of_hits():
            yield name, np.append(self._ground_position(ring, turn), self.bottom_m + ring.height_m)
        yield from self._traverse_stations()

    def cut_lines(self):
        """Return pairs of neighbouring traverse stations with an obstacle between them."""
        stations = list(self._traverse_stations())
        for k, (name, station) in enumerate(stations):
            next_name, next_station = stations[(k + 1) % len(stations)]
            if not self._sees(station, next_station):
                yield name, next_name

    def _traverse(self):
        """Return {table: rows} of set-ups, their stations, and readings between neighbours."""
        ring, stations = self.design.tangents, list(self._traverse_stations())
        s_mm, s_arcsec = ring.traverse
        kinds = _kinds_of_sights(s_mm, s_arcsec)
        kinds = kinds if s_mm is not None else kinds[:-1]
        rows = {"setups": [], "control": [], **{table: [] for table, _, _ in kinds}}
        rows |= {} if ring.bar is None else {"stadia": []}
        for k, (name, station) in enumerate(stations):
            rows["setups"].append(_setup_row(name, ring))
            x, y, _ = station
            rows["control"].append({"point": f"S{name}", "x_m": x, "y_m": y, "z_m": self.bottom_m})
            for beside in ((k - 1) % len(stations), (k + 1) % len(stations)):
                read = _sight(station, stations[beside][1])
                row = {"setup": name, "to": f"S{stations[beside][0]}"}
                for table, key, sd in kinds:
                    high = {"target_height_m": ring.height_m}
                    rows[table].append(row | {key: read[key]} | sd | high)
                if ring.bar is not None:
                    rows["stadia"].append(row | self._bar_sight(station, stations[beside][1]))
        return rows

    def _bar_sight(self, station, beside):
        """Return {column: value} of the angle between the ends of the bar over the next station."""
        name, sd = self.design.tangents.bar
        usual = next(iter(self.bars.values()), USUAL_BAR_M)
        angle = angle_of_distance_rad(np.hypot(*(beside - station)[:2]), self.bars.get(name, usual))
        return {"bar": name, "angle_deg": float(np.degrees(angle)), "s_arcsec": sd}

    def _ties(self):
        """Return readings of the targets between neighbouring set-ups of a ring."""
        targets, s_mm, s_arcsec = self.design.ties
        rows = {"directions": [], "zenith_angles": [], "slope_distances": []}
        for number, ring in enumerate(self.design.hits, 1):
            turns = _azimuths_of_ring(ring.start_deg, ring.setups)
            for k, turn in enumerate(turns):
                station = self._instrument_position(ring, turn)
                # Each set-up reads the targets in the gap after it and in the gap before it.
                gaps = (k, (k - 1) % len(turns)) if len(turns) > 1 else ()
                for gap in gaps:
                    for target in range(targets):
                        position = self._target(ring, turns[gap], target)
                        read = _sight(station, position)
                        row = {
                            "setup": f"{number}-{k + 1}",
                            "to": f"T{number}-{gap + 1}-{target + 1}",
                        }
                        for table, key, sd in _kinds_of_sights(s_mm, s_arcsec):
                            rows[table].append(row | {key: read[key]} | sd)
        return rows

    def _target(self, ring, turn, number):
        """Position (3,) of a target half-way to the next set-up, alternately nearer and farther."""
        azimuth = turn + np.pi / ring.setups
        away = max(ring.radius_m, 1.0) + (0.5 if number % 2 else -0.3) * (1 + number // 2)
        z = self.bottom_m + TIE_HEIGHTS_M[number % 3]
        return np.array([away * np.sin(azimuth), away * np.cos(azimuth), z])


def _azimuths_of_ring(start_deg, count):
    """Azimuths of the evenly distributed stations of a ring, rad."""
    return [np.radians(start_deg) + 2 * np.pi * k / count for k in range(count)]


def tangent_sight(station, z, radius_m, is_right):
    """Return {column: value} of a sight from a station to a limb of a circle about the origin.

    Parameters
    ----------
    station : array_like, shape (3,)
        Position of the instrument, m.
    z : float
        Height of the limb, m.
    radius_m : float
        Radius of the circle, m.
    is_right : bool
        Whether the right limb is sighted.

    Returns
    -------
    dict
        Direction from +y and zenith angle, degrees.
    """
    azimuth, length = limb_of_circle(station[:2], radius_m, is_right=is_right)
    return {
        "direction_deg": float(np.degrees(azimuth) % 360),
        "zenith_deg": float(np.degrees(np.arctan2(length, z - station[2]))),
    }


def limb_of_circle(station_m, radius_m, *, is_right):
    """Sight from a station to a limb of a circle about the origin.

    Parameters
    ----------
    station_m : array_like, shape (2,)
    radius_m : float
    is_right : bool
        Whether the right limb is sighted.

    Returns
    -------
    azimuth_rad, length_m : float
        Azimuth of the sight, clockwise from +y, and its length.
    """
    away = np.hypot(*station_m)
    turn = np.arcsin(radius_m / away) * (1 if is_right else -1)
    return azimuth_of_axis(station_m) + turn, np.sqrt(away**2 - radius_m**2)


def azimuth_of_axis(station_m):
    """Azimuth of the origin from a station (2,)."""
    x, y = station_m
    return np.arctan2(-x, -y)


def _setup_row(name, ring):
    """Row of setups.csv of a set-up in a ring of hits or of tangents."""
    return {
        "setup": name,
        "station": f"S{name}",
        "instrument": ring.instrument,
        "instrument_height_m": ring.height_m,
    }


def _kinds_of_sights(s_mm, s_arcsec):
    """Return (table, column, {sd column: sd}) of readings between stations."""
    return (
        ("directions", "direction_deg", {"s_arcsec": s_arcsec}),
        ("zenith_angles", "zenith_deg", {"s_arcsec": s_arcsec}),
        ("slope_distances", "distance_m", {"s_mm": s_mm}),
    )


def _sight(station, target):
    """Return {column: value} of a sight from a station to a position; circle zero +y."""
    away = np.asarray(target) - station
    distance = float(np.linalg.norm(away))
    return {
        "direction_deg": float(np.degrees(np.arctan2(away[0], away[1])) % 360),
        "zenith_deg": float(np.degrees(np.arccos(away[2] / distance))),
        "distance_m": distance,
    }


def _table(name, rows):
    rows = list(rows)
    headings = tuple(dict.fromkeys(key for row in rows for key in row))
    cells = tuple(tuple(_cell(row.get(key)) for key in headings) for row in rows)
    return Table(f"{name}.csv", headings, 1, cells, tuple(range(2, len(rows) + 2)), ".")


def _cell(value):
    return "" if value is None else value if isinstance(value, str) else repr(float(value))
