"""pyceres, gtsam and scipy as peers on the tank networks, gtsam on a BAL problem, too.

The model of the tank's camera is in none of them, so they are given it in Python (projection.py),
reading by reading, or in arrays for scipy. The factors of a BAL problem are gtsam's own, in C++.
Times are of solving from the start values alone; problems are built before.
"""

import math
import time

import numpy as np
from projection import UNIT, image


def timed(work):
    """(seconds of processor, what it gave)."""
    start = time.process_time()
    found = work()
    return time.process_time() - start, found


class _Reading:
    """One reading of an image point: residuals and derivatives, weighted."""

    def __init__(self, xy, sigma):
        self.xy, self.weight = tuple(xy.tolist()), 1 / float(sigma)

    def __call__(self, io, eo, point):
        found, by_x, by_y = image(io.tolist(), eo.tolist(), point.tolist(), math.sin, math.cos)
        residuals = [self.weight * (f - o) for f, o in zip(found, self.xy, strict=True)]
        rows = self.weight * np.array((by_x, by_y))
        return residuals, (rows[:, :10], rows[:, 10:16], rows[:, 16:])


class _Distance:
    """A distance between two points."""

    def __init__(self, length, sd):
        self.length, self.weight = float(length), 1 / float(sd)

    def __call__(self, a, b):
        apart = a - b
        length = math.sqrt(apart @ apart)
        row = (self.weight / length * apart)[None]
        return [self.weight * (length - self.length)], (row, -row)


class _Control:
    """A point of control with one sd for its three coordinates."""

    def __init__(self, xyz, sd):
        self.xyz, self.weight = xyz, 1 / float(sd)

    def __call__(self, point):
        return self.weight * (point - self.xyz), (self.weight * np.eye(3),)


def terms(p):
    """(function, keys) of every observation; keys ("io", 0), ("eo", photo), ("X", point)."""
    for xy, photo, point in zip(p["xy"], p["ph"].tolist(), p["pt"].tolist(), strict=True):
        yield _Reading(xy, p["sigma"]), (("io", 0), ("eo", photo), ("X", point))
    for length, sd, i, j in zip(*(p[f"dist{end}"] for end in ("", "_s", "_i", "_j")), strict=True):
        yield _Distance(length, sd), (("X", int(i)), ("X", int(j)))
    for xyz, sd, point in zip(p["ctl_xyz"], p["ctl_s"], p["ctl"].tolist(), strict=True):
        yield _Control(xyz, sd), (("X", point),)


def start_values(p):
    """{key: vector} of the unknowns."""
    return {
        ("io", 0): p["io"] / UNIT,
        **{("eo", i): one for i, one in enumerate(p["eo"])},
        **{("X", i): one for i, one in enumerate(p["X"])},
    }


class Pyceres:
    """Ceres called from Python, with cost functions in Python."""

    name, note, covers = "pyceres", "cost functions in Python", False

    def __init__(self, module, version, p):
        self.module, self.version = module, f"{version} (Ceres {module.__ceres_version__})"
        self.start = start_values(p)
        self.now = {key: value.copy() for key, value in self.start.items()}
        self.problem, self.kept = module.Problem(), []

        class Cost(module.CostFunction):
            def __init__(self, function, sizes):
                super().__init__()
                self.function = function
                self.set_num_residuals(2 if len(sizes) == 3 else 1 if len(sizes) == 2 else 3)
                self.set_parameter_block_sizes(sizes)

            def Evaluate(self, parameters, residuals, jacobians):
                residuals[:], rows = self.function(*parameters)
                for place, row in zip(jacobians or (), rows, strict=False):
                    if place is not None:
                        place[:] = row.ravel()
                return True

        for function, keys in terms(p):
            blocks = [self.now[key] for key in keys]
            self.kept.append(Cost(function, [len(block) for block in blocks]))
            self.problem.add_residual_block(self.kept[-1], None, blocks)

    def solve(self):
        for key, value in self.start.items():
            self.now[key][:] = value
        options, summary = self.module.SolverOptions(), self.module.SolverSummary()
        options.linear_solver_type = self.module.LinearSolverType.DENSE_SCHUR
        options.logging_type = self.module.LoggingType.SILENT
        options.num_threads = 1
        seconds, _ = timed(lambda: self.module.solve(options, self.problem, summary))
        return seconds, summary.final_cost

    def close(self):
        """Nothing is open."""


