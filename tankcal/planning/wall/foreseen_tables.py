"""The tables that a crew will fill in, from a `Design`: a row for each reading.

What is read does not stand in them as a nominal tank would have it: `nominal_readings` says that.
"""

import datetime
from itertools import islice

import numpy as np

from tankcal.job.checks.hits import MOST_HITS
from tankcal.job.checks.lines import MOST_OFFSETS
from tankcal.job.checks.liquid import MOST_ROWS
from tankcal.job.checks.strapping import MOST_STRAPS
from tankcal.job.checks.tangents import MOST_TANGENTS
from tankcal.job.tables import Table
from tankcal.planning.obstacles import find_hidden
from tankcal.planning.wall.filling import rows_of_runs
from tankcal.survey.stadia import angle_of_distance_rad

OFF_WALL_M = 0.2  # of a reference line
USUAL_BAR_M = 2.0  # where nobody describes it, which the job tells
STEEPEST = np.radians(55.0)  # incidence in plan, of a set-up that says nothing of what it sees
TIE_HEIGHTS_M = (0.4, 1.4, 2.4)  # above the instrument's foot: of targets that set-ups share
FIRST_ROUND = datetime.datetime(2000, 1, 1)  # of control targets: only what lies between counts
CONTROL_SIGHT = {"zenith_deg": 88.0, "distance_m": 10.0}


