"""Simulated physical tank with defects of its wall, and its volumes by quadrature.

    tank.volumes_m3([1.0, 2.0], density_kg_m3=850.0)     volumes below dips, with this liquid

The wall is a cylinder about a tilted axis plus a sum of defects, functions of azimuth and height.
Heights z are above the foot of the shell, and azimuths are clockwise from +y. No defect has the
form that `tankcal.geometry.field` assumes for a wall: cusps, chords and caps are bounded, and
depend jointly on height and azimuth.

Each defect provides the places where it is not smooth (`kinks_rad`, `edges_m`). Panels of Gauss
nodes end there, so that the quadrature converges as for smooth functions. `volume_error_m3`
estimates its error by more nodes.

Random tanks from families of typical new and aged shells
---------------------------------------------------------

    tank = draw_tank(rng, "T01", "brick")

coil    one to three seams over the full height, 5 to 30 mm, and an oval wall
brick   plates in brick pattern: peaking at vertical welds, banding at horizontal welds
dented  dents, and plates that were not rolled at their ends
leaning a tilt of 3 to 6 mm/m, and an ovality that grows to the top as after settlement
buckled one or two buckles of 15 to 50 mm, and contracted horizontal welds
round   nearly round: only steps between courses, and small waves from rolling

Every family has steps of the radius between courses, bulges between welds and waves round the
shell. The sizes do not exceed the tolerances of API 650 (radius 13 to 25 mm, peaking and banding
13 mm, plumbness 1/200), except those of buckles and tilt, which are typical of old tanks.
"""

from dataclasses import asdict, dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss

from tankcal.units import FULL_TURN, STANDARD_GRAVITY


def signed_arc(azimuth, at, radius_m):
    """Signed arc from the azimuth `at` to other azimuths, the shorter way round, m."""
    difference = azimuth - at
    return radius_m * (difference - FULL_TURN * np.round(difference / FULL_TURN))


def smooth_step(part):
    """Smooth step: 0 up to 0, 1 from 1, and a cubic with zero slope at both ends in between."""
    part = np.clip(part, 0.0, 1.0)
    return part * part * (3 - 2 * part)


def cap_of(part):
    """Cap: 1 at 0, a squared cosine from -1 to 1, and 0 beyond."""
    return np.cos(np.pi / 2 * np.clip(part, -1, 1)) ** 2


@dataclass(frozen=True)
class Defect:
    """Base of all defects, with the heights above the foot of the shell between which it acts."""

    low_m: float
    high_m: float

    def offset_m(self, azimuth, z, radius_m):
        """Offset (n,) of the wall outwards from the nominal radius, m.

        Parameters
        ----------
        azimuth, z : ndarray, shape (n,)
            Azimuths, rad, and heights between `low_m` and `high_m`.
        radius_m : float
            Nominal radius, m.
        """
        raise NotImplementedError

    def kinks_rad(self, radius_m):
        """Azimuths at which the defect is not smooth, rad."""
        return ()

    def edges_m(self):
        """Heights at which the defect is not smooth, m."""
        return (self.low_m, self.high_m)


@dataclass(frozen=True)
class Oval(Defect):
    """A wave round the shell whose size and phase change with the height."""

    waves: int
    foot_size_m: float
    top_size_m: float
    phase_rad: float
    turn_rad: float

    def offset_m(self, azimuth, z, radius_m):
        up = (z - self.low_m) / (self.high_m - self.low_m)
        size = self.foot_size_m + (self.top_size_m - self.foot_size_m) * up
        return size * np.cos(self.waves * azimuth - self.phase_rad - self.turn_rad * up)


@dataclass(frozen=True)
class Seam(Defect):
    """A vertical seam or weld: a ridge or valley with flanks that decay as exp(-arc / flank)."""

    azimuth_rad: float
    size_m: float
    flank_m: float
    fade_m: float  # length of the transition at both ends in height; 0 for a sharp end

    def offset_m(self, azimuth, z, radius_m):
        arc = np.abs(signed_arc(azimuth, self.azimuth_rad, radius_m))
        return self.size_m * np.exp(-arc / self.flank_m) * _fade_factor(self, z)

    def kinks_rad(self, radius_m):
        return (self.azimuth_rad, self.azimuth_rad + np.pi)

    def edges_m(self):
        return _fade_edges(self)


@dataclass(frozen=True)
class Band(Defect):
    """A horizontal weld that contracts the wall all round, with flanks above and below."""

    height_m: float
    size_m: float
    flank_m: float

    def offset_m(self, azimuth, z, radius_m):
        return self.size_m * np.exp(-np.abs(z - self.height_m) / self.flank_m) + 0 * azimuth

    def edges_m(self):
        return (self.low_m, self.height_m, self.high_m)


