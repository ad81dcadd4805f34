"""Body of a tank under the calibrating liquid, at the dips of the runs.

Some inputs of horizontal tanks and spheres have a nonlinear effect on volumes: sizes, tilt and the
zero of the table. They are moved to their estimates by liquid, step by step (Gauss-Newton). All
other inputs have an almost linear effect and keep their values.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.job.model import DeclaredInput
from tankcal.pipeline.simulation.curvature import vary_input
from tankcal.pipeline.tanks import body_of, filled_with, zero_height
from tankcal.tank.service import shell_factor, solid_factor
from tankcal.uncertainty import triangular

MOVED = (
    "diameter",
    "length",
    "end_depth",
    "tilt",
    "dip_position",
)  # nonlinear inputs of a solid, with ZERO
ZERO = "datum"


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

    Returns
    -------
    Loaded
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
        return derivatives.get("offset", derivatives["scale"] / _mean_radius(body))
    if "diameter" in derivatives:
        return 2 * derivatives["diameter"]
    return derivatives.get("surface", zeros)


def _mean_radius(body):
    """Mean inside radius of a shell, m."""
    areas = body.shell.volume.features
    return float(np.sqrt(np.mean(areas) / np.pi)) / body.shell.scale


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

    Returns
    -------
    DeclaredInput
    """
    return DeclaredInput(name, u, unit, as_read, is_default=True)


def stacked(sources, rows):
    """Return the columns of all sources side by side, shape (rows, c)."""
    return np.hstack([np.zeros((rows, 0)), *(source.columns_m3 for source in sources)])
