"""A tank as liquid sees it: its body under the calibrating liquid, at the dips of the runs.

The inputs of lying tanks and spheres that bend volumes (sizes, tilt, the table's zero) are moved to
what liquid says of them, step by step (Gauss-Newton); all others, of which the volumes are as good
as linear, stay where geometry has them.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.job.model import DeclaredInput
from tankcal.pipeline.simulation.curvature import vary_input
from tankcal.pipeline.tanks import body_of, zero_height
from tankcal.tank.service import shell_factor, solid_factor
from tankcal.uncertainty import triangular

MOVED = ("diameter", "length", "end_depth", "tilt", "dip_position")  # of one solid; and its zero
ZERO = "datum"


@dataclass(frozen=True)
class Geometry:
    """What says of the volumes of a tank all that liquid does not.

    Attributes
    ----------
    job : Job
    survey : Wall, StrappedWall, NominalWall, Scan, mesh or None
    moves : dict
        {input: by how much it is moved, SI}.
    told_by_liquid : tuple of str
        Inputs that need no declared u: the dips themselves say what they do.
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
        sizes = [one.name for one in self.job.inputs if one.name in MOVED and one.u > 0]
        sizes = [name for name in sizes if vary_input(self.job, name, 0.0) is not None]
        zero = [one.name for one in self.job.inputs if one.name == ZERO and one.u > 0]
        return (*sizes, *zero)

    @property
    def moved_job(self):
        """The job with its sizes where liquid has them."""
        job = self.job
        for name, change in self.moves.items():
            if name != ZERO:
                job = vary_input(job, name, change)
        return job

    @property
    def shift_m(self):
        """Height of the table's zero above where the job has it."""
        return self.moves.get(ZERO, 0.0)

    @property
    def zero_m(self):
        """Level of dip 0 in the frame of the parts, as the job has it."""
        return zero_height(self.job, self.survey)

    def body(self, density_kg_m3=None):
        """`tank.body.Body` under a liquid; None: that of the table."""
        return body_of(filled_with(self.moved_job, density_kg_m3), self.survey)

    def moved_to(self, moves):
        """The same with other moves; SolutionError where there is no such tank."""
        return replace(self, moves=moves)


def filled_with(job, density_kg_m3):
    """The job of a tank that holds another liquid, in which its floating roof floats."""
    if density_kg_m3 is None:
        return job
    density = float(density_kg_m3)
    roof = job.roof and replace(job.roof, reference_density_kg_m3=density)
    return replace(job, table=replace(job.table, liquid_density_kg_m3=density), roof=roof)


@dataclass(frozen=True)
class Loaded:
    """A geometry at d dips, under the calibrating liquid.

    Attributes
    ----------
    level_m : ndarray, shape (d,)
        In the frame of the parts.
    volume_m3, area_m2, by_density, by_offset : ndarray, shape (d,)
        Volume (of the liquid's own density at its temperature), free surface, and derivatives by
        that density and by an offset of all radii (0: there is none).
    growth : ndarray, shape (d,)
        Factor of the volume by the temperature of the shell.
    sources : tuple of Source
        What geometry leaves uncertain of the volumes.
    """

    level_m: np.ndarray
    volume_m3: np.ndarray
    area_m2: np.ndarray
    by_density: np.ndarray
    by_offset: np.ndarray
    growth: np.ndarray
    sources: tuple