@dataclass(frozen=True)
class Course(Defect):
    """Axially symmetric form of a course: step of the radius, taper, and bulge between welds."""

    step_m: float
    taper_m: float  # from the foot of the course to its top
    bulge_m: float  # offset of the middle
    bell: float  # share of the bulge that is a cosine with zero slope at the welds, else a parabola

    def offset_m(self, azimuth, z, radius_m):
        zeta = 2 * (z - self.low_m) / (self.high_m - self.low_m) - 1
        form = self.bell * (1 + np.cos(np.pi * zeta)) / 2 + (1 - self.bell) * (1 - zeta**2)
        return self.step_m + self.taper_m * zeta / 2 + self.bulge_m * form + 0 * azimuth


@dataclass(frozen=True)
class Dent(Defect):
    """A smooth dent, or a bump if its size is positive."""

    azimuth_rad: float
    size_m: float
    half_width_m: float

    def offset_m(self, azimuth, z, radius_m):
        arc = signed_arc(azimuth, self.azimuth_rad, radius_m)
        return self.size_m * cap_of(arc / self.half_width_m) * cap_of(_zeta(self, z))

    def kinks_rad(self, radius_m):
        return _side_azimuths(self, radius_m)


@dataclass(frozen=True)
class Flat(Defect):
    """A flat place where a plate was not rolled: the chord of an arc in place of the arc."""

    azimuth_rad: float
    half_width_m: float
    fade_m: float

    def offset_m(self, azimuth, z, radius_m):
        arc = np.abs(signed_arc(azimuth, self.azimuth_rad, radius_m))
        chord = np.maximum(self.half_width_m**2 - arc**2, 0) / (2 * radius_m)
        return -chord * _fade_factor(self, z)

    def kinks_rad(self, radius_m):
        return _side_azimuths(self, radius_m)

    def edges_m(self):
        return _fade_edges(self)


@dataclass(frozen=True)
class Buckle(Defect):
    """A buckle by vacuum or fire: inward and outward folds under a cap."""

    azimuth_rad: float
    size_m: float
    half_width_m: float
    folds: float

    def offset_m(self, azimuth, z, radius_m):
        part = signed_arc(azimuth, self.azimuth_rad, radius_m) / self.half_width_m
        return (
            self.size_m * cap_of(part) * np.cos(np.pi * self.folds * part) * cap_of(_zeta(self, z))
        )

    def kinks_rad(self, radius_m):
        return _side_azimuths(self, radius_m)


# Class of each kind of defect in plain data.
KINDS = {kind.__name__.lower(): kind for kind in (Oval, Seam, Band, Course, Dent, Flat, Buckle)}


def plain_of(defect):
    """Plain data of a defect, with its kind."""
    return {"kind": type(defect).__name__.lower(), **asdict(defect)}


def defect_of(plain):
    """Build the defect from plain data."""
    values = dict(plain)
    return KINDS[values.pop("kind")](**values)


def _side_azimuths(defect, radius_m):
    """Azimuths of both sides of a defect of limited width, rad."""
    half = defect.half_width_m / radius_m
    return (defect.azimuth_rad - half, defect.azimuth_rad + half)


def _zeta(defect, z):
    """Relative height, -1 at the lower end of the defect and 1 at its upper end."""
    return 2 * (z - defect.low_m) / (defect.high_m - defect.low_m) - 1


def _fade_factor(defect, z):
    """Factor from 0 to 1 for smooth lower and upper ends of a defect."""
    if defect.fade_m <= 0:
        return 1.0
    foot = smooth_step((z - defect.low_m) / defect.fade_m)
    return foot * smooth_step((defect.high_m - z) / defect.fade_m)


def _fade_edges(defect):
    """Heights of the ends of a defect and of its transitions, m."""
    fade = max(defect.fade_m, 0.0)
    return (defect.low_m, defect.low_m + fade, defect.high_m - fade, defect.high_m)


NODES, MORE_NODES = 8, 12  # Gauss nodes of a panel: normal, and for the estimate of the error
PANEL_M, PANELS_ROUND = 0.5, 48  # largest height of a panel, least number of panels round the wall
REFERENCE_C = 20.0  # temperature of the shell at which lengths are stated
RADII, TURNS = 24, 96  # nodes of the bottom: along the radius, round the tank
# Intersection of a ray with the wall: largest step, last step and number of iterations.
STEP_M, CLOSE_M, MOST_STEPS = 0.3, 1e-7, 80
FAMILIES = ("brick", "coil", "dented", "leaning", "buckled", "round")
WIDTHS_M = (4.0, 10.0)  # smallest and largest radius
STEEL_E_PA, STEEL_E_SD = 206e9, 2e9  # Young's modulus, mean and standard deviation
# Coefficient of thermal expansion, 1/K, mean and standard deviation.
STEEL_EXPANSION, STEEL_EXPANSION_SD = 1.15e-5, 0.04e-5


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
        cool += self._floor_m3(2) if more else self._volume_below_foot_m3
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
    def _volume_below_foot_m3(self):
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


