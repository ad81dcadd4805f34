"""The shipped surveys, photographs and total station: simulations, held against their truth."""

import csv
import json
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from conftest import EXAMPLE

import tankcal
from tankcal.camera.model import PARAMETERS
from tankcal.products.linter.linting import lint
from tankcal.record import record_of
from tankcal.report.outputs import write_tables
from tankcal.report.workbook import write as write_workbook

PHOTOS, STATIONS = EXAMPLE.parent / "silva-1995-photos", EXAMPLE.parent / "total-station"
CLOUD = EXAMPLE.parent / "cloud"
EXAMPLES = {"photos": PHOTOS, "stations": STATIONS}
RANDOM = ("image_points.csv", "directions.csv")  # some of the tables that are drawn
RARE = 0.0005  # on either side: what a sound simulation does once in a thousand times


def rows(folder, name):
    with open(folder / name, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def truth(folder):
    return json.loads((folder / "truth" / "tank.json").read_text(encoding="utf-8"))


def true_points(folder, names):
    of = {row["point"]: row for row in rows(folder, "truth/points.csv")}
    return np.array([[float(of[name][f"{axis}_m"]) for axis in "xyz"] for name in names])


def likely(chi2, dof):
    return RARE < scipy.stats.chi2.cdf(chi2, dof) < 1 - RARE


@pytest.fixture(scope="module")
def results():
    return {name: tankcal.run(tankcal.load(folder)) for name, folder in EXAMPLES.items()}


@pytest.fixture(scope="module", params=EXAMPLES)
def one(request, results):
    return EXAMPLES[request.param], results[request.param]


def test_the_unknowns_of_the_dissertation(results):
    """Published: FOTTER's 487 = 11 x 6 + 10 + 137 x 3 unknowns."""
    layout = results["photos"].adjustment.adjusted.problem.layout
    sizes = [int(np.sum(part >= 0)) for part in (layout.photos, layout.interior, layout.points)]
    assert sizes == [11 * 6, 10, 137 * 3]
    assert results["photos"].adjustment.unknowns == 487


def test_published_values_are_in_the_files():
    """Published: names of control, eight tapes of 6.9 and 9.0 m, eleven photos, c = 100 mm."""
    published = ["15", "75", "81", "95", "115", "135", "161", "175", "215", "235", "241"]
    assert [row["point"] for row in rows(PHOTOS, "control.csv")] == published
    lengths = [float(row["distance_m"]) for row in rows(PHOTOS, "distances.csv")]
    assert [round(length, 1) for length in lengths] == [6.9] * 5 + [9.0] * 3
    assert len(rows(PHOTOS, "photos.csv")) == 11
    assert len(rows(PHOTOS, "targets.csv")) == 24 * 5
    assert set(rows(PHOTOS, "photos.csv")[0]) == {"photo", "camera"}  # no approximate values


def test_each_point_has_three_rays_inside_the_format():
    images = rows(PHOTOS, "image_points.csv")
    names, rays = np.unique([row["point"] for row in images], return_counts=True)
    assert len(names) == 137
    assert rays.min() >= 3
    xy = np.array([[float(row["x_mm"]), float(row["y_mm"])] for row in images])
    assert (np.abs(xy) < [90, 65]).all()


def test_the_readings_are_as_good_as_declared(one, figure):
    """Simulation: v'Pv follows the chi-square distribution of its degrees of freedom."""
    folder, result = one
    adjustment = result.adjustment
    figure(f"sigma0 of {folder.name}", adjustment.sigma0)
    assert likely(adjustment.redundancy * adjustment.sigma0**2, adjustment.redundancy)
    assert not adjustment.removed
    assert not adjustment.warnings


def test_points_against_the_truth(one, figure):
    """Simulation: e' C^-1 e of all points, C their full covariance and the declared scale."""
    folder, result = one
    adjustment = result.adjustment
    error = adjustment.xyz_m - true_points(folder, adjustment.names)
    covariance = adjustment.full_covariance_m2()
    for row in rows(folder, "uncertainty.csv"):
        if row["input"] == "scale":
            lever = 1e-6 * float(row["u"]) * (adjustment.xyz_m - [15.782, 14.150, 10.0]).ravel()
            covariance = covariance + np.outer(lever, lever)
    free = np.diag(covariance) > 1e-12  # what the chosen frame holds is exact
    error, covariance = error.ravel()[free], covariance[np.ix_(free, free)]
    chi2 = error @ np.linalg.solve(covariance, error)
    figure(f"normalised errors of {folder.name}", f"{chi2:.1f} of {free.sum()}")
    assert likely(chi2, free.sum())


def test_volumes_against_the_truth(one, figure):
    """Simulation: the truth, integrated exactly, lies within U at every joint."""
    folder, result = one
    true = truth(folder)
    for dip, volume in list(zip(true["dip_m"], true["volume_m3"], strict=True))[1:]:
        found = result.at(dip)
        figure(f"{folder.name}, {dip} m, error over U", (found.value_m3 - volume) / found.U_m3)
        assert abs(found.value_m3 - volume) < found.U_m3


def test_radii_against_the_truth(one, figure):
    """Simulation: mean distance of the targets of a section from their middle, within 3.5 sd."""
    folder, result = one
    adjustment, section = result.adjustment, {}
    for row in rows(folder, "targets.csv"):
        section.setdefault(row["section"], []).append(row["point"])
    worst = 0.0
    for names in section.values():
        xyz = adjustment.xyz_m[[adjustment.names.index(name) for name in names]]
        radius, outwards = mean_radius(xyz)
        true, _ = mean_radius(true_points(folder, names))
        slope = outwards.ravel() / len(names)
        variance = slope @ adjustment.full_covariance_m2(names) @ slope
        worst = max(worst, abs(radius - true) / np.hypot(np.sqrt(variance), 20e-6 * true))
    figure(f"largest error of a radius of {folder.name}, in sds", f"{worst:.2f}")
    assert worst < 3.5


def mean_radius(xyz):
    """Mean horizontal distance from the middle, and the directions outwards (n, 3)."""
    away = (xyz - xyz.mean(axis=0)) * [1, 1, 0]
    distance = np.linalg.norm(away, axis=1)
    return distance.mean(), away / distance[:, None]


def test_every_target_is_on_the_wall(one):
    _, result = one
    assert len(result.wall.accepted) == len(result.job.points.names)


def test_the_camera_against_the_truth(results, figure):
    """Simulation: chi-square of the ten parameters of the camera."""
    values, names, covariance = results["photos"].adjustment.adjusted.camera(0)
    true = truth(PHOTOS)["camera"]
    assert set(names) == set(true) < set(PARAMETERS)
    error = np.array([values[name] - true[name] for name in names])
    size = np.sqrt(np.diag(covariance))
    scaled = np.linalg.solve(covariance / np.outer(size, size), error / size)
    chi2 = error / size @ scaled
    figure("normalised errors of the camera", f"{chi2:.1f} of {len(names)}")
    assert likely(chi2, len(names))


def test_it_is_the_tank_of_the_reconstruction(results, example_result):
    """Second method: the reconstructed points and the photographs give the same tank."""
    mine, other = results["photos"].job, example_result.job
    assert mine.tank.nominal_diameter_m == other.tank.nominal_diameter_m
    assert mine.courses == other.courses
    for dip in (1.9, 5.0, 9.5):
        one, two = results["photos"].at(dip), example_result.at(dip)
        assert abs(one.value_m3 - two.value_m3) < np.hypot(one.U_m3, two.U_m3)


@pytest.mark.slow
@pytest.mark.parametrize("start", ["without the nominal tank", "1 m and 20 deg off"])
def test_start_values_do_not_matter(results, start):
    """Property: nothing but image points and control, or photos far off, give the same points."""
    job, adjustment = tankcal.load(PHOTOS), results["photos"].adjustment
    site = job.measurements
    if start.startswith("without"):
        site = replace(site, targets=None, nominal=None)
    else:
        rng = np.random.default_rng(20)
        xyz, angles, _ = adjustment.adjusted.photos
        away = rng.normal(size=xyz.shape)
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        off = np.hstack([away, np.radians(20) * rng.choice([-1, 1], angles.shape)])
        photos = zip(site.photos, np.hstack([xyz, angles]) + off, strict=True)
        site = replace(site, photos=tuple(replace(one, values=v) for one, v in photos))
    again = tankcal.adjust_job(replace(job, measurements=site))
    assert again.names == adjustment.names
    assert np.abs(again.xyz_m - adjustment.xyz_m).max() < 1e-7


@pytest.mark.slow
def test_which_photo_is_held_does_not_matter(results, figure):
    """Property: distances between points and their sds are the same whichever photo is held."""
    job, first = tankcal.load(PHOTOS), results["photos"].adjustment
    site = job.measurements
    xyz, angles, _ = first.adjusted.photos
    photos = zip(site.photos, np.hstack([xyz, angles]), strict=True)
    site = replace(site, photos=tuple(replace(one, values=v) for one, v in photos))
    pairs = [("13", "133"), ("73", "193"), ("11", "15"), ("35", "161")]
    found = []
    for name in ("S1", "S6", "S7"):
        settings = replace(site.settings, datum="fixed_photo", fixed_photo=name, snooping=False)
        held = tankcal.adjust_job(replace(job, measurements=replace(site, settings=settings)))
        found.append([length_and_sd(held, *pair) for pair in pairs])
    change = np.abs(np.array(found) / found[0] - 1).max()
    figure("largest relative change of lengths and sds", f"{change:.1e}")
    assert change < 1e-8


def length_and_sd(adjustment, one, other):
    ends = [adjustment.xyz_m[adjustment.names.index(name)] for name in (one, other)]
    length = np.linalg.norm(ends[1] - ends[0])
    slope = np.concatenate([ends[0] - ends[1], ends[1] - ends[0]]) / length
    return length, np.sqrt(slope @ adjustment.full_covariance_m2([one, other]) @ slope)


def test_the_total_station_survey(results):
    """Frame, averaged sets, taped checks, and the instrument in the budget of the table."""
    result = results["stations"]
    adjustment = result.adjustment
    assert adjustment.datum.vertical
    assert adjustment.datum.scale
    kinds = {cause.what for cause in adjustment.causes}
    assert kinds == {"instrument_scale", "instrument_offset"}
    assert kinds <= {source.kind for source in result.table.sources}
    taped = [one for one in adjustment.readings if one.check]
    assert len(taped) == 2
    assert all(abs(one.w) < 3.29 for one in taped)
    zeniths = [one for one in adjustment.readings if one.file == "zenith_angles.csv"]
    assert {one.repeats for one in zeniths} == {2}
    station = adjustment.fixed[adjustment.names.index("S1")]
    assert station.tolist() == [True, True, False]


def test_nothing_is_left_to_be_warned_of(one):
    """Only entries of a laboratory that issues a certificate are missing: nobody's are invented."""
    [draft] = one[1].warnings
    assert draft.expected.code == "certificate_incomplete"
    assert "authorised_by" in draft.expected


def test_pages_state_that_data_are_simulated(one):
    _, result = one
    assert result.job.certificate["notice"] == "SIMULATION"
    assert result.job.certificate["laboratory"].startswith("None")  # nobody's is invented


@pytest.mark.slow
@pytest.mark.parametrize("folder", [*EXAMPLES.values(), CLOUD], ids=[*EXAMPLES, "cloud"])
def test_the_script_writes_the_same_tables_again(folder, tmp_path):
    shutil.copytree(folder, tmp_path / folder.name, ignore=shutil.ignore_patterns("results"))
    shutil.copytree(EXAMPLE, tmp_path / EXAMPLE.name, ignore=shutil.ignore_patterns("results"))
    here = tmp_path / folder.name
    before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    for path in before:
        if path.parent.name == "truth" or path.suffix == ".ply" or path.name in RANDOM:
            path.unlink()
    subprocess.run([sys.executable, here / "simulate.py"], check=True)
    assert {path: path.read_bytes() for path in before} == before


@pytest.mark.slow
def test_linter_accepts_the_tables_of_the_example(one, tmp_path):
    record = record_of(one[1])
    write_tables(record, tmp_path)
    write_workbook(record, tmp_path / "capacity.xlsx")
    for name in ("capacity.csv", "capacity.xlsx"):
        assert [str(found) for found in lint(tmp_path / name).findings] == []