class Foreseen:
    """Tables of a design on a tank.

    design  Design              courses  ((name, height_m), ...) from the bottom up
    radius_m  nominal           bottom_m  z of the bottom     zero_m  of the table above it
    holds     function of a dip that gives m3, roughly; None: nothing is filled in
    obstacles  Box and Pillar: sights that they cut are left out
    bars      {name: length, m} of stadias
    """

    def __init__(
        self, design, courses, radius_m, bottom_m, zero_m, holds=None, obstacles=(), bars=None
    ):
        self.design, self.radius_m, self.holds = design, radius_m, holds
        self.bars, self.obstacles = bars or {}, obstacles
        self.bottom_m, self.zero_m = bottom_m, zero_m
        self.foot, foot = {}, 0.0
        for name, height in courses:
            self.foot[name] = (foot, height)
            foot += height

    def tables(self):
        """{name: Table}, of decimal points."""
        found = {}
        if self.design.straps:
            found["circumferences"] = self._straps(), MOST_STRAPS
        if self.design.lines is not None:
            found["lines"] = self._lines(), MOST_OFFSETS
            found["offsets"] = self._offsets(), MOST_OFFSETS
        if self.design.hits:
            found["wall_hits"] = self._hits(), MOST_HITS
            found["setups"] = self._setups(), MOST_HITS
            found["control"] = self._stations(), MOST_HITS
            found["control_readings"] = self._control_readings(), MOST_HITS
            if self.design.ties is not None:
                found |= {name: (rows, MOST_HITS) for name, rows in self._ties().items()}
        if self.design.tangents is not None:
            found["tangents"] = self._tangents(), MOST_TANGENTS
            found |= {name: (rows, MOST_TANGENTS) for name, rows in self._traverse().items()}
        if self.design.runs:
            found["liquid"] = rows_of_runs(self.design.runs, self.holds), MOST_ROWS
        return {name: _table(name, islice(rows, most + 1)) for name, (rows, most) in found.items()}

    def _height(self, course, percent):
        """Above the bottom; nan: of no course."""
        foot, height = self.foot.get(course, (np.nan, np.nan))
        return foot + percent / 100 * height

    def _level(self, course, percent):
        return round(float(self._height(course, percent)) - self.zero_m, 4)

    def _straps(self):
        around = 2 * np.pi * self.radius_m
        for one in self.design.straps:
            row = {
                "circumference": one.name,
                "course": one.course,
                "level_m": self._level(one.course, one.at_percent),
                "reading_m": around,
                "s_mm": one.sd_mm,
            } | dict(one.more)
            for _ in range(one.readings):
                yield row

    def _sees(self, place, there):
        """Whether no obstacle is between two places (3,)."""
        there = np.array([there])
        return not any(find_hidden(one, place, there)[0] for one in self.obstacles)

    def _lines_in_sight(self):
        """(name, azimuth in degrees, [(course, percent) that is seen along it]) of each line.

        A line that does not see the reference level tells nothing.
        """
        lines, (reference, levels) = self.design.lines, self._levels_of_lines()
        off = self.radius_m + (-OFF_WALL_M if lines.side == "inside" else OFF_WALL_M)
        for number in range(lines.count):
            azimuth = (lines.first_deg + 360 * number / lines.count) % 360
            x, y = off * np.sin(np.radians(azimuth)), off * np.cos(np.radians(azimuth))
            foot = np.array([x, y, self.bottom_m])
            seen = [one for one in levels if self._sees(foot, [x, y, foot[2] + self._height(*one)])]
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
        """The reference level of the lines, and all (course, percent) from the bottom up.

        The reference is that of the first strap that lies on one: then U is the least.
        """
        lines = self.design.lines
        levels = [(course, percent) for course in self.foot for percent in lines.at_percent]
        strapped = [(one.course, one.at_percent) for one in self.design.straps]
        of_course = [level for level in levels if level[0] in {name for name, _ in strapped}]
        return next((one for one in strapped if one in levels), (of_course or levels)[0]), levels

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

    def _rings(self):
        """(ring, name of a set-up, azimuth of its place) of all."""
        for number, ring in enumerate(self.design.hits, 1):
            for k in range(ring.setups):
                turn = np.radians(ring.start_deg) + 2 * np.pi * k / ring.setups
                yield ring, f"{number}-{k + 1}", turn

    def _place(self, ring, azimuth):
        return ring.radius_m * np.array([np.sin(azimuth), np.cos(azimuth)])

    def _setups(self):
        for ring, name, _ in self._rings():
            yield {
                "setup": name,
                "station": f"S{name}",
                "instrument": ring.instrument,
                "instrument_height_m": ring.height_m,
            }

    def _stations(self):
        for ring, name, azimuth in self._rings():
            x, y = self._place(ring, azimuth).round(4)
            yield {"point": f"S{name}", "x_m": x, "y_m": y, "z_m": self.bottom_m}

    def _hits(self):
        for ring, name, turn in self._rings():
            aims = self._azimuths(ring, turn)
            station = np.append(self._place(ring, turn).round(4), self.bottom_m + ring.height_m)
            for course in ring.courses:
                for percent in ring.at_percent:
                    z = self.bottom_m + self._height(course, percent)
                    for aim in aims:
                        there = [self.radius_m * np.sin(aim), self.radius_m * np.cos(aim), z]
                        if self._sees(station, there):
                            yield {"setup": name, "course": course} | _sight(station, there)

    def _control_readings(self):
        """All control targets of a set-up, round by round; where they stand the crew will see."""
        control = self.design.control
        for ring, name, turn in self._rings():
            for minutes in control.times_min(ring):
                time = (FIRST_ROUND + datetime.timedelta(minutes=float(minutes))).isoformat()
                for number in range(control.targets):
                    aim = np.degrees(turn) + 360 * number / control.targets
                    target = {"setup": name, "target": f"K{name}-{number + 1}"}
                    yield target | CONTROL_SIGHT | {"direction_deg": aim % 360, "time": time[:16]}

    def _azimuths(self, ring, turn):
        """(hits,) about the axis: even over the whole turn, or over what a set-up sees of it."""
        inside, spread = ring.radius_m < self.radius_m, ring.spread_deg
        if inside and (spread is None or spread >= 360):
            step = 2 * np.pi / ring.hits
            return turn + step * (np.arange(ring.hits) + turn / 2 / np.pi)
        wide = np.radians(spread or 0.0) if spread is not None else 2 * self._in_sight(ring)
        if ring.hits == 1:
            return np.array([turn])
        return turn + wide * (np.arange(ring.hits) / (ring.hits - 1) - 0.5)

    def _in_sight(self, ring):
        """Half the azimuths that a set-up round the tank sees under no more than STEEPEST."""
        part = self.radius_m / ring.radius_m
        return STEEPEST - np.arcsin(part * np.sin(STEEPEST))

    def _stands(self):
        """(name, place (3,) of the instrument) of the stations of a traverse."""
        ring = self.design.tangents
        for k in range(ring.stations):
            turn = np.radians(ring.start_deg) + 2 * np.pi * k / ring.stations
            there = self._place(ring, turn).round(4)
            yield str(k + 1), np.append(there, self.bottom_m + ring.height_m)

    def _tangents(self):
        """Both limbs of each level, station by station, each as often as it is read."""
        ring = self.design.tangents
        for name, there in self._stands():
            for course in self.foot:
                for percent in ring.at_percent:
                    z = self.bottom_m + self._height(course, percent)
                    for side in ("left", "right"):
                        if not self._sees(there, self._limb(there, z, side)):
                            continue
                        row = {
                            "setup": name,
                            "course": course,
                            "level_m": self._level(course, percent),
                            "side": side,
                        }
                        row |= tangent_sight(there, z, self.radius_m, side == "right")
                        row["s_arcsec"] = ring.sd_arcsec
                        for _ in range(ring.readings):
                            yield row

    def _limb(self, there, z, side):
        """(3,) place that a sight from a station touches at a height."""
        azimuth, length = limb_of_circle(there[:2], self.radius_m, is_right=side == "right")
        x, y = there[:2] + length * np.array([np.sin(azimuth), np.cos(azimuth)])
        return np.array([x, y, z])

    def stands(self):
        """(name, place (3,) of the instrument) of each set-up of hits, each station of tangents."""
        for ring, name, turn in self._rings():
            yield name, np.append(self._place(ring, turn), self.bottom_m + ring.height_m)
        if self.design.tangents is not None:
            yield from self._stands()

    def lines_cut(self):
        """(name, name of the next) stations of a traverse that obstacles stand between."""
        stands = [] if self.design.tangents is None else list(self._stands())
        for k, (name, there) in enumerate(stands):
            after, beside = stands[(k + 1) % len(stands)]
            if not self._sees(there, beside):
                yield name, after

    def _traverse(self):
        """{table: rows} of the set-ups, their stations, and the readings between neighbours."""
        ring, stands = self.design.tangents, list(self._stands())
        s_mm, s_arcsec = ring.traverse
        kinds = _kinds_of_sights(s_mm, s_arcsec)
        kinds = kinds if s_mm is not None else kinds[:-1]
        found = {"setups": [], "control": [], **{table: [] for table, _, _ in kinds}}
        found |= {} if ring.bar is None else {"stadia": []}
        for k, (name, there) in enumerate(stands):
            found["setups"].append(
                {
                    "setup": name,
                    "station": f"S{name}",
                    "instrument": ring.instrument,
                    "instrument_height_m": ring.height_m,
                }
            )
            x, y, _ = there
            found["control"].append({"point": f"S{name}", "x_m": x, "y_m": y, "z_m": self.bottom_m})
            for beside in ((k - 1) % len(stands), (k + 1) % len(stands)):
                read = _sight(there, stands[beside][1])
                row = {"setup": name, "to": f"S{stands[beside][0]}"}
                for table, key, sd in kinds:
                    high = {"target_height_m": ring.height_m}
                    found[table].append(row | {key: read[key]} | sd | high)
                if ring.bar is not None:
                    found["stadia"].append(row | self._bar_sight(there, stands[beside][1]))
        return found

    def _bar_sight(self, there, beside):
        """{column: value} of the angle to the ends of the bar over the next station."""
        name, sd = self.design.tangents.bar
        usual = next(iter(self.bars.values()), USUAL_BAR_M)
        angle = angle_of_distance_rad(np.hypot(*(beside - there)[:2]), self.bars.get(name, usual))
        return {"bar": name, "angle_deg": float(np.degrees(angle)), "s_arcsec": sd}

    def _ties(self):
        """Readings of targets that stand between neighbouring set-ups of a ring."""
        targets, s_mm, s_arcsec = self.design.ties
        found = {"directions": [], "zenith_angles": [], "slope_distances": []}
        rings = list(self._rings())
        for number, ring in enumerate(self.design.hits, 1):
            mine = [one for one in rings if one[0] is ring and one[1].startswith(f"{number}-")]
            for k, (_, name, turn) in enumerate(mine):
                station = np.append(self._place(ring, turn).round(4), self.bottom_m + ring.height_m)
                gaps = dict.fromkeys([k, (k - 1) % len(mine)]) if len(mine) > 1 else ()
                for gap in gaps:
                    for target in range(targets):
                        there = self._target(ring, mine[gap][2], target)
                        read = _sight(station, there)
                        row = {"setup": name, "to": f"T{number}-{gap + 1}-{target + 1}"}
                        for table, key, sd in _kinds_of_sights(s_mm, s_arcsec):
                            found[table].append(row | {key: read[key]} | sd)
        return found

    def _target(self, ring, turn, number):
        """(3,) place of a target half-way to the next set-up, in turn nearer and further."""
        azimuth = turn + np.pi / ring.setups
        away = max(ring.radius_m, 1.0) + (0.5 if number % 2 else -0.3) * (1 + number // 2)
        z = self.bottom_m + TIE_HEIGHTS_M[number % 3]
        return np.array([away * np.sin(azimuth), away * np.cos(azimuth), z])


def tangent_sight(station, z, radius_m, is_right):
    """{column: value} of the sight from a station to a limb of a circle about the origin.

    A circle's zero is +y; z  of the level that is touched
    """
    azimuth, length = limb_of_circle(station[:2], radius_m, is_right=is_right)
    return {
        "direction_deg": float(np.degrees(azimuth) % 360),
        "zenith_deg": float(np.degrees(np.arctan2(length, z - station[2]))),
    }


def limb_of_circle(station_m, radius_m, *, is_right):
    """Azimuth of a sight from a station (2,) to a limb of a circle about the origin, its length."""
    away = np.hypot(*station_m)
    turn = np.arcsin(radius_m / away) * (1 if is_right else -1)
    return azimuth_of_axis(station_m) + turn, np.sqrt(away**2 - radius_m**2)


def azimuth_of_axis(station_m):
    """Of the origin, from a station (2,)."""
    x, y = station_m
    return np.arctan2(-x, -y)


def _kinds_of_sights(s_mm, s_arcsec):
    """(table, column, {column of its standard deviation: that}) of readings between stations."""
    return (
        ("directions", "direction_deg", {"s_arcsec": s_arcsec}),
        ("zenith_angles", "zenith_deg", {"s_arcsec": s_arcsec}),
        ("slope_distances", "distance_m", {"s_mm": s_mm}),
    )


def _sight(station, there):
    """{column: value} of the sight from a station to a place, a circle's zero being +y."""
    away = np.asarray(there) - station
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
