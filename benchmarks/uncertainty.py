"""The uncertainty of every row of a table of 1 mm, beside GTC and `uncertainties`.

    pip install GTC uncertainties
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
their covariance) is counted for nobody and shown apart. The same arithmetic with imaginary steps
gives the whole Jacobian J, hence u from J C J' without any of the programs. Medians, one core. A
peer that is not installed is left out.
"""

import importlib
import os
import sys
import time
from dataclasses import dataclass, replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy.linalg import block_diag

from tankcal.geometry.field.estimate import LEVELS
from tankcal.job import DeclaredInput
from tankcal.tank.body import Body, ShellPart
from tankcal.tank.capacity import Capacity
from tankcal.tank.courses import CourseShape, gauss_levels
from tankcal.tank.factors import survey_factors
from tankcal.tank.fittings import deadwood
from tankcal.tank.volumes import ShellVolume
from tankcal.uncertainty import combine, group_correlated

ROUNDS, PEER_S, TABLES = 5, 4.0, 20  # of ours, in a round
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


def now():
    """(2,) seconds by clock and by processor."""
    return np.array([time.perf_counter(), time.process_time()])


class Peer:
    """Another program at work on the table: found is {row: (volume, u)} so far."""

    def __init__(self, make, package, case):
        start = now()
        inputs, self.read = make(package, case)
        self.plain = Plain(inputs)
        for one in (*self.plain.area, *self.plain.below[1:]):
            self.read(one)  # `uncertainties` keeps the derivatives from then on
        self.made_s = (now() - start)[0]
        heights, course, barrels, parts = (one.T.tolist() for one in rows_of(case))
        self.rows = list(zip(heights, course, barrels, parts, strict=True))
        self.order = np.random.default_rng(1).permutation(len(self.rows)).tolist()
        self.found, self.done = {}, 0

    def table_s(self, seconds):
        """Seconds of the whole table by clock and by processor, from the rows of some seconds."""
        start, first = now(), self.done
        while now()[0] - start[0] < seconds:
            row = self.order[self.done % len(self.order)]
            self.found[row] = self.read(self.plain.volume_m3(*self.rows[row]))
            self.done += 1
        return (now() - start) / (self.done - first) * len(self.rows)


def installed_peers(case):
    """{name: Peer} of those that are there; a line for each that is not."""
    peers = {}
    for name, make in (("GTC", with_gtc), ("uncertainties", with_uncertainties)):
        try:
            package = importlib.import_module(name)
        except ImportError:
            print(f"{name} is not installed: left out")
        else:
            peers[name] = Peer(make, package, case)
    return peers


def differences(values, u, truth, rows):
    """Number of rows, and the largest relative differences of volume and of u from the truth."""
    pairs = zip((values, u), truth, strict=True)
    volume, of_u = (np.max(np.abs(one / of[rows] - 1)) for one, of in pairs)
    return f"{len(u):>10}{volume:>10.0e}{of_u:>10.0e}"


def main():
    """Print a row for each program."""
    case = case_of(int(sys.argv[1]) if len(sys.argv) > 1 else 9500)
    truth, peers, start = dense(case), installed_peers(case), now()
    body = body_of(case)
    made = {"tankcal": (now() - start)[0], **{name: one.made_s for name, one in peers.items()}}
    spent = {name: [] for name in made}
    for _ in range(ROUNDS):
        for _ in range(TABLES):
            start = now()
            found = table_of(body, case.heights_m)
            spent["tankcal"].append(now() - start)
        for name, peer in peers.items():
            spent[name].append(peer.table_s(PEER_S))
    told = {"tankcal": differences(*found[:2], truth, slice(None))}
    for name, peer in peers.items():
        rows, values = list(peer.found), np.transpose(list(peer.found.values()))
        told[name] = differences(*values, found[:2], rows)
    print(f"{len(case.heights_m)} rows, {len(case.estimates)} inputs; seconds of the whole table")
    print("largest relative differences: of tankcal from J C J', of the peers from tankcal")
    columns = ("made once", "clock", "worst", "processor", "by ours", "rows", "volume", "u")
    print(f"{'program':<14}" + "".join(f"{one:>10}" for one in columns))
    own = np.median(spent["tankcal"], axis=0)[0]
    for name, times in spent.items():
        (clock, cpu), worst = np.median(times, axis=0), np.max(times, axis=0)[0]
        row = f"{name:<14}{made[name]:>10.4f}{clock:>10.4f}{worst:>10.4f}{cpu:>10.4f}"
        print(f"{row}{clock / own:>10.0f}{told[name]}")
    print(f"\n{'step':<44}{'processor ms':>14}{'worst':>10}")
    for what, task in steps_of(body, case.heights_m).items():
        times = []
        for _ in range(ROUNDS * TABLES):
            start = now()
            task()
            times.append(1e3 * (now() - start)[1])
        print(f"{what:<44}{np.median(times):>14.2f}{max(times):>10.2f}")


if __name__ == "__main__":
    main()
