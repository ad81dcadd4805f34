"""Tanks of known truth, and surveys of them: every reading is off by an error of its input.

    tanks = VerticalTanks(folder, {"scale": Input(3e-4, 30), ...})       LyingTanks(folder, ...)
    job, truth_m3 = tanks.survey(rng)             what was read, and true volumes at tanks.dips
    table = redeclared(tanks.table(job), estimates(rng, tanks.inputs))

The truth is a closed form, or a polynomial that the Gauss rule integrates exactly; none of it calls
the package. A survey goes the way of `chain.run`, but for the search for clutter.
"""

from dataclasses import dataclass, replace

import numpy as np
from job_builder import write_job
from shapes import azimuths, ring

import tankcal
from tankcal.geometry.outlines import harmonics
from tankcal.job.model import DeclaredInput
from tankcal.pipeline.tanks import body_of, zero_height
from tankcal.pipeline.wall.finding import find_wall, fit_wall
from tankcal.tank.capacity import Capacity
from tankcal.uncertainty import Source

GRAVITY, MODES = 9.80665, 150
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # areas are of degree 4 in height


@dataclass(frozen=True)
class Input:
    """True standard deviation of an input's errors (SI); degrees of freedom of a declared u."""

    sd: float
    dof: float = np.inf


def scattered(rng, one):
    """Error of an input as repeated surveys have it."""
    return one.sd * rng.normal()


def believed(rng, one):
    """Error of an input as it is known: Student's t about what was found (JCGM 101 6.4.9)."""
    return one.sd * (rng.normal() if np.isinf(one.dof) else rng.standard_t(one.dof))


def estimates(rng, inputs, count=1):
    """{input: (estimated over true standard deviation (count,), degrees of freedom)}."""
    return {
        name: (np.sqrt(rng.chisquare(one.dof, count) / one.dof), one.dof)
        for name, one in inputs.items()
        if np.isfinite(one.dof)
    }


def redeclared(table, found):
    """The table with the standard uncertainties that were estimated, for all rows or (rows,)."""
    sources = []
    for source in table.sources:
        ratio, dof = found.get(source.kind, (np.ones(1), source.dof))
        sources.append(replace(source, columns_m3=ratio[:, None] * source.columns_m3, dof=dof))
    return replace(table, sources=tuple(sources))


def table_of(job, survey, dips):
    """The table of a job at few dips, as `chain.run` makes it; a dip None is the top."""
    body, zero = body_of(job, survey), zero_height(job, survey)
    heights = np.array([body.highest_m - zero if dip is None else dip for dip in dips])
    rows = body.rows(np.minimum(heights + zero, body.highest_m))
    return Capacity(heights, *rows, job.table.coverage_probability)


def stacked(tables, pairs):
    """One Capacity whose rows are those of many tables, after each its deliveries.

    pairs  of rows; the tables have the same sources, of one column each
    """

    def of_all(values):
        rows = np.array(values)
        delivered = [rows[:, high] - rows[:, low] for low, high in pairs]
        return np.concatenate([rows, np.stack(delivered, axis=1)], axis=1).ravel()

    columns = [np.hstack([one.columns_m3 for one in table.sources]) for table in tables]
    volumes = of_all([table.volume_m3 for table in tables])
    sources = tuple(
        replace(one, columns_m3=of_all([tank[:, place] for tank in columns])[:, None])
        for place, one in enumerate(tables[0].sources)
    )
    no_height = np.zeros(len(volumes))
    return Capacity(no_height, volumes, no_height, sources, tables[0].probability)


def declared(inputs):
    """Declared inputs with their true standard deviations."""
    return tuple(
        DeclaredInput(name, one.sd, "", one.sd, dof=one.dof) for name, one in inputs.items()
    )


def of_courses(source, heights_m, joints_m):
    """A source as if every course had an input of its own: one column for each course.

    heights_m  of the rows, the joints between courses among them
    """
    column = np.append(0.0, source.columns_m3[:, 0])
    edges = [0.0, *joints_m, heights_m[-1]]
    below = [np.interp(np.minimum(heights_m, edge), [0.0, *heights_m], column) for edge in edges]
    return Source(source.kind, np.diff(below, axis=0).T, source.dof)


