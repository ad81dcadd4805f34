"""Body of a tank under the calibrating liquid, and determined together with the liquid.

`adjustment` adjusts the metered runs with the geometry, `measuring` makes the results.

Geometry of a table by liquid alone
-----------------------------------

Within the dips of the runs, such a geometry only interpolates; it is declared, with wide
uncertainties. A vertical tank keeps its courses. Each course is a cylinder, and its radius differs
from the nominal radius by the standard uncertainty in the job. Bulge and taper of a course are
covered by prior components, as in a strapped wall. A horizontal tank keeps its form, with unknown
sizes, tilt and zero. A sphere has an unknown diameter and zero, a mesh an unknown scale and zero.

Some inputs of horizontal tanks and spheres have a nonlinear effect on volumes: sizes, tilt and the
zero of the table. They are moved to their estimates by liquid, step by step (Gauss-Newton). All
other inputs have an almost linear effect and keep their values.

Body by geometry and liquid together: its rows and sources
----------------------------------------------------------

    V(L) + C(L) z + b s(L),     z, b = G y

C are the columns of the geometry (and of the flexing of the bottom), b is the volume below the
first dip, s its share below level L, and y are the misclosures. The sources follow from the law of
propagation, with y = A z + F b + N e:

    C - (C G) A  of a cause of the geometry,    -(C G) A,  -(C G) N  of causes of the liquid.

Every cause keeps its name, its distribution and its degrees of freedom.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tankcal.job.model import DeclaredInput
from tankcal.messages import message
from tankcal.pipeline.checks import limits_of_method
from tankcal.pipeline.read_wall import (
    ReadWall,
    WallReading,
    factors_of_readings,
    noise_of,
    settle_readings,
    sites_of,
)
from tankcal.pipeline.scanned_solids import Scan
from tankcal.pipeline.simulation.curvature import vary_input
from tankcal.pipeline.tanks import body_of, filled_with, insets_of, shell_zero, zero_height
from tankcal.pipeline.tanks.solid import sized_job
from tankcal.pipeline.tanks.vertical import nominal_inside_m
from tankcal.pipeline.wall.finding import joints_of
from tankcal.pipeline.wall_straps import UprightAxis, field_of_readings, mean_radii
from tankcal.tank.body import Body, Factor, ShellPart, SolidPart
from tankcal.tank.parts import Part
from tankcal.tank.service import shell_factor, solid_factor
from tankcal.uncertainty import Source, triangular

MOVED = (
    "diameter",
    "length",
    "end_depth",
    "tilt",
    "dip_position",
)  # nonlinear inputs of a solid, with ZERO
ZERO = "datum"
COMMON = 0.8  # share of the variance of a radius that is common to all courses
KEPT = (  # inputs that describe the liquid, the parts and the elasticity, not the shape of the wall
    *("plate_thickness", "shell_temperature", "expansion", "youngs_modulus"),
    *("liquid_density", "roof_mass", "deadwood", "interpolation", "rounding"),
)
SIZES = ("diameter", "length", "end_depth", "tilt", "dip_position", "datum", "scale", "surface")


@dataclass(frozen=True)
class Geometry:
    """Information on the volumes of a tank that is independent of the liquid.

    Attributes
    ----------
    job : Job
    survey : Wall, StrappedWall, NominalWall, Scan, mesh or None
    moves : dict
        {input: its move, SI}.
    told_by_liquid : tuple of str
        Inputs without declared u, because the dips determine them.
    """

    job: object
    survey: object
    moves: dict = field(default_factory=dict)
    told_by_liquid: tuple = ()

    @property
    def movable(self):
        """Names of the declared inputs that are moved."""
        if self.job.tank.kind == "vertical":
            return ()
        sizes = [
            declared.name
            for declared in self.job.inputs
            if declared.name in MOVED and declared.u > 0
        ]
        sizes = [name for name in sizes if vary_input(self.job, name, 0.0) is not None]
        zero = [
            declared.name
            for declared in self.job.inputs
            if declared.name == ZERO and declared.u > 0
        ]
        return (*sizes, *zero)

    @property
    def moved_job(self):
        """The job with its sizes as adjusted by liquid."""
        job = self.job
        for name, change in self.moves.items():
            if name != ZERO:
                job = vary_input(job, name, change)
        return job

    @property
    def shift_m(self):
        """Height of the zero of the table above its height in the job, m."""
        return self.moves.get(ZERO, 0.0)

    @property
    def zero_m(self):
        """Level of dip 0 in the frame of the parts, according to the job."""
        return zero_height(self.job, self.survey)

    def body(self, density_kg_m3=None):
        """Return the `tank.body.Body` under a liquid; None: liquid of the table."""
        return body_of(filled_with(self.moved_job, density_kg_m3), self.survey)

    def moved_to(self, moves):
        """Return the geometry with other moves.

        Its other methods raise SolutionError if no tank has the moved sizes.
        """
        return replace(self, moves=moves)


@dataclass(frozen=True)
class Loaded:
    """A geometry at d dips, under the calibrating liquid.

    Attributes
    ----------
    level_m : ndarray, shape (d,)
        Level in the frame of the parts.
    volume_m3, area_m2 : ndarray, shape (d,)
        Volume at the density of the liquid at its temperature, and free surface.
    by_density, by_offset : ndarray, shape (d,)
        Derivatives of the volume by the density, and by an offset of all radii (0 without radii).
    growth : ndarray, shape (d,)
        Factor of the volume due to the temperature of the shell.
    sources : tuple of Source
        Sources of the uncertainty of the volumes by geometry.
    """

    level_m: np.ndarray
    volume_m3: np.ndarray
    area_m2: np.ndarray
    by_density: np.ndarray
    by_offset: np.ndarray
    growth: np.ndarray
    sources: tuple


def load_geometry(geometry, densities_kg_m3, dips_m, shell_c):
    """Compute the `Loaded` geometry at d dips.

    Parameters
    ----------
    geometry : Geometry
    densities_kg_m3 : ndarray, shape (1 + d,)
        Density of the calibrating liquid as declared, and at each dip.
    dips_m : ndarray, shape (d,)
        Dips.
    shell_c : ndarray, shape (d,)
        Temperature of the shell, degree Celsius; nan: not known.
    """
    declared, at_dips = densities_kg_m3[0], densities_kg_m3[1:]
    body = geometry.body(declared)
    dips = dips_m + geometry.zero_m
    levels = np.clip(dips + geometry.shift_m, body.lowest_m, body.highest_m)
    volume = body.moved_m3(dips, geometry.shift_m)  # dips above a declared top are valid
    derivatives = body.derivatives(levels)
    zeros = np.zeros(len(levels))
    by_density = derivatives.get("liquid_density", zeros)
    # The head of the liquid depends on its density at each dip: linear correction.
    volume = volume + by_density * (at_dips - declared)
    area = body.area_m2(levels)
    return Loaded(
        level_m=levels,
        volume_m3=volume,
        area_m2=area,
        by_density=by_density,
        by_offset=_offset_derivatives(body, derivatives, zeros),
        growth=_thermal_growth(geometry.job, body, levels, shell_c),
        sources=sources_at(geometry, body, levels, without=("liquid_density",)),
    )


def volumes_at(body, levels_m, shift_m):
    """Return the volumes at given levels with the zero of the table moved.

    Parameters
    ----------
    body : Body
    levels_m : ndarray, shape (rows,)
    shift_m : float
        Move of the zero, m.

    Returns
    -------
    ndarray, shape (rows,)
    """
    if shift_m:
        return body.moved_m3(levels_m, shift_m)
    return body.volume_m3(np.clip(levels_m, body.lowest_m, None))


def sources_at(geometry, body, levels_m, without=()):
    """Return the sources of a body, the same in number and order for any liquid.

    Parameters
    ----------
    geometry : Geometry
    body : Body
    levels_m : ndarray, shape (rows,)
    without : sequence of str, optional
        Sources to omit.

    Returns
    -------
    sequence of Source
    """
    return body.sources_by(levels_m, [declared.name for declared in geometry.job.inputs], without)


def _offset_derivatives(body, derivatives, zeros):
    """Derivative of the volumes by an offset of all inside radii, m3/m."""
    if body.shell is not None:
        # A scale changes a radius r by r times the scale: divide by the mean radius.
        mean_area = np.mean(body.shell.volume.features)
        mean_radius = float(np.sqrt(mean_area / np.pi)) / body.shell.scale
        return derivatives.get("offset", derivatives["scale"] / mean_radius)
    if "diameter" in derivatives:
        return 2 * derivatives["diameter"]
    return derivatives.get("surface", zeros)


def _thermal_growth(job, body, levels_m, shell_c):
    """Factor of the volumes due to the temperature of the shell, at a fixed level."""
    reference_c, expansion = job.table.reference_temperature_c, job.material.expansion_per_k
    temperature_c = np.where(np.isfinite(shell_c), shell_c, reference_c)
    if job.tank.kind == "vertical":
        return shell_factor(temperature_c, reference_c, expansion)
    return solid_factor(body, levels_m, temperature_c, reference_c, expansion)


@dataclass(frozen=True)
class Place:
    """Position of a declared input among the deviates of the sources.

    Attributes
    ----------
    name : str
    u : float
        Standard uncertainty of the input, SI.
    row : ndarray, shape (c,)
        Combination of all deviates that is the deviate of the input.
    source : int
        Number of the source.
    part : int or None
        Number of the part of a source of correlated inputs; None: the source has no parts.
    """

    name: str
    u: float
    row: np.ndarray
    source: int
    part: int | None


def places_of(sources, inputs):
    """Map each declared input among sources to its `Place`.

    Correlated inputs share a source.
    """
    u_of_input = {declared.name: declared.u for declared in inputs}
    count, start, places = sum(source.columns_m3.shape[1] for source in sources), 0, {}
    for number, source in enumerate(sources):
        width = source.columns_m3.shape[1]
        if source.parts:
            # The parts of a source are correlated: a triangular factor turns its independent
            # deviates into theirs.
            factor = triangular(source.correlation)
            for part_number, part in enumerate(source.parts):
                row = np.zeros(count)
                row[start : start + width] = factor[part_number]
                places[part.kind] = Place(
                    part.kind, u_of_input[part.kind], row, number, part_number
                )
        elif source.kind in u_of_input and source.u is not None and width == 1:
            row = np.zeros(count)
            row[start] = 1.0
            places[source.kind] = Place(source.kind, u_of_input[source.kind], row, number, None)
        start += width
    return places


def column_of(sources, place):
    """Effect (rows,) of one standard uncertainty of a declared input, m3."""
    source = sources[place.source]
    part = source if place.part is None else source.parts[place.part]
    return part.columns_m3[:, 0]


def wide_input(name, u, unit, as_read):
    """Return a `DeclaredInput` with a wide uncertainty, for an unknown value.

    Parameters
    ----------
    name : str
    u : float
        Standard uncertainty, SI.
    unit : str
        Unit for reports.
    as_read : float
        Standard uncertainty in this unit.
    """
    return DeclaredInput(name, u, unit, as_read, is_default=True)


def stack_columns(sources, rows):
    """Return the columns of all sources side by side, shape (rows, c)."""
    return np.hstack([np.zeros((rows, 0)), *(source.columns_m3 for source in sources)])


# ---- wall of an upright tank known from its drawing alone


@dataclass(frozen=True)
class NominalWall(ReadWall):
    """Wall from the drawing; a `ReadWall` whose readings are the nominal radii."""

    surveyed_as = "nominal"
    shell = UprightAxis()
    without_inputs = ("offset",)
    straps = None

    @cached_property
    def radius_m(self):
        """Radius of each course on the side of the survey, m, shape (courses,)."""
        return mean_radii(self.field)

    def lowest_outline(self, azimuth_rad):
        """Position (x, y) of the axis and radii (n,) of the first course, m."""
        return 0.0, 0.0, np.full(len(azimuth_rad), self.radius_m[0])

    def factors(self, job, weights):
        """`Factor`s of the uncertainty of the drawing: common to all courses and of each."""
        return factors_of_readings(self.accepted, weights)

    def read_with(self, weights):
        """Return no derivatives: no instrument input affects a nominal wall."""
        return {}


def find_nominal_wall(job, progress=lambda text: None):
    """`NominalWall` of an upright job from its nominal diameter and courses.

    The job's liquid section gives the standard uncertainty of a radius. Most of its variance is
    common to all courses, because an error of the nominal diameter affects all courses.

    Parameters
    ----------
    job : Job
    progress : callable
        Called with a line of text when the step begins.
    """
    progress(message("nominal_wall", "taking the wall of the drawing, which liquid will measure"))
    joints, zero, sd = joints_of(job), shell_zero(job, None), job.liquid.u_radius_m
    insets = insets_of(job, job.switches)
    inside = [nominal_inside_m(job, course) for course in job.courses]
    common = sd * np.sqrt(COMMON)
    readings = [
        WallReading(
            "nominal_radius",
            number,
            (joints[number] + joints[number + 1]) / 2 - zero,
            radius + inset,
            sd * np.sqrt(1 - COMMON),
            effects={("nominal_radius_of_all", ""): (1000 * common, "mm", common)},
        )
        for number, (radius, inset) in enumerate(zip(inside, insets, strict=True))
    ]
    sites, noise = sites_of(readings, joints, zero), noise_of(readings)

    def field_of(accepted):
        return field_of_readings(sites, readings, noise, job.tank.nominal_diameter_m / 2)

    none_rejected = np.zeros(len(readings), dtype=bool)
    radius = np.array([reading.radius_m for reading in readings])
    field, tested = settle_readings(
        field_of(none_rejected), field_of, (sites, radius, noise), none_rejected
    )
    return NominalWall(joints, zero, tuple(readings), np.arange(len(readings)), tested, field)


# ---- geometry of a tank for a table by liquid alone: declared only, with wide uncertainties


def geometry_beside(job, survey):
    """Return the `Geometry` that is adjusted with the runs of a job.

    Sizes without any information get wide uncertainties.
    """
    if isinstance(survey, NominalWall):
        return Geometry(job, survey, told_by_liquid=SIZES)
    if job.tank.kind == "vertical" or job.points is not None:
        return Geometry(job, survey)
    if any(declared.name in SIZES for declared in job.inputs):
        return Geometry(job, survey)
    widened = replace(job, inputs=(*job.inputs, *_wide_inputs(job)))
    return Geometry(widened, survey, told_by_liquid=SIZES)


def geometry_alone(job, survey):
    """Return a `Geometry` with almost no information, for the table of liquid alone."""
    kept_inputs = tuple(declared for declared in job.inputs if declared.name in KEPT)
    bare = replace(
        job, inputs=kept_inputs, correlations=_correlations_between(job.correlations, kept_inputs)
    )
    if job.tank.kind == "vertical":
        bare = replace(
            bare, points=None, strapping=None, lines=None, hits=None, tangents=None, clouds=None,
            survey=replace(bare.survey, liquid_level_m=None, liquid_density_kg_m3=None),
        )  # fmt: skip
        wall = survey if isinstance(survey, NominalWall) else find_nominal_wall(bare)
        return Geometry(bare, wall, told_by_liquid=(*SIZES, "course_heights"))
    if isinstance(survey, Scan):
        bare, survey = replace(sized_job(bare, survey), points=None), None
    widened = replace(bare, inputs=(*kept_inputs, *_wide_inputs(bare)))
    return Geometry(widened, survey, told_by_liquid=SIZES)


def _wide_inputs(job):
    """Inputs of sizes with almost no information."""
    wide = limits_of_method("tankcal.pipeline.liquid")["wide"]
    zero = wide_input("datum", wide["zero_mm"] / 1000, "mm", wide["zero_mm"])
    if job.horizontal is not None:
        lying = job.horizontal
        diameter = wide["size"] * (lying.width_m + lying.height_m) / 2
        length, tilt = wide["size"] * lying.length_m, wide["tilt_mm_per_m"]
        return (
            wide_input("diameter", diameter, "mm", 1000 * diameter),
            wide_input("length", length, "mm", 1000 * length),
            wide_input("tilt", tilt / 1000, "mm/m", tilt),
            zero,
        )
    if job.sphere is not None:
        diameter = wide["size"] * job.sphere.diameter_m
        return (wide_input("diameter", diameter, "mm", 1000 * diameter), zero)
    return (wide_input("scale", wide["scale"], "ppm", 1e6 * wide["scale"]), zero)


def _correlations_between(correlations, kept):
    """Correlations between the kept inputs only."""
    names = {declared.name for declared in kept}
    return tuple(
        correlation for correlation in correlations if {correlation[0], correlation[1]} <= names
    )


def filled_range_m(metering):
    """Return the lowest and the highest dip used, m."""
    dips = metering.dip_m[metering.used & np.isfinite(metering.dip_m)]
    return float(dips.min()), float(dips.max())


AREA_STEP_M = 1e-4  # step of the difference quotient for the free surface of the correction


@dataclass(frozen=True)
class Known:
    """Results of the adjustment by liquid, sufficient to compute any row.

    Attributes
    ----------
    geometry : Geometry
        Geometry after its last step.
    z : ndarray, shape (c,)
        Estimated deviates of the sources of the geometry.
    gain : ndarray, shape (c, n)
        Derivative of z by the misclosures.
    sources : tuple of Source
        Sources of the geometry, with their effect on the n misclosures.
    liquid : tuple of Source
        Sources of the readings and of their common causes, with their effect on the misclosures.
    moved : tuple of (Place, float)
        Declared inputs that were moved, with their deviate.
    first_m : float or None
        Level of the first dip, if the volume below it is a separate unknown; otherwise None.
    bottom_m3 : float
        Estimate of this volume, beyond the volume by geometry.
    bottom_gain : ndarray, shape (n,)
        Derivative of this volume by the misclosures.
    flex, flex_sd : float
        Estimate of the flexing of the bottom and its prior standard deviation, m3 per metre of
        head.
    flex_gain, flex_column : ndarray, shape (n,)
        Derivative of the flexing by the misclosures, and its effect on the misclosures.
    density_kg_m3 : float
        Density of the calibrating liquid.
    """

    geometry: object
    z: np.ndarray
    gain: np.ndarray
    sources: tuple[Source, ...]
    liquid: tuple[Source, ...]
    moved: tuple = ()
    first_m: float | None = None
    bottom_m3: float = 0.0
    bottom_gain: np.ndarray | None = None
    flex: float = 0.0
    flex_sd: float = 0.0
    flex_gain: np.ndarray | None = None
    flex_column: np.ndarray | None = None
    density_kg_m3: float = 0.0

    def share(self, levels_m):
        """Share of the volume below the first dip that lies below each level, shape (rows,)."""
        if self.first_m is None:
            return np.zeros(len(levels_m))
        reach = max(self.first_m, AREA_STEP_M)
        return np.clip(np.asarray(levels_m) / reach, 0.0, 1.0)


@dataclass(frozen=True)
class JointBody(Body):
    """Tank determined by geometry and liquid; a `Body` with the parts of the geometry.

    Attributes
    ----------
    known : Known
    plain : Body
        Body by geometry, with its sizes as adjusted by liquid.
    slim : Body
        `plain` with a single column, the effect of the estimates, for all sources of a survey.
    weights : ndarray
        Deviates of the sources of `slim`.
    head : float
        Density of the liquid of the table over density of the calibrating liquid.
    """

    known: Known | None = None
    plain: Body | None = None
    slim: Body | None = None
    weights: np.ndarray | None = None
    head: float = 1.0

    is_bent = False  # for `simulation`: the volumes are linear in the causes

    def volume_m3(self, levels_m):
        """Volume below each level, shape (rows,), not below 0."""
        levels = np.asarray(levels_m, dtype=float)
        volume = volumes_at(self.plain, levels, self.known.geometry.shift_m)
        return np.maximum(volume + self._correction_m3(levels), 0.0)

    def area_m2(self, levels_m):
        """Derivative of the volume by the level, shape (rows,)."""
        levels = np.asarray(levels_m, dtype=float)
        inside = self._of_plain(levels)
        # The step must not pass the top of the tank.
        below_top = np.minimum(levels, self.highest_m - AREA_STEP_M)
        rise = self._correction_m3(below_top + AREA_STEP_M) - self._correction_m3(below_top)
        return self.plain.area_m2(inside) + rise / AREA_STEP_M

    def derivatives(self, levels_m):
        """Derivatives of the volumes by geometry, {input: (rows,)}."""
        return self.plain.derivatives(self._of_plain(levels_m))

    def moved_m3(self, levels_m, step_m):
        """Volumes (rows,) with the zero of the table step_m higher."""
        levels = np.asarray(levels_m, dtype=float)
        shifted = np.clip(levels + step_m, self.lowest_m, self.highest_m)
        plain = self.plain.moved_m3(levels, self.known.geometry.shift_m + step_m)
        return np.maximum(plain + self._correction_m3(shifted), 0.0)

    def undeclared(self):
        """Names of inputs without declared uncertainty, except those that liquid determines."""
        by_liquid = self.known.geometry.told_by_liquid
        return tuple(name for name in self.plain.undeclared() if name not in by_liquid)

    def sources(self, levels_m):
        """One `Source` per cause: causes of the geometry, then causes of the liquid."""
        levels, known = np.asarray(levels_m, dtype=float), self.known
        geometry_sources, head = self._of_geometry(self.plain, levels), self._head_m(levels)
        by_y = self.by_misclosures(levels, geometry_sources)
        sources = [
            _subtract_seen(source, seen, by_y)
            for source, seen in zip(geometry_sources, known.sources, strict=True)
        ]
        sources += [source.weighted(-by_y) for source in known.liquid]
        if known.flex_sd:
            columns = known.flex_sd * head - by_y @ known.flex_column
            sources.append(
                Source("bottom_flex", columns[:, None], u=known.flex_sd, unit="m3/m",
                       estimate=known.flex)
            )  # fmt: skip
        return (
            *(source for source in sources if np.any(source.columns_m3)),
            *self._below_first(levels),
        )

    def by_misclosures(self, levels_m, of_geometry=None):
        """Derivative of the volumes below levels by the misclosures, shape (rows, n).

        Parameters
        ----------
        levels_m : array_like, shape (rows,)
        of_geometry : tuple of Source, optional
            Sources of the geometry at the levels; None: computed here.

        Returns
        -------
        ndarray, shape (rows, n)
        """
        levels, known = np.asarray(levels_m, dtype=float), self.known
        if of_geometry is None:
            of_geometry = self._of_geometry(self.plain, levels)
        # Sum of the effects of the estimates: geometry, volume below the first dip, and flexing.
        by_y = stack_columns(of_geometry, len(levels)) @ known.gain
        by_y = by_y + np.outer(known.share(levels), _gain_or_zeros(known.bottom_gain, by_y))
        return by_y + np.outer(self._head_m(levels), _gain_or_zeros(known.flex_gain, by_y))

    def rows(self, levels_m):
        """Volumes, areas and sources of a table."""
        return self.volume_m3(levels_m), self.area_m2(levels_m), self.sources(levels_m)

    def only_shell(self):
        """Return the same body with the shell only.

        The other parts hold no volume, and the estimates of the bottom by liquid are omitted.
        """
        none = {"bottom_gain": None, "flex_gain": None, "flex": 0.0, "flex_sd": 0.0}
        return replace(
            self,
            known=replace(self.known, first_m=None, bottom_m3=0.0, **none),
            plain=_silence_parts(self.plain),
            slim=_silence_parts(self.slim),
        )

    def _of_plain(self, levels_m):
        """Levels in the frame of `plain`, limited to its range."""
        shifted = np.asarray(levels_m, dtype=float) + self.known.geometry.shift_m
        return np.clip(shifted, self.plain.lowest_m, self.plain.highest_m)

    def _head_m(self, levels):
        """Head of liquid at each level, times the ratio of densities."""
        return self.head * np.maximum(levels, 0.0)

    def _of_geometry(self, body, levels):
        """Sources of the geometry at each level."""
        return sources_at(self.known.geometry, body, self._of_plain(levels))

    def _correction_m3(self, levels):
        """Correction (rows,) of the volumes by liquid; `slim` limits the cost of a row."""
        known, sources = self.known, self._of_geometry(self.slim, levels)
        correction = stack_columns(sources, len(levels)) @ self.weights
        for place, deviate in known.moved:
            # Moved inputs have changed the geometry itself already: their linear part must not
            # count twice.
            correction = correction - deviate * column_of(sources, place)
        correction = correction + known.bottom_m3 * known.share(levels)
        return correction + known.flex * self._head_m(levels)

    def _below_first(self, levels):
        """Source of the unknown distribution of the volume below the first dip."""
        known = self.known
        if known.first_m is None or not np.any(levels < known.first_m):
            return ()
        # Any distribution below the first dip is possible: a rectangular distribution with this
        # half-width.
        half = abs(known.bottom_m3) * (1 - known.share(levels))
        columns = half[:, None] / np.sqrt(3)
        return (Source("below_first_dip", columns, distribution="rectangular"),)


@dataclass(frozen=True)
class Silent(Part):
    """A part without volume, with the same number of sources as another part."""

    part: Part

    def volume_m3(self, levels_m):
        """Zeros (rows,)."""
        return np.zeros(len(levels_m))

    def area_m2(self, levels_m):
        """Zeros (rows,)."""
        return np.zeros(len(levels_m))

    def derivatives(self, levels_m):
        """Empty dict."""
        return {}

    def sources(self, levels_m):
        """Sources of the part, with zero columns."""
        return tuple(source.mapped(np.zeros_like) for source in self.part.sources(levels_m))


def _silence_parts(body):
    """Body whose parts other than the shell hold no volume."""
    parts = tuple(part if part is body.shell else Silent(part) for part in body.parts)
    return replace(body, parts=parts)


def join_body(known, density_kg_m3=None):
    """Return the `JointBody` of the results by liquid; density None: liquid of the table."""
    geometry, zero = known.geometry, known.geometry.shift_m
    plain = geometry.body(density_kg_m3)
    slim, weights = _slim_body(plain, known)
    if density_kg_m3 is None:
        density_kg_m3 = geometry.job.table.liquid_density_kg_m3
    return JointBody(
        parts=plain.parts,
        declared=plain.declared,
        lowest_m=plain.lowest_m,
        highest_m=plain.highest_m - zero,
        correlations=plain.correlations,
        estimates=plain.estimates,
        shell=plain.shell,
        known=known,
        plain=plain,
        slim=slim,
        weights=weights,
        head=density_kg_m3 / known.density_kg_m3,
    )


def _slim_body(body, known):
    """Body with one column per survey factor, the effect of the estimates, and the deviates.

    Survey factors have many columns, which would make every row of a long table expensive.
    """
    widths = [source.columns_m3.shape[1] for source in known.sources]
    pieces = np.split(known.z, np.cumsum(widths)[:-1])
    first, parts, weights = 0, [], []
    levels = np.array([body.highest_m])
    for part in body.parts:
        count_of_part = len(part.sources(levels))
        estimates = pieces[first : first + count_of_part]
        if isinstance(part, ShellPart) and part.factors:
            part = replace(part, factors=_single_columns(part.factors, estimates))
            estimates = [np.ones(1)] * count_of_part
        elif isinstance(part, SolidPart) and part.form is not None:
            count = len(part.form.factors)
            factors = _single_columns(part.form.factors, estimates[:count])
            part = replace(part, form=replace(part.form, factors=factors))
            estimates = [*[np.ones(1)] * count, *estimates[count:]]
        parts.append(part)
        weights += estimates
        first += count_of_part
    shell = next((part for part in parts if isinstance(part, ShellPart)), None)
    slim = replace(body, parts=tuple(parts), shell=shell and body.shell and shell)
    return slim, np.concatenate([*weights, *pieces[first:], np.zeros(0)])


def _single_columns(factors, deviates):
    """Factors with their effect at given deviates as the single column."""
    pairs = zip(factors, deviates, strict=True)
    return tuple(Factor(factor.kind, (factor.columns @ z)[:, None]) for factor, z in pairs)


def _subtract_seen(source, seen, by_y):
    """Source of the table less the effect of its causes through the misclosures."""
    columns = source.columns_m3 - by_y @ seen.columns_m3
    parts = tuple(
        _subtract_seen(*pair, by_y) for pair in zip(source.parts, seen.parts, strict=True)
    )
    return replace(source, columns_m3=columns, parts=parts)


def _gain_or_zeros(gain, by_y):
    """Gain (n,), or zeros if there is none."""
    return np.zeros(by_y.shape[1]) if gain is None else gain
