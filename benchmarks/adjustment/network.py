"""A geodetic network by total station beside Ceres in C++ and scipy: coordinates with their sds.

    python benchmarks/adjustment/network.py

The stations stand round a tank; each reads directions, zenith angles and distances to the targets
on its side and to its neighbours. Four stations have known coordinates. The right answer of each
coordinate and sd is the median of the programs. GNU Gama and JAG3D, made for such networks, are in
no registry of packages; tests/survey/test_textbook_networks.py has printed results of both kinds.
"""

import os
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import scipy
from ceres import Ceres, built
from measured import ROUNDS, Row, Skipped, digits_of, installation_error, interleaved, tell
from scipy.optimize import least_squares

from tankcal.survey.network import Survey, adjust
from tankcal.survey.observations import ControlCoordinates, Directions, Distances, VerticalAngles

CENTRE_M, RADIUS_M, AWAY_M, HEIGHT_M = (1000.0, 2000.0, 50.0), 10.0, 25.0, 12.0
ARCSEC = np.pi / 648000
SD_ANGLE, SD_DISTANCE_M, SD_CONTROL_M = 2 * ARCSEC, 0.001, 0.0005
LEAST = 6.0  # digits of each
STATIONS, TARGETS = 12, 240
FEWEST = 5  # rounds: two of the programs take milliseconds


