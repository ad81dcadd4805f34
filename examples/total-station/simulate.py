"""A tank measured with a total station: a simulated survey, with its truth.

Five set-ups around a tank of 10 m, joined by a closed traverse with forced centring, and film
targets on the wall; two benchmarks carry the height. Everything that a surveyor cannot know is
drawn (seeded) from the standard uncertainties that the job declares. Run it to write the tables
again:

    python simulate.py
"""

import csv
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEED = 12
RADIUS_M, CENTRE_M, BOTTOM_M, COURSE_M, COURSES = 5.0, (111.0, 108.0), 51.200, 1.800, 4
GENERATRICES, LEVELS = 20, (0.211, 0.789)  # of a course
WAVES = 9  # from 0
SETUPS, FROM_AXIS_M, WIDEST_DEG = 5, 14.0, 42.0
FILM_M = 0.0003  # thickness of a film target
SETS = 2
ARCSEC = np.pi / 180 / 3600
# standard deviations of a reading: to prisms of the traverse and the benchmarks, to film targets
PRISM = {"direction": 3.0, "zenith": 3.0, "distance_mm": 1.0}
FILM = {"direction": 6.0, "zenith": 6.0, "distance_mm": 1.5}
LEVELLED_M, BENCHMARK_M, TAPE_M = 0.0003, 0.0005, 0.001
# standard uncertainties of instruments.toml and uncertainty.csv; true values are drawn from them
EDM_SCALE, EDM_OFFSET_M = 5e-6, 0.0007
ZERO_M, PLATE_M, PAINT_M, SHELL_K = 0.0005, 0.0001, 0.00005, 1.5
SHELL_C, REFERENCE_C, EXPANSION = 22.0, 20.0, 1.2e-5


class Wall:
    """The true wall: in each course an outline that changes evenly from its bottom to its top.

    r(a, t) = Re (m_0 + 2 sum m_k exp(i k a)), m = middle + (2 t - 1) slope, t from 0 to 1 up the
    course; so areas are sums of squares, and volumes parabolas integrated exactly.
    """

    def __init__(self, rng):
        self.lean = rng.normal(0, 0.0015, 2)
        size = 0.5 * np.append([0.0, 0.0], 0.004 * (2 / np.arange(2.0, WAVES)) ** 1.5)
        common = size * _complex(rng, 1)
        self.middle = common + 0.4 * size * _complex(rng, COURSES)
        self.slope = 0.2 * size * _complex(rng, COURSES)
        self.middle[:, 0] = RADIUS_M + 0.003 + rng.normal(0, 0.002, COURSES)
        self.slope[:, 0] = rng.normal(0, 0.0007, COURSES)

    def radius_m(self, azimuth, z_m):
        """Outside radius (n,) about the axis."""
        course = np.clip((z_m - BOTTOM_M) // COURSE_M, 0, COURSES - 1).astype(int)
        t = (z_m - BOTTOM_M) / COURSE_M - course
        waves = self.middle[course] + (2 * t - 1)[:, None] * self.slope[course]
        turn = np.exp(1j * np.outer(azimuth, np.arange(WAVES)))
        return np.real(waves[:, 0] + 2 * np.sum(waves[:, 1:] * turn[:, 1:], axis=1))

    def point(self, azimuth, z_m, off_m=0.0):
        """Points (n, 3) at a distance off the wall."""
        azimuth, z_m = np.broadcast_arrays(np.asarray(azimuth, float), np.asarray(z_m, float))
        axis = np.array(CENTRE_M) + np.outer(z_m - BOTTOM_M, self.lean)
        r = self.radius_m(azimuth, z_m) + off_m
        plan = axis + r[:, None] * np.column_stack([np.sin(azimuth), np.cos(azimuth)])
        return np.column_stack([plan, z_m])

    def volume_m3(self, dip_m, true):
        """Inside volume below a dip, of the tank at the table's temperature: exact."""
        skin = np.array(true["plate_mm"]) / 1000 + true["paint_mm"] / 1000
        middle, slope = self.middle.copy(), self.slope
        middle[:, 0] -= skin
        upright = 1 / np.sqrt(1 + self.lean @ self.lean)
        level = (dip_m + true["zero_mm"] / 1000) / (COURSE_M * upright)
        total = 0.0
        for course in range(COURSES):
            top = level - course if course == COURSES - 1 else min(level - course, 1.0)
            if top > 0:
                t, weight = np.polynomial.legendre.leggauss(2)
                waves = middle[course] + np.outer(top * (t + 1) - 1, slope[course])
                areas = np.abs(waves[:, 0]) ** 2 + 2 * np.sum(np.abs(waves[:, 1:]) ** 2, axis=1)
                total += np.pi * top / 2 * (weight @ areas)
        stretch = 1 + EXPANSION * (REFERENCE_C - true["shell_c"])
        return float(stretch**2 * total * COURSE_M * upright)


def _complex(rng, n):
    return rng.normal(size=(n, WAVES)) + 1j * rng.normal(size=(n, WAVES))


def places(wall, rng):
    """{name: xyz}: stations S1 to S5 on the ground, benchmarks, wall targets "level-generatrix"."""
    found = {}
    for i in range(SETUPS):
        azimuth = 2 * np.pi * (i + 1 / 6) / SETUPS + rng.normal(0, 0.03)
        out = FROM_AXIS_M + rng.uniform(-0.5, 0.5)
        plan = np.array(CENTRE_M) + out * np.array([np.sin(azimuth), np.cos(azimuth)])
        found[f"S{i + 1}"] = np.array([*plan, BOTTOM_M - 0.3 + rng.normal(0, 0.15)])
    # the frame that the job chooses: S1 at (100, 100), its azimuth to S2 100 gon
    found["B1"] = wall.point([np.radians(40)], [BOTTOM_M + 0.1], 0.9)[0]
    found["B2"] = wall.point([np.radians(210)], [BOTTOM_M + 0.1], 0.9)[0]
    for g in range(1, GENERATRICES + 1):
        for level, z in enumerate(_levels_m(), 1):
            azimuth = 2 * np.pi * (g - 1) / GENERATRICES + rng.normal(0, 0.003)
            height = z + rng.normal(0, 0.005)
            found[f"{level}-{g:02d}"] = wall.point([azimuth], [height], FILM_M)[0]
    return found


def _levels_m():
    return [BOTTOM_M + (c + part) * COURSE_M for c in range(COURSES) for part in LEVELS]


def sights(found):
    """(set-up, point, what stands there) of everything that is sighted."""
    for i in range(SETUPS):
        own = f"S{i + 1}"
        for k in ((i - 1) % SETUPS, (i + 1) % SETUPS):
            yield own, f"S{k + 1}", "prism"
        for name, xyz in found.items():
            if name[0] != "S" and _turn_deg(found[own], xyz) < WIDEST_DEG:
                yield own, name, "rod" if name[0] == "B" else "film"


def _turn_deg(station, xyz):
    """Angle at the tank's axis between a station and a point, in plan."""
    one, other = station[:2] - CENTRE_M, xyz[:2] - CENTRE_M
    return np.degrees(np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other)))


