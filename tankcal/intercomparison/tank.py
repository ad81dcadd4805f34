"""Simulated physical tank, and its volumes by quadrature of the wall.

    tank.volumes_m3([1.0, 2.0], density_kg_m3=850.0)     volumes below dips, with this liquid

The wall is a cylinder about a tilted axis plus a sum of defects (`defects.py`). Heights z are above
the foot of the shell, and azimuths are clockwise from +y. Panels of Gauss nodes end where a defect
is not smooth, so that the quadrature converges as for smooth functions. `volume_error_m3` estimates
its error by more nodes.
"""

from dataclasses import asdict, dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import leggauss

from tankcal.intercomparison.defects import defect_of, plain_of
from tankcal.units import FULL_TURN, STANDARD_GRAVITY

NODES, MORE_NODES = 8, 12  # Gauss nodes of a panel: normal, and for the estimate of the error
PANEL_M, PANELS_ROUND = 0.5, 48  # largest height of a panel, least number of panels round the wall
REFERENCE_C = 20.0  # temperature of the shell at which lengths are stated
RADII, TURNS = 24, 96  # nodes of the bottom: along the radius, round the tank
# Intersection of a ray with the wall: largest step, last step and number of iterations.
STEP_M, CLOSE_M, MOST_STEPS = 0.3, 1e-7, 80


@dataclass(frozen=True)
class Wave:
    """A wave of the bottom: amplitude, m, wave numbers in x and y, rad/m, and phase, rad."""

    size_m: float
    kx: float
    ky: float
    phase: float


@dataclass(frozen=True)
class Floor:
    """The bottom: a cone from the wall to the middle, and waves that vanish at the wall.

    Attributes
    ----------
    depth_m : float
        Depth of the middle below the foot of the shell; negative for a cone upwards.
    waves : tuple of Wave
        Waves of the bottom.
    """

    depth_m: float = 0.0
    waves: tuple = ()

    def height_m(self, x, y, radius_m):
        """Heights z of the bottom at places x, y from the foot of the axis, m."""
        part = np.minimum(np.hypot(x, y) / radius_m, 1.0)
        height = -self.depth_m * (1 - part)
        for wave in self.waves:
            height = height + wave.size_m * np.cos(wave.kx * x + wave.ky * y + wave.phase) * (
                1 - part**2
            )
        return height