def simulate(stations, targets, seed=1):
    """{name: array} of a network: start coordinates, zeros of the circles, readings, control."""
    rng = np.random.default_rng(seed)
    level = np.tile(np.linspace(0.5, HEIGHT_M, 8), targets)[:targets]
    azimuth = np.concatenate([2 * np.pi * np.arange(n) / n for n in (stations, targets)])
    radius = np.repeat([AWAY_M, RADIUS_M], [stations, targets])
    z = np.concatenate([rng.uniform(0, 2, stations), level])
    xyz = np.column_stack([radius * np.sin(azimuth), radius * np.cos(azimuth), z]) + CENTRE_M
    flat = xyz[:, :2] - CENTRE_M[:2]
    wall = flat[stations:]
    start, end = np.nonzero(np.einsum("stk,tk->st", flat[:stations, None] - wall, wall) > 0)
    near = np.arange(stations)
    start = np.concatenate([start, near, near])
    end = np.concatenate([end + stations, (near + 1) % stations, (near - 1) % stations])
    zero = rng.uniform(0, 2 * np.pi, stations)
    values = readings(xyz[end] - xyz[start], zero[start])
    sds = np.array([SD_ANGLE, SD_ANGLE, SD_DISTANCE_M])[:, None]
    return {
        "xyz": xyz + rng.normal(0, 0.05, xyz.shape),
        "zero": zero + 0.001,
        "start": start,
        "end": end,
        "values": values + sds * rng.normal(0, 1, values.shape),
        "sds": np.broadcast_to(sds, values.shape),
        "control": np.arange(0, stations, max(1, stations // 4))[:4],
        "known": xyz,
    }


def readings(d, zero):
    """Directions, zenith angles and distances (3, n) of differences d (n, 3)."""
    flat = np.hypot(d[:, 0], d[:, 1])
    direction = np.arctan2(d[:, 0], d[:, 1]) - zero
    return np.stack([direction, np.arctan2(flat, d[:, 2]), np.hypot(flat, d[:, 2])])


class Tankcal:
    """The public call on a survey."""

    def __init__(self, p):
        at, n = p["control"], len(p["start"])
        ends = p["start"], p["end"]
        direction, zenith, distance = zip(p["values"], p["sds"], strict=True)
        axis = np.tile([0, 1, 2], len(at))
        self.survey = Survey(
            points=tuple(f"P{i}" for i in range(len(p["xyz"]))),
            xyz_m=p["xyz"],
            observations=(
                Directions(*direction, *ends, set=p["start"]),
                VerticalAngles(*zenith, *ends, zenith=True),
                Distances(*distance, *ends, instrument=np.full(n, -1)),
                ControlCoordinates(p["known"][at].ravel(), np.full(3 * len(at), SD_CONTROL_M),
                                   np.repeat(at, 3), axis),
            ),
            sets=p["zero"],
        )  # fmt: skip

    def __call__(self):
        """Keep coordinates and sds (points, 6)."""
        adjusted = adjust(self.survey)
        self.found = np.hstack([adjusted.xyz_m, adjusted.point_sd_m])


class CeresNetwork(Ceres):
    """Ceres in C++, derivatives automatic."""

    def __init__(self, p, folder):
        path, n, kinds = Path(folder) / "network.txt", len(p["start"]), range(3)
        rows = [f"{len(p['zero'])} {len(p['xyz'])} {3 * n} {len(p['control'])}"]
        rows += [f"{value!r}" for value in np.concatenate([p["xyz"].ravel(), p["zero"]]).tolist()]
        for kind, values, sds in zip(kinds, p["values"].tolist(), p["sds"].tolist(), strict=True):
            both = zip(p["start"], p["end"], values, sds, strict=True)
            rows += [f"{kind} {i} {j} {value!r} {sd!r}" for i, j, value, sd in both]
        for i in p["control"]:
            rows.append(" ".join(map(repr, [int(i), *p["known"][i].tolist(), SD_CONTROL_M])))
        path.write_text("\n".join(rows) + "\n", encoding="utf-8")
        super().__init__("network", path, radius=1e10)
        self.note = "wide trust region"

    def __call__(self):
        """Seconds; keep coordinates and sds."""
        solved, found = self.solve()[0], self.ask("covariance points")
        self.found = np.array(found["points"])
        return solved + found["seconds"]


class Scipy:
    """least_squares by MINPACK's Levenberg-Marquardt, with a dense Jacobian from arrays."""

    version, note = scipy.__version__, "dense Jacobian from arrays"

    def __init__(self, p):
        self.p, self.points = p, len(p["xyz"])
        self.x0 = np.concatenate([p["xyz"].ravel(), p["zero"]])

    def residuals(self, x):
        p, xyz = self.p, x[: 3 * self.points].reshape(-1, 3)
        found = readings(xyz[p["end"]] - xyz[p["start"]], x[3 * self.points :][p["start"]])
        off = found - p["values"]
        off[0] = np.arctan2(np.sin(off[0]), np.cos(off[0]))
        control = (xyz - p["known"])[p["control"]] / SD_CONTROL_M
        return np.concatenate([(off / p["sds"]).ravel(), control.ravel()])

    def jacobian(self, x):
        p, xyz = self.p, x[: 3 * self.points].reshape(-1, 3)
        dx, dy, dz = (xyz[p["end"]] - xyz[p["start"]]).T
        p2 = dx * dx + dy * dy
        flat, s2, none = np.sqrt(p2), p2 + dz * dz, np.zeros_like(dx)
        rows = np.array([
            [dy / p2, -dx / p2, none],
            [dx * dz / (flat * s2), dy * dz / (flat * s2), -flat / s2],
            np.stack([dx, dy, dz]) / np.sqrt(s2),
        ]) / p["sds"][:, None]  # fmt: skip
        n, at = len(dx), 3 * p["control"][:, None] + np.arange(3)
        jac = np.zeros((3 * n + at.size, len(x)))
        for kind in range(3):
            line = (n * kind + np.arange(n))[:, None]
            for sign, point in ((1, p["end"]), (-1, p["start"])):
                jac[line, 3 * point[:, None] + np.arange(3)] = sign * rows[kind].T
        jac[np.arange(n), 3 * self.points + p["start"]] = -1 / p["sds"][0]
        jac[3 * n + np.arange(at.size), at.ravel()] = 1 / SD_CONTROL_M
        return jac

    def __call__(self):
        """Keep coordinates and sds, the latter by QR of the Jacobian."""
        x0 = self.x0
        done = least_squares(self.residuals, x0, self.jacobian, method="lm", x_scale="jac")
        r = np.linalg.qr(done.jac / (scale := np.linalg.norm(done.jac, axis=0)), "r")
        inverse = np.linalg.solve(r, np.eye(len(r))) / scale[:, None]
        sds = np.sqrt(np.sum(inverse**2, axis=1))
        both = (one[: 3 * self.points].reshape(-1, 3) for one in (done.x, sds))
        self.found = np.hstack([*both])


def main():
    """A row for each peer."""
    os.environ["TANKCAL_COMPILED"] = "1"
    p, name = simulate(STATIONS, TARGETS), "geodetic network"
    for peer in ("GNU Gama", "JAG3D"):
        tell(Skipped(name, peer, installation_error(peer) or "not tried"))
    tasks = {"tankcal": Tankcal(p), "scipy least_squares (lm)": Scipy(p)}
    with tempfile.TemporaryDirectory() as folder:
        if wrong := built():
            tell(Skipped(name, "Ceres in C++", wrong))
        else:
            tasks["Ceres in C++"] = CeresNetwork(p, folder)
        for task in (*tasks.values(), tasks["tankcal"]):
            task()  # twice: the second loads no more code
        right = np.median([task.found for task in tasks.values()], axis=0)
        digits = {key: digits_of(task.found, right) for key, task in tasks.items()}
        spent = interleaved(tasks, max(ROUNDS, FEWEST))
    size = f"{STATIONS} stations, {TARGETS} targets, {3 * len(p['start'])} readings"
    for key, task in tasks.items():
        if key != "tankcal":
            tell(Row(name, size, spent["tankcal"], key, task.version, spent[key],
                     "coordinates and sds, median of the programs",
                     (digits["tankcal"], digits[key]), LEAST, note=task.note))  # fmt: skip
    if "Ceres in C++" in tasks:
        tasks["Ceres in C++"].close()


if __name__ == "__main__":
    main()