class Gtsam:
    """gtsam, its Levenberg-Marquardt with the settings of Ceres; factors in Python."""

    name, note, covers = "gtsam", "factors in Python", True

    def __init__(self, module, version, p):
        self.module, self.version = module, version
        values = start_values(p)
        number = {key: i for i, key in enumerate(values)}
        self.points = [number[key] for key in values if key[0] == "X"]
        self.graph, self.start = module.NonlinearFactorGraph(), module.Values()
        for key, value in values.items():
            self.start.insert(number[key], value)
        for function, keys in terms(p):
            size = {3: 2, 2: 1, 1: 3}[len(keys)]
            numbers = [number[key] for key in keys]
            noise = module.noiseModel.Unit.Create(size)
            self.graph.add(module.CustomFactor(noise, numbers, self._error(function, numbers)))
        self.settings = module.LevenbergMarquardtParams.CeresDefaults

    @staticmethod
    def _error(function, numbers):
        def error(_, values, jacobians):
            residuals, rows = function(*map(values.atVector, numbers))
            if jacobians is not None:
                for i, row in enumerate(rows):
                    jacobians[i] = np.asfortranarray(row)
            return np.asarray(residuals)

        return error

    def solve(self):
        settings = self.settings()
        make = self.module.LevenbergMarquardtOptimizer
        seconds, self.found = timed(lambda: make(self.graph, self.start, settings).optimize())
        return seconds, self.graph.error(self.found)

    def covariance(self, kind):
        def computed():
            marginals = self.module.Marginals(self.graph, self.found)
            if kind == "full":
                joint = marginals.jointMarginalCovariance(self.points)
                return np.trace(joint.fullMatrix())
            return sum(np.trace(marginals.marginalCovariance(one)) for one in self.points)

        return timed(computed)

    def close(self):
        """Nothing is open."""


class GtsamBal(Gtsam):
    """gtsam on a BAL problem, with its own factors in C++."""

    note = "its own factors in C++"

    def __init__(self, module, version, path):
        self.module, self.version = module, version
        data = module.SfmData.FromBalFile(str(path))
        self.graph = data.generalSfmFactors(module.noiseModel.Unit.Create(2))
        self.settings = module.LevenbergMarquardtParams  # with Ceres' it goes astray here
        self.start = module.initialCamerasAndPointsEstimate(data)


class Scipy:
    """scipy's least_squares by MINPACK's Levenberg-Marquardt, the Jacobian in arrays."""

    name, note, covers = "scipy least_squares (lm)", "dense Jacobian from arrays", True

    def __init__(self, module, version, p):
        self.version, self.p = version, p
        self.sizes = np.cumsum([10, p["eo"].size, p["X"].size])
        self.x0 = np.concatenate([p["io"] / UNIT, p["eo"].ravel(), p["X"].ravel()])
        self.rest = [term for term in terms(p) if len(term[1]) < 3]
        from scipy.optimize import least_squares

        self.least_squares, self.found = least_squares, None

    def _split(self, x):
        io, eo, points = np.split(x, self.sizes[:-1])
        return io, eo.reshape(-1, 6), points.reshape(-1, 3)

    def _evaluated(self, x):
        """Residuals and dense Jacobian."""
        p, (io, eo, points) = self.p, self._split(x)
        found, by_x, by_y = image(io, eo[p["ph"]].T, points[p["pt"]].T, np.sin, np.cos)
        n, weight = len(p["ph"]), 1 / p["sigma"]
        tall = 2 * n + sum(
            len(function(*self._of(points, keys))[0]) for function, keys in self.rest
        )
        residuals, rows = np.zeros(tall), np.zeros((tall, len(x)))
        columns = np.hstack([
            np.tile(np.arange(10), (n, 1)),
            10 + 6 * p["ph"][:, None] + np.arange(6),
            self.sizes[1] + 3 * p["pt"][:, None] + np.arange(3),
        ])  # fmt: skip
        for i, (value, derivatives) in enumerate(zip(found, (by_x, by_y), strict=True)):
            residuals[i : 2 * n : 2] = weight * (value - p["xy"][:, i])
            full = np.stack(np.broadcast_arrays(*derivatives), axis=1)
            rows[np.arange(i, 2 * n, 2)[:, None], columns] = weight * full
        at = 2 * n
        for function, keys in self.rest:
            values, blocks = function(*self._of(points, keys))
            residuals[at : at + len(values)] = values
            for (_, point), block in zip(keys, blocks, strict=True):
                first = self.sizes[1] + 3 * point
                rows[at : at + len(values), first : first + 3] = block
            at += len(values)
        return residuals, rows

    @staticmethod
    def _of(points, keys):
        return [points[point] for _, point in keys]

    def solve(self):
        seconds, self.found = timed(
            lambda: self.least_squares(
                lambda x: self._evaluated(x)[0], self.x0, lambda x: self._evaluated(x)[1],
                method="lm", x_scale="jac",
            )
        )  # fmt: skip
        return seconds, self.found.cost

    def covariance(self, kind):
        def computed():
            r = np.linalg.qr(
                self.found.jac / (scale := np.linalg.norm(self.found.jac, axis=0)), "r"
            )
            inverse = np.linalg.solve(r, np.eye(len(r))) / scale[:, None]
            return float(np.sum(inverse[self.sizes[1] :] ** 2))

        return timed(computed)

    def close(self):
        """Nothing is open."""