@dataclass(frozen=True)
class Fitting:
    """Deadwood: an upright prism between two heights above the foot of the shell.

    Attributes
    ----------
    name : str
        Name of the deadwood.
    low_m, high_m : float
        Heights of its ends above the foot of the shell.
    volume_m3 : float
        Volume; negative if it reduces the volume of the liquid.
    x_m, y_m : float
        Place relative to the axis.
    width_m : float
        Width; 0 for deadwood at the wall or the bottom that hides no part of the wall.
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
    """A true upright tank, empty and at 20 degrees Celsius."""

    name: str
    family: str
    radius_m: float  # nominal inside radius
    courses_m: tuple  # heights of the courses
    plates_m: tuple  # plate thicknesses of the courses
    paint_m: float  # thickness of the paint
    defects: tuple
    lean: tuple  # tilt of the axis in x and y, per metre of height
    floor: Floor
    fittings: tuple
    plate_z_m: float  # height of the dip plate above the foot of the shell
    e_pa: float
    expansion_per_k: float

    # ---- the wall

    @property
    def height_m(self):
        """Height of the shell, m."""
        return float(sum(self.courses_m))

    @property
    def joints_m(self):
        """Heights (courses + 1,) of the welds between courses, with foot and top, m."""
        return np.concatenate([[0.0], np.cumsum(self.courses_m)])

    def course_at(self, z):
        """Index of the course at heights z, from 0 at the bottom."""
        inner = self.joints_m[1:-1]
        return np.searchsorted(inner, z, side="right")

    def radii_m(self, azimuth, z):
        """Inside distances of the wall from its axis at azimuths and heights, m."""
        azimuth, z = np.broadcast_arrays(np.asarray(azimuth, float), np.asarray(z, float))
        shape, azimuth, z = azimuth.shape, azimuth.ravel(), z.ravel()
        radius = np.full(azimuth.shape, self.radius_m)
        for defect in self.defects:
            inside = (z >= defect.low_m) & (z < defect.high_m)
            if inside.all():
                radius += defect.offset_m(azimuth, z, self.radius_m)
            elif inside.any():
                radius[inside] += defect.offset_m(azimuth[inside], z[inside], self.radius_m)
        return radius.reshape(shape)

    def skin_m(self, z):
        """Thickness of plate and paint at heights z, m."""
        return np.asarray(self.plates_m)[self.course_at(z)] + self.paint_m

    def axis_m(self, z):
        """Places (..., 2) of the axis at heights z (...), m."""
        return np.asarray(z, float)[..., None] * np.asarray(self.lean)

    def places_m(self, azimuth, z, off_m=0.0, outside=False):
        """Points (n, 3) of the wall, m, or at the distance `off_m` outwards from it."""
        azimuth, z = np.broadcast_arrays(np.asarray(azimuth, float), np.asarray(z, float))
        r = self.radii_m(azimuth, z) + off_m + (self.skin_m(z) if outside else 0.0)
        ray = np.stack([np.sin(azimuth), np.cos(azimuth)], axis=-1)
        return np.concatenate([self.axis_m(z) + r[..., None] * ray, z[..., None]], axis=-1)

    def beyond_m(self, places, outside=False):
        """Distances (n,) of points (n, 3) outwards from the wall, along rays from the axis, m."""
        z = np.clip(places[:, 2], 0.0, self.height_m - 1e-9)
        offset = places[:, :2] - self.axis_m(places[:, 2])
        wall = self.radii_m(np.arctan2(offset[:, 0], offset[:, 1]), z)
        return np.hypot(*offset.T) - wall - (self.skin_m(z) if outside else 0.0)

    def ranges_m(self, origin, rays):
        """Distances (n,) to the wall along unit rays (n, 3) from an inside origin, m.

        The distance is inf if a ray does not meet the wall.
        """
        origin = np.asarray(origin, float)
        t, step = self._cylinder_ranges_m(origin, rays), np.empty(len(rays))
        going = np.flatnonzero(np.isfinite(t))
        across = np.ones(len(rays))
        # Newton steps from the nominal cylinder; a bound on the slope and the step keeps rays
        # that graze the wall stable.
        for _ in range(MOST_STEPS):
            if not len(going):
                break
            point, d = origin + t[going, None] * rays[going], rays[going]
            offset = point[:, :2] - self.axis_m(point[:, 2])
            r = np.hypot(*offset.T)
            slope = np.sum(offset * (d[:, :2] - d[:, 2:] * self.lean), axis=1) / r
            across[going] = slope
            step[going] = np.clip(self.beyond_m(point) / np.maximum(slope, 0.1), -STEP_M, STEP_M)
            t[going] -= step[going]
            going = going[np.abs(step[going]) > CLOSE_M]
        z = origin[2] + np.where(np.isfinite(t), t, 0) * rays[:, 2]
        return np.where((z >= 0) & (z < self.height_m), t, np.inf)

    def _cylinder_ranges_m(self, origin, rays):
        """Distances (n,) of the nominal cylinder about the tilted axis along rays (n, 3), m."""
        x, y = origin[:2] - self.axis_m(origin[2])
        dx = rays[:, 0] - self.lean[0] * rays[:, 2]
        dy = rays[:, 1] - self.lean[1] * rays[:, 2]
        a, b = dx**2 + dy**2, x * dx + y * dy
        root = b**2 - a * (x**2 + y**2 - self.radius_m**2)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (-b + np.sqrt(np.maximum(root, 0))) / a
        return np.where((a > 1e-12) & np.isfinite(t), t, np.inf)

    # ---- temperature

    def expansion_factor(self, celsius):
        """Factor of all lengths at a temperature of the shell, relative to REFERENCE_C."""
        return 1 + self.expansion_per_k * (celsius - REFERENCE_C)

    # ---- volumes

    def volumes_m3(self, dips_m, density_kg_m3=0.0, *, celsius=REFERENCE_C, more=False):
        """Volumes (n,) of the tank below dips, with the shell expanded by the liquid head, m3.

        Parameters
        ----------
        dips_m : array_like, shape (n,)
            True heights above the dip plate, m, at which the level covers the whole bottom.
        density_kg_m3 : float or array_like
            Density of the liquid; 0 for an empty shell.
        celsius : float or array_like
            Temperature of the shell.
        more : bool
            Whether to use more nodes, for the estimate of the numerical error.

        Raises
        ------
        ValueError
            For levels below the lowest level or above the shell.
        """
        dips, density, celsius = np.broadcast_arrays(
            *(np.atleast_1d(np.asarray(item, float)) for item in (dips_m, density_kg_m3, celsius))
        )
        f = self.expansion_factor(celsius)
        levels = dips / f + self.plate_z_m  # at the reference temperature
        low, high = self.lowest_level_m, self.height_m
        if np.any(levels < low - 1e-9) or np.any(levels > high + 1e-9):
            raise ValueError(f"levels from {low:.4f} to {high:.4f} m above the foot of the shell")
        order = MORE_NODES if more else NODES
        # Head, radius and plate thickness all expand by f. In lengths at the reference temperature,
        # the radial displacement is therefore the displacement for density * f.
        cool = np.array(
            [
                self._shell_m3(item, rho, order)
                for item, rho in zip(levels, density * f, strict=True)
            ]
        )
        cool += self._floor_m3(2) if more else self._below_foot_m3
        for item in self.fittings:
            part = np.clip((levels - item.low_m) / (item.high_m - item.low_m), 0, 1)
            cool += item.volume_m3 * part
        return f**3 * cool

    def volume_error_m3(self, dips_m, density_kg_m3=0.0):
        """Numerical error of the volumes: largest change with more nodes, m3."""
        few = self.volumes_m3(dips_m, density_kg_m3)
        return float(np.abs(few - self.volumes_m3(dips_m, density_kg_m3, more=True)).max())

    @cached_property
    def lowest_level_m(self):
        """Lowest level that covers the bottom, above the foot of the shell, m."""
        r = np.linspace(0, self.radius_m, 200)
        turn = np.linspace(0, FULL_TURN, 181)
        x, y = r[:, None] * np.sin(turn), r[:, None] * np.cos(turn)
        return float(max(self.floor.height_m(x, y, self.radius_m).max(), 0.0))

    @cached_property
    def _sections(self):
        """Cache of `_section_nodes`, {order: result}."""
        return {}

    def _section_nodes(self, order):
        """Edges of the panels in height, and z, weight, area and integral of r at their nodes."""
        if order not in self._sections:
            edges = _panels(
                [*self.joints_m, *(z for item in self.defects for z in item.edges_m())],
                0.0, self.height_m, PANEL_M,
            )  # fmt: skip
            z, weight = _gauss(edges, order)
            turns = [a % FULL_TURN for item in self.defects for a in item.kinks_rad(self.radius_m)]
            around, by = _gauss(_panels(turns, 0.0, FULL_TURN, FULL_TURN / PANELS_ROUND), order)
            area, length = np.empty(len(z)), np.empty(len(z))
            for i, item in enumerate(z):
                r = self.radii_m(around, item)
                area[i], length[i] = by @ r**2 / 2, by @ r
            self._sections[order] = edges, z, weight, area, length
        return self._sections[order]

    def _shell_m3(self, level, density, order):
        """Volume in the shell from its foot to a level, m3, by `order` nodes in each panel."""
        edges, z, weight, area, length = self._section_nodes(order)
        whole = np.searchsorted(edges, level, side="right") - 1
        n = min(whole, len(edges) - 1) * order
        total = weight[:n] @ self._wide_area(z[:n], area[:n], length[:n], level, density)
        if whole >= len(edges) - 1 or level <= edges[whole]:
            return total
        # In the panel that contains the level, the polynomial through the nodes gives the areas.
        nodes = slice(n, n + order)
        cut, by = _gauss(np.array([edges[whole], level]), order)
        middle, half = (edges[whole] + edges[whole + 1]) / 2, (edges[whole + 1] - edges[whole]) / 2
        powers = np.polynomial.legendre.legvander((z[nodes] - middle) / half, order - 1)
        basis = np.polynomial.legendre.legvander((cut - middle) / half, order - 1)
        cut_area = basis @ np.linalg.solve(powers, area[nodes])
        cut_length = basis @ np.linalg.solve(powers, length[nodes])
        return total + by @ self._wide_area(cut, cut_area, cut_length, level, density)

    def _wide_area(self, z, area, length, level, density):
        """Areas of sections, with the wall expanded as a thin hoop by the liquid above, m2."""
        plate = np.asarray(self.plates_m)[self.course_at(z)]
        # Radial displacement p R^2 / (E t) with the pressure p at each height.
        out = density * STANDARD_GRAVITY * (level - z) * self.radius_m**2 / (self.e_pa * plate)
        return area + out * length + np.pi * out**2

    @cached_property
    def _below_foot_m3(self):
        """Volume between the bottom and the plane of the foot, m3."""
        return self._floor_m3(1)

    def _floor_m3(self, more):
        """Volume between the bottom and the plane of the foot, positive for a deeper bottom, m3.

        `more` multiplies the number of nodes.
        """
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
        """Plain data of the tank for the truth file."""
        plain_data = {key: value for key, value in asdict(self).items() if key != "defects"}
        return plain_data | {"defects": [plain_of(defect) for defect in self.defects]}


def tank_of(plain):
    """Build the `Tank` from plain data."""
    values = dict(plain)
    floor = values["floor"]
    values["defects"] = tuple(defect_of(item) for item in values["defects"])
    values["floor"] = Floor(floor["depth_m"], tuple(Wave(**item) for item in floor["waves"]))
    values["fittings"] = tuple(Fitting(**item) for item in values["fittings"])
    for name in ("courses_m", "plates_m", "lean"):
        values[name] = tuple(values[name])
    return Tank(**values)


def _panels(places, low, high, widest):
    """Edges of panels from low to high, at all `places` and at most `widest` apart."""
    inside = sorted({round(float(place), 12) for place in places if low < place < high})
    edges = [low]
    for place in [*inside, high]:
        count = int(np.ceil((place - edges[-1]) / widest - 1e-9))
        if place - edges[-1] > 1e-9:
            edges += list(np.linspace(edges[-1], place, max(count, 1) + 1)[1:])
    return np.array(edges)


def _gauss(edges, order):
    """Gauss nodes and weights of all panels between these edges, for `order` nodes in a panel."""
    node, weight = leggauss(order)
    half = np.diff(edges) / 2
    nodes = (edges[:-1] + half)[:, None] + half[:, None] * node
    return nodes.ravel(), (half[:, None] * weight).ravel()