def readings(found, height_m, true, rng):
    """Rows of directions.csv, zenith_angles.csv and slope_distances.csv, with their errors."""
    directions, zeniths, distances = [], [], []
    zero = {(f"S{i + 1}", s): rng.uniform(0, 2 * np.pi) for i in range(SETUPS) for s in range(SETS)}
    for s in range(SETS):
        for own, name, stands in sights(found):
            target_m = {"prism": height_m.get(name), "rod": 0.100, "film": 0.0}[stands]
            sd = FILM if stands == "film" else PRISM
            way = found[name] + [0, 0, target_m] - found[own] - [0, 0, height_m[own]]
            length = np.linalg.norm(way)
            azimuth = np.arctan2(way[0], way[1]) + rng.normal(0, sd["direction"] * ARCSEC)
            zenith = np.arccos(way[2] / length) + rng.normal(0, sd["zenith"] * ARCSEC)
            length = (1 + true["scale"]) * length + true["offset_mm"] / 1000
            length += rng.normal(0, sd["distance_mm"] / 1000)
            circle = _gon((azimuth - zero[own, s]) % (2 * np.pi))
            end = f"{target_m:.3f}"
            directions.append([own, s + 1, name, circle, sd["direction"], end])
            zeniths.append([own, name, _gon(zenith), sd["zenith"], end])
            distances.append([own, name, f"{length:.5f}", sd["distance_mm"], end])
    return directions, zeniths, distances


def _gon(angle):
    return f"{np.degrees(angle) / 0.9:.5f}"