class LyingTanks:
    """Lying cylinders of about 2.4 x 10 m with flat ends, by their sizes: a segment times a length.

    The last row is the full tank.
    """

    dips = (0.6, 1.2, 1.8, None)
    pairs = ((0, 1), (0, 2))  # of rows
    plate_z_m, warm_c = 0.05, 30.0

    def __init__(self, folder, inputs):
        settings = {"survey.shell_temperature_c": self.warm_c, "table.step_m": 0.6}
        job = tankcal.load(write_job(folder, kind="horizontal", settings=settings))
        self.job, self.inputs = replace(job, inputs=declared(inputs)), inputs

    def survey(self, rng, error=scattered):
        """(job, (rows,) true volumes) of one tank."""
        off = {name: error(rng, one) for name, one in self.inputs.items()}
        diameter, length = 2.4 + rng.normal(0, 0.02), 10.0 + rng.normal(0, 0.05)
        read = (1 + off["scale"]) * diameter + off["diameter"]
        read_length = (1 + off["scale"]) * length + off["length"]
        job = self.job
        lying = replace(
            job.horizontal,
            width_m=read,
            height_m=read,
            length_m=read_length,
            dip_from_a_m=read_length / 2,
        )
        warm = replace(job.survey, shell_temperature_c=self.warm_c + off["shell_temperature"])
        datum = replace(job.datum, dip_plate_z_m=self.plate_z_m + off["datum"])
        cooled = job.table.reference_temperature_c - self.warm_c
        scale = 1 + job.material.expansion_per_k * cooled
        radius = scale * diameter / 2
        levels = [2 * radius if dip is None else dip + self.plate_z_m for dip in self.dips]
        truth = scale * length * np.array([_segment(radius, level) for level in levels])
        return replace(job, horizontal=lying, survey=warm, datum=datum), truth

    def table(self, job):
        """The table of a survey."""
        return table_of(job, None, self.dips)


def _segment(radius, level):
    """Area of a circle's segment below a level."""
    depth = radius - level
    return radius**2 * np.arccos(depth / radius) - depth * np.sqrt(radius**2 - depth**2)


