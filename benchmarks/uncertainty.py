"""The uncertainty of every row of a table of 1 mm, beside GTC and `uncertainties`.

    python benchmarks/uncertainty.py [rows]        (default: 9500)

A tank of eight courses with a ring of fourteen points each, and 130 inputs: 112 radii with a full
covariance; scale, datum, offset, barrel, plate, paint, shell temperature and expansion, each
correlated with every other; the heights of the courses and two fittings, independent. The goal:
volumes, u, degrees of freedom, k and U of all rows within 4 ms, GTC's time by some 4000; no step
of them (`steps_of`: a linear map of the values and of the factor of their covariance, or what is
made of it) above 0.5 ms; and every u as the others find it to 1e-12 of itself. A table is 5 MB of
fresh memory: where the system is slow to hand out pages, that is a third of its time.

The peers have the same inputs and the tank in plain arithmetic (`Plain`), as lean as can be: one
area for each course, made once. They give value and u. Each has 20 s in five interleaved rounds for
rows from all over the table, extrapolated to the whole of it. What is made once (the areas and
their covariance) is counted for nobody. The same arithmetic with imaginary steps gives the whole
Jacobian J, hence u from J C J' without any of the programs: the right answer.
"""

import os
import sys
import time
from dataclasses import dataclass, replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measured import ROUNDS, Row, digits_of, interleaved, peer_module, tell
from scipy.linalg import block_diag

from tankcal.geometry.field.estimate import LEVELS
from tankcal.job import DeclaredInput
from tankcal.tank.body import Body, ShellPart
from tankcal.tank.budgets import survey_factors
from tankcal.tank.capacity import Capacity
from tankcal.tank.fittings import deadwood
from tankcal.tank.volumes import CourseShape, ShellVolume, gauss_levels
from tankcal.uncertainty import combine, group_correlated

PEER_S, TABLES = 4.0, 20  # seconds of a peer, tables of ours, in a round
LEAST = 11.0  # digits of u, which sums of 130 terms in another order leave; the tests hold 12
HEIGHT_M, COURSES, POINTS, RADIUS_M = 9.5004, 8, 14, 6.5
COURSE_M, RADII = HEIGHT_M / COURSES, COURSES * POINTS
JOINTS_M = COURSE_M * np.arange(COURSES)  # never at a row: the area jumps there
AZIMUTHS = 2 * np.pi * np.arange(POINTS) / POINTS
REFERENCE_C, PLATE_M, PAINT_M, SHELL_C, EXPANSION = 20.0, 8e-3, 3e-4, 26.0, 1.1e-5
SHARED = {  # name: estimate, standard uncertainty, degrees of freedom
    "scale": (1.0, 2e-5, np.inf),
    "datum": (0.0, 1e-3, 12.0),
    "offset": (0.0, 3e-4, np.inf),
    "barrel": (0.0, 1e-3, np.inf),
    "plate_thickness": (PLATE_M, 1e-4, np.inf),
    "paint": (PAINT_M, 3e-5, np.inf),
    "shell_temperature": (SHELL_C, 1.0, 9.0),
    "expansion": (EXPANSION, 5e-7, np.inf),
}
HEIGHT_U_M, SURVEY_DOF = 2e-3, 30.0
FITTINGS = ((0.2, 0.6, -0.35, 0.02), (0.5, 1.1, 0.12, 0.01))  # bottom, top, volume, u
CORRELATED = RADII + len(SHARED)


@dataclass(frozen=True)
class Case:
    """Estimates (130,) and covariance (130, 130): radii, SHARED, heights of courses, fittings.

    correlations  of SHARED, as `Body` takes them; heights_m (rows,) dips of the table
    """

    estimates: np.ndarray
    covariance: np.ndarray
    correlations: tuple
    heights_m: np.ndarray


def case_of(rows):
    """The tank with so many rows up to 9.5 m, its numbers from one seed."""
    rng, names = np.random.default_rng(1), tuple(SHARED)
    radii = RADIUS_M + 0.01 * np.cos(2 * AZIMUTHS) + rng.normal(0, 2e-3, (COURSES, POINTS))
    azimuth, level = np.tile(AZIMUTHS, COURSES), np.repeat(JOINTS_M, POINTS)
    place = np.column_stack([RADIUS_M * np.sin(azimuth), RADIUS_M * np.cos(azimuth), level])
    apart = np.linalg.norm(place[:, None] - place, axis=2)
    mixed = rng.normal(size=(len(names), 2 * len(names)))
    mixed /= np.linalg.norm(mixed, axis=1)[:, None]
    correlation, u = mixed @ mixed.T, np.array([one[1] for one in SHARED.values()])
    return Case(
        np.concatenate(
            [
                radii.ravel(),
                [one[0] for one in SHARED.values()],
                np.full(COURSES, COURSE_M),
                [one[2] for one in FITTINGS],
            ]
        ),
        block_diag(
            1e-6 * (np.eye(RADII) + 1.5 * np.exp(-apart / 5)),
            correlation * np.outer(u, u),
            HEIGHT_U_M**2 * np.eye(COURSES),
            np.diag([one[3] ** 2 for one in FITTINGS]),
        ),
        tuple((names[i], names[j], correlation[i, j]) for i in range(len(u)) for j in range(i)),
        np.linspace(0, 9.5, rows + 1)[1:],
    )


