"""Figures in running text, which no session prints: each is the rounded result of a run."""

import csv
import math
import shutil

import numpy as np
import pytest
from conftest import EXAMPLE
from job_builder import write_folder
from page_figures import agree, figures_of, rounded, value_of
from radii_jobs import HEIGHTS_M, RADII_M, radii_parts

import tankcal
from tankcal.cli import main
from tankcal.geometry.girth import perimeter_excess
from tankcal.job.checks.tapes import DEEPEST
from tankcal.methods.rings.wall import UPRIGHT_M
from tankcal.tank.lying import RingedTank


@pytest.mark.slow
def test_a_point_that_is_kept(tmp_path):
    printed = figures_of(
        "docs/studies/overruling.md",
        "(U = () m³ of () m³) keeping `I 57`, which is () mm inside the wall, takes () m³ off the "
        "volume and makes U () m³",
    )
    job = shutil.copytree(EXAMPLE.parent / "wall-hits", tmp_path / "job")
    plain = tankcal.run(tankcal.load(job))
    heading = "point,table,row,decision,reason,by,date\n"
    (job / "overrulings.csv").write_text(f"{heading}I 57,,,keep,looked at,J. Silva,2026-02-03\n")
    result = tankcal.run(tankcal.load(job))
    [one] = result.overrulings.each
    top = plain.capacity.height_m.iloc[-1]
    found = [plain.at(top).U_m3, plain.at(top).value_m3, -1000 * one.off_m, -one.moved_m3]
    assert rounded([*found, result.at(top).U_m3], printed) == printed


@pytest.mark.slow
def test_a_sounding_of_a_ship(tmp_path):
    printed = figures_of(
        "examples/ship/README.md",
        "At a trim of () m by the stern and a list of ()° to starboard a sounding of () m has "
        "a correction of −() mm, and the tank holds () m³, U = () m³; the table alone would say "
        "() m³",
    )
    trim, heel, sounding = map(float, printed[:3])
    assert main(["run", str(EXAMPLE.parent / "ship"), "--no-papers", "--out", str(tmp_path)]) == 0
    with open(tmp_path / "ship_corrections.csv") as lines:
        [row] = [
            row
            for row in csv.DictReader(lines)
            if (float(row["trim_m"]), float(row["list_deg"]), float(row["sounding_m"]))
            == (trim, heel, sounding)
        ]
    with open(tmp_path / "capacity.csv") as lines:
        [level] = [row for row in csv.DictReader(lines) if float(row["height_m"]) == sounding]
    found = [-float(row["correction_mm"]), float(row["volume_m3"]), float(row["U_m3"])]
    assert rounded([*found, float(level["volume_m3"])], printed[3:]) == printed[3:]


@pytest.mark.slow
def test_rows_of_a_table_by_its_radii(tmp_path):
    printed = figures_of(
        "docs/partial.md",
        "A row in the middle of the first course of a tank of () m, radii known to () mm, has U = "
        "() m³ of which () m³ are the radii; the row at its joint has () m³, all of it radii",
    )
    result = tankcal.run(tankcal.load(write_folder(tmp_path / "job", radii_parts())))
    joint = float(HEIGHTS_M[0])
    middle, at_joint = result.at(joint / 2), result.at(joint)
    radius, u = RADII_M[0], (0.7**2 + 0.3**2) ** 0.5
    of_radii = middle.k * 2e-3 * math.pi * radius * joint / 2 * u  # U of a cylinder by its radius
    found = [2 * radius, u, middle.U_m3, of_radii, at_joint.U_m3]
    assert rounded(found, printed) == printed
    assert at_joint.U_m3 == pytest.approx(2 * of_radii, rel=0.02)


def volume_of_lying_tank(height_m, radius_m=1.2, length_m=10.0):
    """Closed form of a horizontal cylinder with flat ends, m3."""
    h = np.asarray(height_m)
    chord = np.sqrt(np.maximum(2 * radius_m * h - h**2, 0))
    angle = np.arccos(np.clip(1 - h / radius_m, -1, 1))
    return length_m * (radius_m**2 * angle - (radius_m - h) * chord)