def load_geometry(geometry, densities_kg_m3, dips_m, shell_c):
    """`Loaded` geometry at d dips.

    Parameters
    ----------
    geometry : Geometry
    densities_kg_m3 : ndarray, shape (1 + d,)
        Of the calibrating liquid as declared, and at each dip.
    dips_m, shell_c : ndarray, shape (d,)
        nan: temperature not known.
    """
    declared, at_dips = densities_kg_m3[0], densities_kg_m3[1:]
    body = geometry.body(declared)
    dips = dips_m + geometry.zero_m
    levels = np.clip(dips + geometry.shift_m, body.lowest_m, body.highest_m)
    volume = body.moved_m3(dips, geometry.shift_m)  # whole dips may stand above a declared top
    derivatives = body.derivatives(levels)
    nothing = np.zeros(len(levels))
    by_density = derivatives.get("liquid_density", nothing)
    volume = volume + by_density * (at_dips - declared)
    area = body.area_m2(levels)
    return Loaded(
        level_m=levels,
        volume_m3=volume,
        area_m2=area,
        by_density=by_density,
        by_offset=_by_offset(body, derivatives, nothing),
        growth=_growth(geometry.job, body, levels, shell_c),
        sources=sources_at(geometry, body, levels, without=("liquid_density",)),
    )


def volumes_at(body, levels_m, shift_m):
    """(rows,) volumes at levels, with the table's zero moved."""
    if shift_m:
        return body.moved_m3(levels_m, shift_m)
    return body.volume_m3(np.clip(levels_m, body.lowest_m, None))


def sources_at(geometry, body, levels_m, without=()):
    """Sources of a body of a geometry, the same in number and order under whatever liquid."""
    return body.sources_by(levels_m, [one.name for one in geometry.job.inputs], without)


def _by_offset(body, derivatives, nothing):
    """Derivative of volumes by a metre in all inside radii."""
    if body.shell is not None:
        return derivatives.get("offset", derivatives["scale"] / _mean_radius(body))
    if "diameter" in derivatives:
        return 2 * derivatives["diameter"]
    return derivatives.get("surface", nothing)


def _mean_radius(body):
    areas = body.shell.volume.features
    return float(np.sqrt(np.mean(areas) / np.pi)) / body.shell.scale


def _growth(job, body, levels_m, shell_c):
    """Factor of volumes by the shell's temperature at a fixed level."""
    base, expansion = job.table.reference_temperature_c, job.material.expansion_per_k
    warm = np.where(np.isfinite(shell_c), shell_c, base)
    if job.tank.kind == "vertical":
        return shell_factor(warm, base, expansion)
    return solid_factor(body, levels_m, warm, base, expansion)


@dataclass(frozen=True)
class Place:
    """Where a declared input stands among the deviates of the sources.

    name, u  of the input, SI; part  (rows,) -> columns: see `places_of`
    row      (c,) combination of all deviates that makes its own: z of the input
    source, part   numbers of the source, and of its part (None: it has none)
    """

    name: str
    u: float
    row: np.ndarray
    source: int
    part: int | None


def places_of(sources, inputs):
    """{name: `Place`} of declared inputs among sources; correlated ones share theirs."""
    known = {one.name: one.u for one in inputs}
    count, start, found = sum(one.columns_m3.shape[1] for one in sources), 0, {}
    for number, source in enumerate(sources):
        width = source.columns_m3.shape[1]
        if source.parts:
            mixing = triangular(source.correlation)
            for place, part in enumerate(source.parts):
                row = np.zeros(count)
                row[start : start + width] = mixing[place]
                found[part.kind] = Place(part.kind, known[part.kind], row, number, place)
        elif source.kind in known and source.u is not None and width == 1:
            row = np.zeros(count)
            row[start] = 1.0
            found[source.kind] = Place(source.kind, known[source.kind], row, number, None)
        start += width
    return found


def column_of(sources, place):
    """(rows,) what one u of a declared input does, alone, m3."""
    source = sources[place.source]
    part = source if place.part is None else source.parts[place.part]
    return part.columns_m3[:, 0]


def wide_input(name, u, unit, as_read):
    """A `DeclaredInput` that stands for not knowing."""
    return DeclaredInput(name, u, unit, as_read, is_default=True)


def stacked(sources, rows):
    """(rows, c) columns of all sources."""
    return np.hstack([np.zeros((rows, 0)), *(one.columns_m3 for one in sources)])