def body_of(case):
    """The tank as the chain makes it, from the radii and their covariance."""
    scale = 1 + EXPANSION * (REFERENCE_C - SHELL_C)
    zeta, inset = 2 * gauss_levels() - 1, PLATE_M + PAINT_M
    shapes = []
    for bottom, ring in zip(JOINTS_M, case.estimates[:RADII].reshape(COURSES, -1), strict=True):
        inside = np.tile(scale * (ring - inset), (LEVELS, 1))
        missed = {"barrel": -(zeta**2)}  # beyond the ring at the middle of a course
        shapes.append(CourseShape(bottom, bottom + COURSE_M, inside, inset, scale, missed))
    by_radii = block_diag(*(2 * np.pi / POINTS * shape.gradients_m for shape in shapes))
    covariance = by_radii @ case.covariance[:RADII, :RADII] @ by_radii.T
    shell = ShellPart(
        ShellVolume(tuple(shapes)),
        survey_factors(covariance, SURVEY_DOF),
        scale,
        EXPANSION,
        bearing=("plate_thickness", "paint", "shell_temperature", "expansion"),
    )
    declared = [DeclaredInput(name, u, "", u, dof=dof) for name, (_, u, dof) in SHARED.items()]
    declared.append(DeclaredInput("course_heights", HEIGHT_U_M, "m", HEIGHT_U_M))
    fittings = deadwood(["coil", "manhole"], *zip(*FITTINGS, strict=True))
    return Body((shell, fittings), tuple(declared), 0.0, HEIGHT_M, correlations=case.correlations)


def table_of(body, heights_m):
    """(rows,) volumes, u, degrees of freedom, k and U."""
    table = Capacity(heights_m, *body.rows(heights_m), 0.95)
    return table.volume_m3, table.u_m3, table.dof, table.k, table.U_m3


def steps_of(body, heights_m):
    """{what: task} of the steps that a table is made of."""
    shell, fittings = body.parts
    areas = np.column_stack([shell.volume.features, *(one.columns for one in shell.factors)])
    table = Capacity(heights_m, *body.rows(heights_m), 0.95)
    together = combine(table.sources, len(heights_m))
    alone = [one for source in table.sources for one in source.parts]
    return {
        "areas to volumes, with the survey's factor": lambda: shell.volume.integrated(
            heights_m, areas
        ),
        "volumes by the inputs of the shell": lambda: shell.derivatives(heights_m),
        "fittings, with their factor": lambda: (
            fittings.volume_m3(heights_m),
            fittings.sources(heights_m),
        ),
        "eight correlated inputs made one": lambda: group_correlated(
            {one.kind: one for one in alone}, body.correlations
        ),
        "u": lambda: combine(table.sources, len(heights_m)).u,
        "degrees of freedom, k and U": lambda: replace(together).expanded(0.95),
    }


class Plain:
    """The tank by hand, for numbers of any kind: GTC's, those of `uncertainties`, complex ones.

    x (130,) inputs in the order of `Case`. Beyond the ring at its middle a barrel b adds
    b (4 t - 4 t^2 - 1) to the radius at the part t of a course's height; b is 0, so what multiplies
    it are numbers.
    """

    def __init__(self, x):
        rings = x[:RADII].reshape(COURSES, POINTS)
        shared = x[RADII:CORRELATED]
        scale, self.datum, offset, self.barrel, plate, paint, shell_c, expansion = shared
        heights, self.fittings = x[CORRELATED:][:COURSES], x[-len(FITTINGS) :]
        size = 1 + expansion * (REFERENCE_C - shell_c)
        inside = (rings * scale + (offset - plate - paint)) * size
        self.area = np.array([np.pi / POINTS * (ring @ ring) for ring in inside], dtype=x.dtype)
        self.below = np.zeros_like(self.area)  # what a course that began at 0 would lack
        joint = 0.0
        for course in range(1, COURSES):
            joint = joint + heights[course - 1]
            step = (self.area[course - 1] - self.area[course]) * joint
            self.below[course] = self.below[course - 1] + step

    def volume_m3(self, height, course, barrels, parts):
        """Volume below a dip: its course, what a unit barrel makes below it, parts of fittings."""
        found = self.below[course] + self.area[course] * (height + self.datum)
        found = found + self.barrel * barrels
        for fitting, part in zip(self.fittings, parts, strict=True):
            found = found + fitting * part
        return found


def rows_of(case):
    """What `Plain.volume_m3` takes of all rows, plain numbers; rows last."""
    h = case.heights_m
    t = np.clip((h - JOINTS_M[:, None]) / COURSE_M, 0, 1)
    size = 1 + EXPANSION * (REFERENCE_C - SHELL_C)
    radii = case.estimates[:RADII].reshape(COURSES, -1).mean(axis=1) - PLATE_M - PAINT_M
    barrels = 2 * np.pi * size**2 * COURSE_M * radii @ (2 * t**2 - 4 / 3 * t**3 - t)
    parts = np.array([np.clip((h - low) / (high - low), 0, 1) for low, high, *_ in FITTINGS])
    return h, np.searchsorted(JOINTS_M, h, side="right") - 1, barrels, parts