def error_of_interpolation(rows_m):
    """(largest error of straight lines between rows, L; its height, m)."""
    heights = np.linspace(0, 2.4, 240_001)
    lines = np.interp(heights, rows_m, volume_of_lying_tank(rows_m))
    errors = 1000 * np.abs(lines - volume_of_lying_tank(heights))
    return errors.max(), heights[errors.argmax()]


def test_interpolation_in_a_table_of_a_lying_tank():
    printed = figures_of(
        "docs/studies/rings.md",
        "the error is () L with rows of 1 mm, () L with 5 mm, () L with 10 mm, and () L with 50 mm",
    )
    even = [error_of_interpolation(np.linspace(0, 2.4, n + 1))[0] for n in (2400, 480, 240, 48)]
    assert rounded(even, printed) == printed
    printed = figures_of(
        "docs/studies/linter.md",
        "With rows of 1 cm it has an error of () L at () mm, and an equal error below its top. "
        "With rows of 2 mm up to () m and from () m on (() rows in all) the error is below () L",
    )
    largest, height_m = error_of_interpolation(np.linspace(0, 2.4, 241))
    low, high = float(printed[2]), float(printed[3])
    fine = np.unique(np.round([*np.arange(0, low, 0.002), *np.arange(low, high, 0.01),
                               *np.arange(high, 2.4005, 0.002)], 4))  # fmt: skip
    assert rounded([largest, min(height_m, 2.4 - height_m) * 1000], printed[:2]) == printed[:2]
    assert len(fine) == int(printed[4])
    assert error_of_interpolation(fine)[0] < float(printed[5])


def test_rounding_of_a_table_of_a_lying_tank():
    printed = figures_of(
        "docs/table.md",
        "below has () rows, rounded to the litre. The largest error is () L if each row is rounded "
        "separately, and () L if rounded steps are added",
    )
    volumes = 1000 * volume_of_lying_tank(np.linspace(0, 2.4, 241))
    added = np.abs(np.cumsum(np.rint(np.diff(volumes, prepend=0))) - volumes).max()
    found = [len(volumes), np.abs(np.rint(volumes) - volumes).max(), added]
    assert rounded(found, printed) == printed


# ---- closed forms: no run


def figures_as_numbers(page, sentence):
    return [value_of(text) for text in figures_of(page, sentence)]


def test_figures_of_a_tape():
    printed = figures_of(
        "docs/studies/strapping.md",
        "A tape of () N/m (13 mm wide, 0.2 mm thick) at () N over a free span of (), () or () m "
        "reads (), () or () mm too long",
    )
    weight, tension, *spans = map(float, printed[:5])
    sag = [1000 * sag_of(weight, span, tension) for span in spans]
    assert agree(sag, printed[5:])
    off_mm, radius, span, most_um = figures_as_numbers(
        "docs/studies/strapping.md",
        "Beside an obstruction of () mm on R = () m, where the tape is free over () m on each "
        "side, the sag is less than () µm",
    )
    assert span == pytest.approx(math.sqrt(2 * radius * off_mm / 1000), abs=0.05)
    assert 1e6 * sag_of(weight, span, tension) < most_um
    known, of_sag = figures_as_numbers(
        "docs/studies/strapping.md", "a span known to () % gives a sag known to () %"
    )
    assert sag_of(1, 1 + known / 100, 1) / sag_of(1, 1, 1) - 1 == pytest.approx(
        of_sag / 100, rel=0.02
    )
    printed = figures_of("docs/studies/strapping.md", "weighs more than half the tension (() %)")
    assert agree([100 * DEEPEST**2 / 80], printed)
    slope, percent = figures_as_numbers(
        "docs/strapping.md", "(a lean of 1 in () makes a horizontal cut () % larger)"
    )
    assert 100 * (math.hypot(1, 1 / slope) - 1) == pytest.approx(percent, abs=5e-4)


def sag_of(weight_n_per_m, span_m, tension_n):
    return weight_n_per_m**2 * span_m**3 / (24 * tension_n**2)


