"""Bare hits from set-ups inside lying tanks and spheres that are no model of the package.

    parts = parts_of(shell, stations, rng, tool=Tool(...))
    write_folder(folder, parts)

The sight is followed from the instrument to the wall (`generated_hits.take_hits`); no formula of
the package is used. The axis of a lying tank runs to +y, the zero direction of the first set-up.
"""

from dataclasses import dataclass

import numpy as np
from generated_hits import Tool, network_tables, observe, take_hits
from generated_solids import FULL_TURN, Ball, LyingShell
from job_builder import OF_KIND, SETTINGS, VERTICAL_ONLY, Parts

HEIGHT_M = 1.1  # of the instrument above its station
PERFECT = Tool()
COLUMNS = ["setup", "direction_deg", "zenith_deg", "distance_m", "use"]


@dataclass(frozen=True)
class LyingWall:
    """The wall of a `LyingShell`; its axis passes through the origin at half its length."""

    shell: LyingShell

    def at(self, turn, s):
        """(n, 3) places of the wall, x to the right, y along the axis, z up."""
        r = self.shell.radius_at(turn, s)
        along, up, lean = s - self.shell.length_m / 2, -r * np.cos(turn), self._lean
        return np.column_stack(
            [
                r * np.sin(turn),
                along * np.cos(lean) - up * np.sin(lean),
                along * np.sin(lean) + up * np.cos(lean),
            ]
        )

    def beyond(self, places):
        """(n,) how far places (n, 3) lie outside the wall."""
        x, y, z = places.T
        along = y * np.cos(self._lean) + z * np.sin(self._lean)
        up = z * np.cos(self._lean) - y * np.sin(self._lean)
        s = along + self.shell.length_m / 2
        return np.hypot(x, up) - self.shell.radius_at(np.arctan2(x, -up), s)

    def aims(self, count, rng):
        """(n, 3) places all over the wall."""
        s = self.shell.length_m * rng.uniform(0.02, 0.98, count)
        return self.at(FULL_TURN * rng.uniform(size=count), s)

    @property
    def _lean(self):
        return np.arctan(self.shell.tilt)


@dataclass(frozen=True)
class BallWall:
    """The wall of a `Ball` about the origin."""

    ball: Ball

    def beyond(self, places):
        """(n,) how far places (n, 3) lie outside the wall."""
        away = np.linalg.norm(places, axis=1)
        return away - self.ball.radius_at(places / away[:, None])

    def aims(self, count, rng):
        """(n, 3) places all over the wall."""
        way = rng.normal(size=(count, 3))
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        return self.ball.radius_at(way)[:, None] * way


def wall_of(solid):
    """The wall of a generated solid."""
    return LyingWall(solid) if isinstance(solid, LyingShell) else BallWall(solid)


def parts_of(solid, stations, rng, *, hits=120, tool=PERFECT, declared=None, noisy=True):
    """`Parts` of a job; several stations (n, 3) are known, and tied by four targets on the wall.

    declared  {key: value} of the instrument, in place of what is usual
    """
    wall, lying = wall_of(solid), isinstance(solid, LyingShell)
    axes = np.atleast_2d(np.asarray(stations, dtype=float))
    random = rng if noisy else None
    rows, readings = [list(COLUMNS)], {}
    targets, names = wall.aims(4, rng), ("K1", "K2", "K3", "K4")
    for number, axis in enumerate(axes, 1):
        zero = 0.0 if number == 1 else rng.uniform(0, FULL_TURN)
        read = take_hits(wall, axis, wall.aims(hits // len(axes), rng), tool, random, zero)
        angles = np.degrees(read[:, :2])
        rows += [
            [f"I{number}", float(direction), float(zenith), float(distance), None]
            for (direction, zenith), distance in zip(angles, read[:, 2], strict=True)
        ]
        # The instrument has one offset and one scale, for targets and for the wall.
        aimed = Tool(tool.offset_m, tool.scale, sd_m=5e-4 * noisy, sd_rad=1e-5 * noisy)
        readings[f"I{number}"] = (names, observe(axis, targets, aimed, random, zero))
    kind = "horizontal" if lying else "sphere"
    settings = {key: value for key, value in SETTINGS.items() if key not in VERTICAL_ONLY}
    settings |= OF_KIND[kind] | {"tank.kind": kind, "table.step_m": 0.1}
    del settings["horizontal.diameter_m" if lying else "sphere.diameter_m"]
    if lying:
        settings |= {
            "horizontal.length_m": float(solid.length_m),
            "horizontal.azimuth_deg": 0.0,
            "horizontal.dip_from_a_m": float(solid.dip_from_a_m),
        }
    setups = [["setup", "station", "instrument", "instrument_height_m"]]
    setups += [[f"I{i}", f"S{i}", "TS", HEIGHT_M] for i in range(1, len(axes) + 1)]
    tables = {"setups": setups, "wall_hits": rows}
    registers = {"instruments": {"TS": instrument(declared)}}
    if len(axes) > 1:
        tables |= network_tables(readings)
        tables["control"] = _known_stations(axes)
    return Parts(settings, tables, registers=registers)


def _known_stations(axes):
    """Rows of control.csv: each station below its axis, known to half a millimetre."""
    rows = [["point", "x_m", "y_m", "z_m", "sx_mm", "sy_mm", "sz_mm"]]
    for number, (x, y, z) in enumerate(axes.tolist(), 1):
        rows.append([f"S{number}", x, y, z - HEIGHT_M, 0.5, 0.5, 0.5])
    return rows


def instrument(declared=None):
    """Keys of the instrument; a value None removes a key."""
    usual = {"kind": "total_station", "s_mm": 1.0, "s_arcsec": 5.0, "u_offset_mm": 0.5}
    usual |= {"u_scale_ppm": 10.0, "u_incidence_mm": 1.0}
    return {key: value for key, value in (usual | (declared or {})).items() if value is not None}