def dense(case):
    """(rows,) volumes and u from J C J', J by imaginary steps."""
    rows, step = rows_of(case), 1e-30
    volume = Plain(case.estimates).volume_m3(*rows)
    moved = (case.estimates + 1j * step * unit for unit in np.eye(len(case.estimates)))
    jacobian = np.array([Plain(x).volume_m3(*rows).imag / step for x in moved])
    return volume, np.sqrt(np.sum(jacobian * (case.covariance @ jacobian), axis=0))


def with_gtc(gtc, case):
    """(130,) inputs as numbers of GTC, and how value and u are read from one."""
    u = np.sqrt(np.diag(case.covariance))
    inputs = [
        gtc.ureal(float(x), float(s), independent=place >= CORRELATED)
        for place, (x, s) in enumerate(zip(case.estimates, u, strict=True))
    ]
    for i, j in zip(*np.nonzero(np.tril(case.covariance, -1)), strict=True):
        gtc.set_correlation(float(case.covariance[i, j] / (u[i] * u[j])), inputs[i], inputs[j])
    return np.array(inputs, dtype=object), lambda found: (found.x, found.u)


def with_uncertainties(package, case):
    """(130,) inputs as numbers of `uncertainties`, and how value and u are read from one."""
    values, covariance = case.estimates, case.covariance
    inputs = (
        *package.correlated_values(values[:CORRELATED], covariance[:CORRELATED, :CORRELATED]),
        *map(package.ufloat, values[CORRELATED:], np.sqrt(np.diag(covariance)[CORRELATED:])),
    )
    return np.array(inputs, dtype=object), lambda found: (found.nominal_value, found.std_dev)


class Peer:
    """Another program at work on the table: found is {row: (volume, u)} so far."""

    def __init__(self, make, package, case):
        inputs, self.read = make(package, case)
        self.plain = Plain(inputs)
        for one in (*self.plain.area, *self.plain.below[1:]):
            self.read(one)  # `uncertainties` keeps the derivatives from then on
        heights, course, barrels, parts = (one.T.tolist() for one in rows_of(case))
        self.rows = list(zip(heights, course, barrels, parts, strict=True))
        self.order = np.random.default_rng(1).permutation(len(self.rows)).tolist()
        self.found, self.done = {}, 0

    def table_s(self, seconds=PEER_S):
        """Seconds of processor of the whole table, from the rows of some seconds."""
        start, first = time.process_time(), self.done
        while time.process_time() - start < seconds:
            row = self.order[self.done % len(self.order)]
            self.found[row] = self.read(self.plain.volume_m3(*self.rows[row]))
            self.done += 1
        return (time.process_time() - start) / (self.done - first) * len(self.rows)


def main():
    """A row for each peer."""
    case = case_of(int(sys.argv[1]) if len(sys.argv) > 1 else 9500)
    truth, body, peers = dense(case), body_of(case), {}
    name = "uncertainty of a table"
    size = f"{len(case.heights_m)} rows, {len(case.estimates)} inputs"
    for package, make in (("GTC", with_gtc), ("uncertainties", with_uncertainties)):
        if found := peer_module(package, name):
            peers[package] = found[1], Peer(make, found[0], case)

    def ours():
        start = time.process_time()
        for _ in range(TABLES):
            table_of(body, case.heights_m)
        return (time.process_time() - start) / TABLES

    def digits(values, u, rows):
        return min(digits_of(one, of[rows]) for one, of in zip((values, u), truth, strict=True))

    own = digits(*table_of(body, case.heights_m)[:2], slice(None))
    for _, peer in peers.values():
        peer.table_s(PEER_S / 8)
    tasks = {"tankcal": ours, **{one: peer.table_s for one, (_, peer) in peers.items()}}
    seconds = interleaved(tasks, ROUNDS)
    about = {"answer": "volumes and u, J C J'", "least": LEAST}
    for package, (version, peer) in peers.items():
        theirs = digits(*np.transpose(list(peer.found.values())), list(peer.found))
        note = "some of the rows, extrapolated" * (len(peer.found) < len(peer.rows))
        tell(Row(name, size, seconds["tankcal"], package, version, seconds[package],
                 digits=(own, theirs), note=note, **about))  # fmt: skip
    if not peers:
        tell(Row(name, size, seconds["tankcal"], digits=(own, None), **about))
    steps = {what: of_many(task) for what, task in steps_of(body, case.heights_m).items()}
    for what, spent in interleaved(steps, ROUNDS).items():
        tell(Row(f"step of it: {what}", size, spent))


def of_many(task):
    """A task that gives the seconds of processor of another, which is over in a blink."""

    def seconds():
        start = time.process_time()
        for _ in range(TABLES):
            task()
        return (time.process_time() - start) / TABLES

    return seconds


if __name__ == "__main__":
    main()