def test_chance_of_equal_repeats():
    """Two normal readings, rounded: equal if the difference is in the triangle of one step."""
    sd, *parts = figures_as_numbers(
        "docs/studies/strapping.md",
        "Two readings of () mm are equal in () % of cases if written to () mm, and in () % if "
        "written to () mm",
    )
    difference = np.linspace(-10, 10, 2_000_001)
    density = np.exp(-((difference / sd) ** 2) / 4) / (sd * math.sqrt(4 * math.pi))
    for percent, step in zip(parts[::2], parts[1::2], strict=True):
        equal = np.maximum(1 - np.abs(difference) / step, 0)
        found = 100 * np.sum(equal * density) * (difference[1] - difference[0])
        assert found == pytest.approx(percent, abs=0.5 if percent > 10 else 0.05)


def test_area_term_of_declared_shapes():
    printed = figures_of(
        "docs/studies/strapping.md",
        "On R = () m, a shape of () mm reduces the volume by () ppm with a standard uncertainty of "
        "() ppm. A shape of () mm reduces it by () ppm, with () ppm. The scatter of the draws "
        "(() and () ppm)",
    )
    radius, first, *of_first, second, of_mean, of_sd = map(float, printed[:7])
    scatters = map(float, printed[7:])
    for shape, stated, scatter in (
        (first, of_first, next(scatters)),
        (second, (of_mean, of_sd), next(scatters)),
    ):
        mean, sd = (1e6 * value for value in perimeter_excess(shape / 1000, radius))
        assert [mean, sd] == pytest.approx(stated, abs=0.5)
        assert math.sqrt(sd**2 - mean**2) == pytest.approx(scatter, abs=0.5)


def test_figures_of_angles():
    arcsec = math.radians(1 / 3600)
    angle, length, of_radius, ppm, radius = figures_as_numbers(
        "docs/reference-lines.md",
        '()" over () m is () mm, or () ppm of the volume at () m',
    )
    assert 1000 * angle * arcsec * length == pytest.approx(of_radius, abs=0.005)
    assert 2e3 * of_radius / radius == pytest.approx(ppm, abs=1)
    printed = figures_of(
        "docs/reference-lines.md",
        "which is () mm where the centre is off by () mm on R = () m",
    )
    _, off, radius = map(float, printed)
    assert agree([off**2 / (4e3 * radius)], printed[:1])  # the mean over azimuths
    lean, percent = figures_as_numbers(
        "docs/reference-lines.md", "A lean of () % makes a horizontal cut () % larger"
    )
    assert 100 * (math.hypot(1, lean / 100) - 1) == pytest.approx(percent, abs=5e-4)
    printed = figures_of(
        "docs/studies/tangents.md",
        "a sight of () seconds of arc over a tangent of () m contributes () mm to a radius, and "
        "sixteen sights per level () mm",
    )
    angle, length = map(float, printed[:2])
    single = 1000 * angle * arcsec * length
    assert agree([single, single / 4], printed[2:])
    wave, radius, ppm = figures_as_numbers(
        "docs/studies/tangents.md", "A wave of () mm on () m is then () ppm of the volume"
    )
    assert 2e3 * wave / radius == pytest.approx(ppm, abs=0.5)
    angle, ppm = figures_as_numbers(
        "docs/tangents.md", "An error of () degree makes a base () ppm too long"
    )
    assert 1e6 * (1 / math.cos(math.radians(angle)) - 1) == pytest.approx(ppm, abs=5)


def test_widening_of_rings():
    printed = figures_of(
        "docs/studies/rings.md",
        "p R² / (E t). This is () mm for R () m, () bar and () mm, and () mm for R () m, "
        "() bar and () mm (E = 206 GPa)",
    )
    for bulge, *sizes in (printed[:4], printed[4:]):
        radius, bar, plate = map(float, sizes)
        assert agree([1000 * bar * 1e5 * radius**2 / (206e9 * plate / 1000)], [bulge])
    of_upright, factor, radius = figures_as_numbers(
        "docs/studies/rings.md", "(() m), multiplied by sqrt(R / 7.5 m): by () for R () m"
    )
    assert of_upright == UPRIGHT_M
    assert math.sqrt(radius / UPRIGHT_M) == pytest.approx(factor, abs=0.05)


ROW = "| () | () | () | () | () | () |"