def on_site(found, rng):
    """Rows of control.csv, height_differences.csv, azimuths.csv and distances.csv."""
    first = found["B1"][2] + rng.normal(0, BENCHMARK_M)
    second = found["B2"][2] + rng.normal(0, BENCHMARK_M)
    mm = 1000 * BENCHMARK_M
    control = [
        ["S1", *(f"{value:.3f}" for value in found["S1"][:2]), "", 0, 0, ""],
        ["B1", "", "", f"{first:.4f}", "", "", mm],
        ["B2", "", "", f"{second:.4f}", "", "", mm],
    ]
    step = found["B2"][2] - found["B1"][2]
    there, back = step + rng.normal(0, LEVELLED_M), -step + rng.normal(0, LEVELLED_M)
    levelled = [["B1", "B2", f"{there:.4f}", 1000 * LEVELLED_M]]
    levelled += [["B2", "B1", f"{back:.4f}", 1000 * LEVELLED_M]]
    tapes = []
    for g in (5, 15):
        low, high = f"1-{g:02d}", f"{len(_levels_m())}-{g:02d}"
        length = np.linalg.norm(found[high] - found[low]) + rng.normal(0, TAPE_M)
        tapes.append([low, high, f"{length:.4f}", 1000 * TAPE_M, "check"])
    return control, levelled, tapes


def turned(found):
    """The same places in the frame of the job: S1 at (100, 100), S2 due east of it."""
    way = found["S2"][:2] - found["S1"][:2]
    east = way / np.linalg.norm(way)
    turn = np.array([east, [-east[1], east[0]]])
    return {
        name: np.array([*(np.array([100.0, 100.0]) + turn @ (xyz[:2] - found["S1"][:2])), xyz[2]])
        for name, xyz in found.items()
    }


def unseen(rng):
    """What a surveyor cannot know: true values within the declared uncertainties."""
    courses = _read(HERE / "courses.csv")
    plate_mm = 1000 * rng.normal(0, PLATE_M)
    return {
        "scale": rng.normal(0, EDM_SCALE),
        "offset_mm": 1000 * rng.normal(0, EDM_OFFSET_M),
        "zero_mm": 1000 * rng.normal(0, ZERO_M),
        "plate_mm": [float(row["thickness_mm"]) + plate_mm for row in courses],
        "paint_mm": float(courses[0]["paint_mm"]) + 1000 * rng.normal(0, PAINT_M),
        "shell_c": SHELL_C + rng.normal(0, SHELL_K),
    }


def main():
    """Write the tables and truth/ beside this script."""
    rng = np.random.default_rng(SEED)
    true, wall = unseen(rng), Wall(rng)
    found = places(wall, rng)
    height_m = {f"S{i + 1}": round(1.55 + rng.uniform(0, 0.1), 3) for i in range(SETUPS)}
    directions, zeniths, distances = readings(found, height_m, true, rng)
    found = turned(found)
    control, levelled, tapes = on_site(found, rng)
    setups = [[name, name, "TS", f"{height:.3f}"] for name, height in height_m.items()]
    _write("setups.csv", "setup station instrument instrument_height_m", setups)
    _write("directions.csv", "setup set to direction_gon s_arcsec target_height_m", directions)
    _write("zenith_angles.csv", "setup to zenith_gon s_arcsec target_height_m", zeniths)
    _write("slope_distances.csv", "setup to distance_m s_mm target_height_m", distances)
    _write("control.csv", "point x_m y_m z_m sx_mm sy_mm sz_mm", control)
    _write("azimuths.csv", "from to azimuth_gon s_arcsec", [["S1", "S2", "100.0000", 0]])
    _write("height_differences.csv", "from to dz_m s_mm", levelled)
    _write("distances.csv", "from to distance_m s_mm use", tapes)
    targets = [
        [f"{level}-{g:02d}", level, g, f"{z:.3f}", 1000 * FILM_M]
        for g in range(1, GENERATRICES + 1)
        for level, z in enumerate(_levels_m(), 1)
    ]
    _write("targets.csv", "point section generatrix z_m offset_mm", targets)
    (HERE / "truth").mkdir(exist_ok=True)
    points = [[name, *(f"{value:.6f}" for value in xyz)] for name, xyz in found.items()]
    _write("truth/points.csv", "point x_m y_m z_m", points)
    _write_tank(wall, true)


def _write_tank(wall, true):
    """truth/tank.json."""
    dips = [round(COURSE_M * k, 3) for k in range(COURSES + 1)]
    tank = {
        **{key: _rounded(value, 9) for key, value in true.items()},
        "lean": _rounded(np.hypot(*wall.lean), 9),
        "mean_outside_radius_m": _rounded(wall.middle[:, 0].real, 6),
        "dip_m": dips,
        "volume_m3": _rounded([wall.volume_m3(dip, true) for dip in dips], 4),
    }
    text = json.dumps(tank, indent=1)
    (HERE / "truth" / "tank.json").write_text(text + "\n", encoding="utf-8")


def _rounded(value, digits):
    if np.ndim(value) == 0:
        return round(float(value), digits)
    return [round(float(one), digits) for one in value]


def _read(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def _write(name, headings, rows):
    with open(HERE / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(headings.split())
        writer.writerows(rows)


if __name__ == "__main__":
    main()