def draw_tank(rng, name, family):
    """Draw a random tank.

    Parameters
    ----------
    rng : numpy.random.Generator
        Source of random numbers.
    name : str
        Name of the tank.
    family : str
        One of FAMILIES.

    Returns
    -------
    Tank
    """
    radius = round(float(rng.uniform(*WIDTHS_M)), 2)
    # Heights of courses, equal but for deviations of 1.5 mm (standard deviation), m.
    count = int(rng.integers(4, 7))
    nominal = rng.choice([1.5, 1.8, 2.0])
    courses = nominal + 1.5e-3 * rng.normal(size=count)
    joints = np.concatenate([[0.0], np.cumsum(courses)])
    height = float(joints[-1])
    defects = [*_course_forms(rng, joints), *_waves(rng, height, family)]
    defects += _DEFECTS_BY_FAMILY[family](rng, radius, joints)
    slope = rng.uniform(3e-3, 6e-3) if family == "leaning" else abs(rng.normal(0, 1.2e-3))
    tilt_azimuth = rng.uniform(0, FULL_TURN)
    thickness = 0.0045 * radius / 7 * (1 - joints[:-1] / height) + 0.005  # typical of storage tanks
    plates = np.round(thickness, 3) * (1 + 0.01 * rng.normal(size=len(thickness)))
    plate_z = float(rng.uniform(0.02, 0.08))
    floor = _floor(rng, radius)
    return Tank(
        name=name,
        family=family,
        radius_m=radius,
        courses_m=tuple(map(float, courses)),
        plates_m=tuple(map(float, plates)),
        paint_m=float(rng.uniform(2e-4, 4e-4)),
        defects=tuple(defects),
        lean=(float(slope * np.sin(tilt_azimuth)), float(slope * np.cos(tilt_azimuth))),
        floor=floor,
        fittings=_fittings(rng, radius, height, plate_z),
        plate_z_m=plate_z,
        e_pa=float(STEEL_E_PA + STEEL_E_SD * rng.normal()),
        expansion_per_k=float(STEEL_EXPANSION + STEEL_EXPANSION_SD * rng.normal()),
    )


def _course_forms(rng, joints):
    """Step, taper and bulge of each course; the bulges of all courses have the same mean."""
    bulge, bell = rng.uniform(1e-3, 6e-3), rng.uniform()
    return [
        Course(
            float(low),
            float(high),
            step_m=float(1.5e-3 * rng.normal()),
            taper_m=float(1e-3 * rng.normal()),
            bulge_m=float(bulge * (1 + 0.2 * rng.normal())),
            bell=float(bell),
        )
        for low, high in pairwise(joints)
    ]


def _waves(rng, height, family):
    """Waves 2 to 9 round the shell, whose size decreases with their number."""
    typical = {"coil": 3e-3, "leaning": 3e-3, "round": 0.5e-3}.get(family, 1.5e-3)
    growth = 3.0 if family == "leaning" else 1.0
    waves = []
    for k in range(2, 10):
        size = typical * np.exp(0.5 * rng.normal()) * k**-0.5
        top = size * growth * np.exp(0.2 * rng.normal())
        turn = 0.4 * rng.normal()
        phase = rng.uniform(0, FULL_TURN)
        waves.append(Oval(0.0, height, k, *map(float, (size, top, phase, turn))))
    return waves


def _draw_bricks(rng, radius, joints):
    """Vertical welds in brick pattern, and horizontal welds."""
    plates = max(3, round(FULL_TURN * radius / rng.uniform(6, 10)))
    peak, flank = rng.choice([-1, 1]) * rng.uniform(2e-3, 10e-3), rng.uniform(0.1, 0.3)
    start = rng.uniform(0, FULL_TURN)
    defects = []
    for course, (low, high) in enumerate(pairwise(joints)):
        for plate in range(plates):
            azimuth = (
                start + FULL_TURN * (plate + 0.5 * (course % 2) + 0.03 * rng.normal()) / plates
            )
            size = peak * (1 + 0.3 * rng.normal())
            defects.append(Seam(*map(float, (low, high, azimuth % FULL_TURN, size, flank, 0.3))))
    reach = rng.uniform(0.1, 0.25)
    for z in joints[1:-1]:
        size = -rng.uniform(1e-3, 7e-3)
        defects.append(Band(0.0, float(joints[-1]), *map(float, (z, size, reach))))
    return defects