def test_volumes_of_three_rings():
    texts = [
        figures_of("docs/rings.md", "| 1.200, 1.192, 1.200 " + ROW),
        figures_of("docs/rings.md", "(inner and outer confused) " + ROW),
        figures_of("docs/rings.md", "| 1.200 throughout " + ROW),
        figures_of("docs/rings.md", "| the first, level " + ROW),
    ]
    radii = [(1.2, 1.192, 1.2), (1.192, 1.2, 1.192), (1.2,) * 3, (1.2, 1.192, 1.2)]
    for printed, radii_m, tilt in zip(texts, radii, (0.01, 0.01, 0.01, 0.0), strict=True):
        tank = RingedTank(radii_m, (3.0,) * 3, tilt=tilt, dip_from_a_m=1.5)
        litres = 1000 * tank.volume_m3([0.0, 0.3, 1.2, 2.2, 2.4])
        assert agree([*litres, 1000 * tank.capacity_m3], printed)
    (capacity,) = figures_as_numbers(
        "docs/rings.md", "an error of tens of litres in a tank of () m³ ([below]"
    )
    assert 10 < value_of(texts[2][2]) - value_of(texts[0][2]) < 100
    assert round(value_of(texts[0][-1]) / 1000, -1) == capacity


def test_volumes_of_strapped_spheres():
    """Ellipsoids of published circles; `tests/geometry/test_great_ellipses.py` has their fit."""
    lengths = figures_as_numbers("docs/spheres.md", "equator (), perpendicular meridians (), ()")
    axes = figures_as_numbers("docs/spheres.md", ": ellipsoid (), (), () |")
    printed = figures_of("docs/spheres.md", ": ellipsoid 10.002506, 10.003652, 10.001074 | () |")
    volume = ball(*axes)
    assert volume == pytest.approx(value_of(printed[0]), abs=1e-3)  # axes to a micrometre
    equator, *meridians = (length / (2 * math.pi) for length in lengths)
    wrong = ball(equator, equator, np.mean(meridians))
    printed = figures_of("docs/spheres.md", "wrongly taken for c | () (() %) |")
    assert agree([wrong, 100 * (wrong / volume - 1)], printed)
    printed = figures_of("docs/spheres.md", "| the equator alone | () (() %) |")
    assert agree([ball(*3 * [equator]), 100 * (ball(*3 * [equator]) / volume - 1)], printed)
    a, c, stated = figures_of("docs/spheres.md", "| a = b = (), c = (): the ellipsoid | () |")
    volume = ball(float(a), float(a), float(c))
    assert agree([volume], [stated])
    meridian = float(ellipse_perimeter(float(a), float(c))) / (2 * math.pi)
    mean = (float(a) + 3 * meridian) / 4
    printed = figures_of("docs/spheres.md", "each with the same weight | () (() %) |")
    assert agree([ball(mean, mean, mean), 100 * (ball(mean, mean, mean) / volume - 1)], printed)
    printed = figures_of("docs/spheres.md", "| its equator alone | () (() %) |")
    equator = ball(*3 * [float(a)])
    assert agree([equator, 100 * (equator / volume - 1)], printed)
    printed = figures_of(
        "docs/studies/spheres.md",
        "An error of () mm on each of three circles is () % of the volume",
    )
    u = math.sqrt(3) * float(printed[0]) / 1000 / lengths[0]
    assert agree([100 * u], printed[1:])


def ball(a, b, c):
    """Volume of an ellipsoid, m3."""
    return 4 / 3 * math.pi * a * b * c


def ellipse_perimeter(a, b):
    """Perimeter of an ellipse by its arc length, m."""
    t = 2 * np.pi * np.arange(4096) / 4096
    return 2 * np.pi * np.mean(np.hypot(a * np.sin(t), b * np.cos(t)))


def test_a_sphere_under_pressure():
    bar, radius, plate, modulus, poisson, strain, percent = figures_as_numbers(
        "docs/spheres.md",
        "() bar, r () m, t () mm, E () GPa, ν () give Δr / r = ()e-4, () % of volume",
    )
    grown = bar * 1e5 * radius * (1 - poisson) / (2 * modulus * 1e9 * plate / 1000)
    assert 1e4 * grown == pytest.approx(strain, abs=0.005)
    assert 100 * ((1 + grown) ** 3 - 1) == pytest.approx(percent, abs=0.0005)