class VerticalTanks:
    """Leaning shells of three courses, R about 5 m, one ring of points in the middle of each.

    form_m  rms of the walls' form, of each tank's own size and spectrum; 0: circles
    """

    dips = (0.5, 1.0, 1.96, 2.5, 3.5, 3.96, 5.4)
    joints = (1.96, 3.96)  # dips between courses
    pairs = ((0, 1), (1, 3), (3, 6), (0, 6))  # of rows
    heights = np.array([2.0, 2.0, 1.5])
    slope, point_sd, coil = (0.003, 0.002), 0.001, (0.2, 0.8, -1.5)
    plate, paint, plate_z_m, warm_c, density = 0.008, 3e-4, 0.04, 28.0, 850.0

    def __init__(self, folder, inputs, points=12, form_m=0.0):
        written = write_job(
            folder,
            radius=5.0,
            courses=self.heights.tolist(),
            points_per_ring=points,
            sd_mm=1e3 * self.point_sd,
            tilt=self.slope,
            thickness_mm=1e3 * self.plate,
            paint_mm=1e3 * self.paint,
            deadwood=[("coil", *self.coil)],
            settings={
                "tank.nominal_diameter_m": 10.0,
                "datum.dip_plate_z_m": self.plate_z_m,
                "survey.shell_temperature_c": self.warm_c,
                "table.liquid_density_kg_m3": self.density,
                "table.step_m": 0.02,
            },
        )
        job = tankcal.load(written)
        self.job, self.inputs, self.form_m = replace(job, inputs=declared(inputs)), inputs, form_m
        self.azimuth, self.wall = azimuths(points), find_wall(self.job, lambda text: None)
        assert len(self.wall.accepted) == 3 * points

    def survey(self, rng, error=scattered):
        """(job, (rows,) true volumes) of one tank."""
        off = {name: error(rng, one) for name, one in self.inputs.items()}
        off["course_heights"] = self.inputs["course_heights"].sd * rng.normal(size=3)
        radii, waves = 5.0 + rng.normal(0, 0.003, 3), self._waves(rng)
        job = self._read(off)
        xyz = self._points(rng, radii + off["barrel"], waves, off)
        job = replace(job, points=replace(job.points, xyz_m=xyz))
        dips, (low, high, volume) = np.array(self.dips), self.coil
        shell = [self._shell_m3(radii, waves, off["barrel"], dip + self.plate_z_m) for dip in dips]
        wet = np.clip((dips - low) / (high - low), 0, 1)
        return job, np.array(shell) + volume * (1 + off["deadwood"]) * wet

    def table(self, job):
        """The table of a survey about the axis of the design, none of its points lost."""
        return table_of(job, fit_wall(job, self.wall.shell), self.dips)

    def _waves(self, rng):
        """(3, 2 (MODES - 1)) amplitudes of the modes 2, 3, ... of each course's outline, m.

        Half their variance runs up the whole shell. It falls with k^-3; the form of a tank is
        exp(0.4 z) times as large as usual, each of its modes 2 to 5 again, z standard normal.
        """
        number = np.repeat(np.arange(2, MODES + 1), 2)
        sd = number**-1.5 * self.form_m / np.sqrt(np.sum(1.0 * number**-3.0) / 2)
        sd *= np.exp(0.4 * (rng.normal() + np.where(number <= 5, rng.normal(size=len(sd)), 0.0)))
        common, own = rng.normal(size=len(sd)), rng.normal(size=(3, len(sd)))
        return sd * (common + own) / np.sqrt(2)

    def _read(self, off):
        """The job with what was read of all but the points."""
        job = self.job
        courses = tuple(
            replace(
                one,
                height_m=float(height),
                thickness_m=self.plate + off["plate_thickness"],
                paint_m=self.paint + off["paint"],
            )
            for one, height in zip(job.courses, self.heights + off["course_heights"], strict=True)
        )
        e_pa = job.material.e_pa + off["youngs_modulus"]
        expansion = job.material.expansion_per_k + off["expansion"]
        density = self.density + off["liquid_density"]
        warm = self.warm_c + off["shell_temperature"]
        return replace(
            job,
            courses=courses,
            datum=replace(job.datum, dip_plate_z_m=self.plate_z_m + off["datum"]),
            survey=replace(job.survey, shell_temperature_c=warm),
            table=replace(job.table, liquid_density_kg_m3=density),
            material=replace(job.material, e_pa=e_pa, expansion_per_k=expansion),
        )

    def _points(self, rng, radii, waves, off):
        """(n, 3) points as read, on the paint, in the middle of each course."""
        rings, seen = [], harmonics(self.azimuth, MODES)[:, 3:]
        middles = np.cumsum(self.heights) - self.heights / 2
        for middle, radius, wave in zip(middles, radii, waves, strict=True):
            out = radius + self.plate + self.paint + seen @ wave
            centre = middle * np.array(self.slope)
            rings.append(
                ring((1 + off["scale"]) * out + off["offset"], self.azimuth, centre, middle)
            )
        xyz = np.concatenate(rings)
        return xyz + rng.normal(0, self.point_sd, xyz.shape)

    def _shell_m3(self, radii, waves, barrel, level):
        """True volume of the shell below a level, cooled to the table and widened by the liquid."""
        material, total, bottom = self.job.material, 0.0, 0.0
        cooled = self.job.table.reference_temperature_c - self.warm_c
        scale = 1 + material.expansion_per_k * cooled
        upright = self.heights / np.hypot(1.0, np.hypot(*self.slope))
        for height, radius, wave in zip(upright, radii, waves, strict=True):
            filled = np.clip(level - bottom, 0, height)
            z = filled / 2 * (1 + NODES)
            empty = scale * (radius + barrel * (1 - (2 * z / height - 1) ** 2))
            soft = GRAVITY * (scale * radius) ** 2 / (material.e_pa * self.plate)
            wide = empty + soft * self.density * (level - bottom - z)
            area = np.pi * wide**2 + np.pi / 2 * scale**2 * (wave @ wave)
            total += filled / 2 * WEIGHTS @ area
            bottom += height
        return total
