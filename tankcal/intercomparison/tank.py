"""One physical tank, and its volumes by quadrature of the wall itself.

    tank.volumes_m3([1.0, 2.0], density_kg_m3=850.0)     held below dips, cool, with that head

The wall is any sum of defects (`defects.py`) about a leaning axis; z counts from the foot of the
shell, azimuths clockwise from +y. Panels of Gauss nodes end where a defect is not smooth, so that
the sums converge as they do for smooth functions; `volume_error_m3` is what more nodes change.
"""

from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import leggauss

from tankcal.intercomparison.defects import FULL_TURN, defect_of, plain_of

GRAVITY = 9.80665
NODES, MORE_NODES = 8, 12  # of a panel
PANEL_M, PANELS_ROUND = 0.5, 48  # largest panel in height; fewest round the wall
REFERENCE_C = 20.0
RADII, TURNS = 24, 96  # nodes of the bottom
STEP_M, CLOSE_M, MOST_STEPS = 0.3, 1e-7, 80  # of the search along a ray


@dataclass(frozen=True)
class Wave:
    """A wave of the bottom: its height, and how it runs."""

    size_m: float
    kx: float
    ky: float
    phase: float


@dataclass(frozen=True)
class Floor:
    """The bottom: a cone from the wall to the middle, and waves that die out at the wall.

    depth_m  of the middle below the foot of the shell; below 0: the cone points up
    """

    depth_m: float = 0.0
    waves: tuple = ()

    def height_m(self, x, y, radius_m):
        """z at places about the foot of the axis."""
        part = np.minimum(np.hypot(x, y) / radius_m, 1.0)
        found = -self.depth_m * (1 - part)
        for one in self.waves:
            found = found + one.size_m * np.cos(one.kx * x + one.ky * y + one.phase) * (1 - part**2)
        return found


@dataclass(frozen=True)
class Fitting:
    """A thing in the tank: an upright prism between two heights above the foot of the shell.

    volume_m3  below 0: it takes room     x_m, y_m  where it stands; width_m  across it, 0: flat on
    the wall or the bottom, so that nothing is hidden by it
    """

    name: str
    low_m: float
    high_m: float
    volume_m3: float
    x_m: float = 0.0
    y_m: float = 0.0
    width_m: float = 0.0