def _draw_coil_seams(rng, radius, joints):
    """One to three seams over the full height."""
    defects = []
    for _ in range(int(rng.integers(1, 4))):
        size = rng.choice([-1, -1, 1]) * rng.uniform(5e-3, 30e-3)
        azimuth, flank = rng.uniform(0, FULL_TURN), rng.uniform(0.08, 0.25)
        defects.append(Seam(0.0, float(joints[-1]), *map(float, (azimuth, size, flank, 0.0))))
    return defects


def _draw_dents(rng, radius, joints):
    """Three to seven dents or bumps, and two to five flat places."""
    defects = []
    for _ in range(int(rng.integers(3, 8))):
        size = rng.choice([-1, -1, -1, 1]) * rng.uniform(5e-3, 25e-3)
        half, middle = rng.uniform(0.25, 0.9), rng.uniform(0.5, joints[-1] - 0.5)
        low, high = max(middle - half, 0.0), min(middle + half, joints[-1])
        azimuth, width = rng.uniform(0, FULL_TURN), rng.uniform(0.25, 1.2)
        defects.append(Dent(*map(float, (low, high, azimuth, size, width))))
    for _ in range(int(rng.integers(2, 6))):
        course = int(rng.integers(len(joints) - 1))
        azimuth, half = rng.uniform(0, FULL_TURN), rng.uniform(0.25, 0.55)
        defects.append(Flat(*map(float, (joints[course], joints[course + 1], azimuth, half, 0.3))))
    return defects


def _draw_buckles(rng, radius, joints):
    """One or two buckles, and horizontal welds."""
    defects = []
    for _ in range(int(rng.integers(1, 3))):
        course = int(rng.integers(len(joints) - 1))
        azimuth, size = rng.uniform(0, FULL_TURN), -rng.uniform(15e-3, 50e-3)
        half, folds = rng.uniform(0.6, 1.5), rng.choice([0.0, 1.5])
        low, high = joints[course : course + 2]
        defects.append(Buckle(*map(float, (low, high, azimuth, size, half, folds))))
    for z in joints[1:-1]:
        size = -rng.uniform(0.5e-3, 4e-3)
        defects.append(Band(0.0, float(joints[-1]), *map(float, (z, size, 0.3))))
    return defects


def _no_defects(rng, radius, joints):
    """No further defects."""
    return []


_DEFECTS_BY_FAMILY = {
    "brick": _draw_bricks,
    "coil": _draw_coil_seams,
    "dented": _draw_dents,
    "leaning": _no_defects,
    "buckled": _draw_buckles,
    "round": _no_defects,
}


def _floor(rng, radius):
    """Bottom: a cone down or up by 0.5 to 1.5 % of the radius, with four small waves."""
    depth = float(rng.choice([1, 1, 1, -1]) * rng.uniform(0.005, 0.015) * radius)
    waves = []
    for _ in range(4):
        length, direction = rng.uniform(2.5, 6.0), rng.uniform(0, FULL_TURN)
        k = FULL_TURN / length
        size = rng.uniform(0.02, 0.06) * abs(depth)
        wave_numbers = k * np.sin(direction), k * np.cos(direction)
        waves.append(Wave(float(size), *map(float, wave_numbers), float(rng.uniform(0, FULL_TURN))))
    return Floor(depth, tuple(waves))


def _fittings(rng, radius, height, plate_z):
    """Up to two roof columns, possibly a heating coil above the dip plate, and a manhole."""
    fittings = []
    for number in range(int(rng.integers(0, 3))):
        width = float(rng.choice([0.168, 0.219]))
        distance, azimuth = radius * rng.uniform(0.35, 0.6), rng.uniform(0, FULL_TURN)
        place = float(distance * np.sin(azimuth)), float(distance * np.cos(azimuth))
        volume = -float(np.pi / 4 * width**2 * height)
        fittings.append(Fitting(f"column {number + 1}", 0.0, height, volume, *place, width))
    if rng.uniform() < 0.5:
        low = plate_z + float(rng.uniform(0.15, 0.25))
        fittings.append(Fitting("heating coil", low, low + 0.15, -float(rng.uniform(0.1, 0.4))))
    low = plate_z + float(rng.uniform(0.4, 0.6))
    fittings.append(Fitting("manhole", low, low + 0.6, float(rng.uniform(0.05, 0.12))))
    return tuple(fittings)