@dataclass(frozen=True)
class Tank:
    """An upright tank as it is, at 20 degrees Celsius and empty."""

    name: str
    family: str
    radius_m: float  # nominal, inside
    courses_m: tuple  # heights
    plates_m: tuple
    paint_m: float
    defects: tuple
    lean: tuple  # of the axis: x and y per metre of height
    floor: Floor
    fittings: tuple
    plate_z_m: float  # of the dip plate above the foot of the shell
    e_pa: float
    expansion_per_k: float

    # ---- the wall

    @property
    def height_m(self):
        """Of the shell."""
        return float(sum(self.courses_m))

    @property
    def joints_m(self):
        """(courses + 1,) heights of the welds between courses, foot and top with them."""
        return np.concatenate([[0.0], np.cumsum(self.courses_m)])

    def course_at(self, z):
        """Number of the course at heights, 0 first."""
        inner = self.joints_m[1:-1]
        return np.searchsorted(inner, z, side="right")

    def radii_m(self, azimuth, z):
        """Inside distance of the wall from its axis."""
        azimuth, z = np.broadcast_arrays(np.asarray(azimuth, float), np.asarray(z, float))
        shape, azimuth, z = azimuth.shape, azimuth.ravel(), z.ravel()
        found = np.full(azimuth.shape, self.radius_m)
        for one in self.defects:
            near = (z >= one.low_m) & (z < one.high_m)
            if near.all():
                found += one.offset_m(azimuth, z, self.radius_m)
            elif near.any():
                found[near] += one.offset_m(azimuth[near], z[near], self.radius_m)
        return found.reshape(shape)

    def skin_m(self, z):
        """Plate and paint at heights."""
        return np.asarray(self.plates_m)[self.course_at(z)] + self.paint_m

    def axis_m(self, z):
        """(..., 2) places of the axis."""
        return np.asarray(z, float)[..., None] * np.asarray(self.lean)

    def places_m(self, azimuth, z, off_m=0.0, outside=False):
        """(n, 3) places of the wall, or so far outside it along the ray from the axis."""
        azimuth, z = np.broadcast_arrays(np.asarray(azimuth, float), np.asarray(z, float))
        r = self.radii_m(azimuth, z) + off_m + (self.skin_m(z) if outside else 0.0)
        ray = np.stack([np.sin(azimuth), np.cos(azimuth)], axis=-1)
        return np.concatenate([self.axis_m(z) + r[..., None] * ray, z[..., None]], axis=-1)

    def beyond_m(self, places, outside=False):
        """(n,) how far places (n, 3) lie outside the wall, along the ray from the axis."""
        z = np.clip(places[:, 2], 0.0, self.height_m - 1e-9)
        away = places[:, :2] - self.axis_m(places[:, 2])
        wall = self.radii_m(np.arctan2(away[:, 0], away[:, 1]), z)
        return np.hypot(*away.T) - wall - (self.skin_m(z) if outside else 0.0)

    def ranges_m(self, origin, rays):
        """(n,) how far unit rays (n, 3) go from within to the wall; inf: none below the top."""
        origin = np.asarray(origin, float)
        t, step = self._cylinder_ranges_m(origin, rays), np.empty(len(rays))
        going = np.flatnonzero(np.isfinite(t))
        across = np.ones(len(rays))
        for _ in range(MOST_STEPS):
            if not len(going):
                break
            at, d = origin + t[going, None] * rays[going], rays[going]
            away = at[:, :2] - self.axis_m(at[:, 2])
            r = np.hypot(*away.T)
            slope = np.sum(away * (d[:, :2] - d[:, 2:] * self.lean), axis=1) / r
            across[going] = slope
            step[going] = np.clip(self.beyond_m(at) / np.maximum(slope, 0.1), -STEP_M, STEP_M)
            t[going] -= step[going]
            going = going[np.abs(step[going]) > CLOSE_M]
        z = origin[2] + np.where(np.isfinite(t), t, 0) * rays[:, 2]
        return np.where((z >= 0) & (z < self.height_m), t, np.inf)

    def _cylinder_ranges_m(self, origin, rays):
        """Where rays from within meet the nominal cylinder about the leaning axis."""
        x, y = origin[:2] - self.axis_m(origin[2])
        dx = rays[:, 0] - self.lean[0] * rays[:, 2]
        dy = rays[:, 1] - self.lean[1] * rays[:, 2]
        a, b = dx**2 + dy**2, x * dx + y * dy
        root = b**2 - a * (x**2 + y**2 - self.radius_m**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (-b + np.sqrt(np.maximum(root, 0))) / a
        return np.where((a > 1e-12) & np.isfinite(t), t, np.inf)

    # ---- temperature

    def grown(self, celsius):
        """By how much all lengths are longer at a temperature of the shell."""
        return 1 + self.expansion_per_k * (celsius - REFERENCE_C)

    # ---- volumes

    def volumes_m3(self, dips_m, density_kg_m3=0.0, *, celsius=REFERENCE_C, more=False):
        """(n,) what the tank holds below dips, the shell widened by that liquid's own head.

        Parameters
        ----------
        dips_m : array_like
            Above the dip plate, true lengths; the level is over all of the bottom.
        density_kg_m3 : float or array_like
            Of the liquid; 0: the shell as it is empty.
        celsius : float or array_like
            Temperature of the shell.
        more : bool
            By more nodes, to see what that changes.
        """
        dips, density, celsius = np.broadcast_arrays(
            *(np.atleast_1d(np.asarray(one, float)) for one in (dips_m, density_kg_m3, celsius))
        )
        f = self.grown(celsius)
        levels = dips / f + self.plate_z_m  # of the tank when it is cool
        low, high = self.lowest_level_m, self.height_m
        if np.any(levels < low - 1e-9) or np.any(levels > high + 1e-9):
            raise ValueError(f"levels from {low:.4f} to {high:.4f} m above the foot of the shell")
        order = MORE_NODES if more else NODES
        cool = np.array(
            [self._shell_m3(one, rho, order) for one, rho in zip(levels, density * f, strict=True)]
        )
        cool += self._floor_m3(2) if more else self._below_foot_m3
        for one in self.fittings:
            part = np.clip((levels - one.low_m) / (one.high_m - one.low_m), 0, 1)
            cool += one.volume_m3 * part
        return f**3 * cool

    def volume_error_m3(self, dips_m, density_kg_m3=0.0):
        """The largest change that more nodes make."""
        few = self.volumes_m3(dips_m, density_kg_m3)
        return float(np.abs(few - self.volumes_m3(dips_m, density_kg_m3, more=True)).max())

    @cached_property
    def lowest_level_m(self):
        """Level, above the foot of the shell, from which the bottom is covered."""
        r = np.linspace(0, self.radius_m, 200)
        turn = np.linspace(0, FULL_TURN, 181)
        x, y = r[:, None] * np.sin(turn), r[:, None] * np.cos(turn)
        return float(max(self.floor.height_m(x, y, self.radius_m).max(), 0.0))

    @cached_property
    def _sections(self):
        return {}

    def _section_nodes(self, order):
        """Panels of heights, and at their nodes weight, area, integral of r, plate."""
        if order not in self._sections:
            edges = _panels(
                [*self.joints_m, *(z for one in self.defects for z in one.edges_m())],
                0.0, self.height_m, PANEL_M,
            )  # fmt: skip
            z, weight = _gauss(edges, order)
            turns = [a % FULL_TURN for one in self.defects for a in one.kinks_rad(self.radius_m)]
            around, by = _gauss(_panels(turns, 0.0, FULL_TURN, FULL_TURN / PANELS_ROUND), order)
            area, length = np.empty(len(z)), np.empty(len(z))
            for i, one in enumerate(z):
                r = self.radii_m(around, one)
                area[i], length[i] = by @ r**2 / 2, by @ r
            self._sections[order] = edges, z, weight, area, length
        return self._sections[order]

    def _shell_m3(self, level, density, order):
        """Within the shell from its foot to a level."""
        edges, z, weight, area, length = self._section_nodes(order)
        whole = np.searchsorted(edges, level, side="right") - 1
        n = min(whole, len(edges) - 1) * order
        total = weight[:n] @ self._wide_area(z[:n], area[:n], length[:n], level, density)
        if whole >= len(edges) - 1 or level <= edges[whole]:
            return total
        # the panel that the level cuts: its areas between the nodes by their polynomial
        nodes = slice(n, n + order)
        cut, by = _gauss(np.array([edges[whole], level]), order)
        middle, half = (edges[whole] + edges[whole + 1]) / 2, (edges[whole + 1] - edges[whole]) / 2
        powers = np.polynomial.legendre.legvander((z[nodes] - middle) / half, order - 1)
        at = np.polynomial.legendre.legvander((cut - middle) / half, order - 1)
        cut_area = at @ np.linalg.solve(powers, area[nodes])
        cut_length = at @ np.linalg.solve(powers, length[nodes])
        return total + by @ self._wide_area(cut, cut_area, cut_length, level, density)

    def _wide_area(self, z, area, length, level, density):
        """Areas, the wall moved out as a thin hoop by the liquid above each height."""
        plate = np.asarray(self.plates_m)[self.course_at(z)]
        out = density * GRAVITY * (level - z) * self.radius_m**2 / (self.e_pa * plate)
        return area + out * length + np.pi * out**2

    @cached_property
    def _below_foot_m3(self):
        return self._floor_m3(1)

    def _floor_m3(self, more):
        """Between the bottom and the plane of the foot of the shell, above 0 where it is deeper."""
        turn = FULL_TURN * np.arange(TURNS * more) / (TURNS * more)
        part, by = _gauss(np.array([0.0, 1.0]), RADII * more)
        wall = self.radii_m(turn, 0.0)
        x = part[:, None] * wall * np.sin(turn)
        y = part[:, None] * wall * np.cos(turn)
        deep = -self.floor.height_m(x, y, self.radius_m)
        ring = (deep * part[:, None] * wall**2).mean(axis=1) * FULL_TURN
        return float(by @ ring)

    # ---- as plain data

    def plain(self):
        """The tank as plain data, for the truth file."""
        found = {key: value for key, value in asdict(self).items() if key != "defects"}
        return found | {"defects": [plain_of(one) for one in self.defects]}


def tank_of(plain):
    """The Tank of plain data."""
    given = dict(plain)
    floor = given["floor"]
    given["defects"] = tuple(defect_of(one) for one in given["defects"])
    given["floor"] = Floor(floor["depth_m"], tuple(Wave(**one) for one in floor["waves"]))
    given["fittings"] = tuple(Fitting(**one) for one in given["fittings"])
    for name in ("courses_m", "plates_m", "lean"):
        given[name] = tuple(given[name])
    return Tank(**given)


def _panels(places, low, high, widest):
    """Ends of panels: at these places, and so close that none is wider than that."""
    inside = sorted({round(float(one), 12) for one in places if low < one < high})
    found = [low]
    for one in [*inside, high]:
        count = int(np.ceil((one - found[-1]) / widest - 1e-9))
        if one - found[-1] > 1e-9:
            found += list(np.linspace(found[-1], one, max(count, 1) + 1)[1:])
    return np.array(found)


def _gauss(edges, order):
    """Nodes and weights of panels."""
    node, weight = leggauss(order)
    half = np.diff(edges) / 2
    nodes = (edges[:-1] + half)[:, None] + half[:, None] * node
    return nodes.ravel(), (half[:, None] * weight).ravel()
