"""Figures in running text, which no session prints: each is the rounded result of a run."""

import csv
import math
import re
import shutil

import numpy as np
import pytest
from conftest import EXAMPLE, ROOT
from job_builder import write_folder
from radii_jobs import HEIGHTS_M, RADII_M, radii_parts

import tankcal
from tankcal.cli import main

pytestmark = pytest.mark.slow


def figures_of(page, sentence):
    """The numbers of a sentence of a page, as texts; `sentence` has () for each of them."""
    text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
    parts = map(re.escape, sentence.split("()"))
    return re.search(r"(\d+(?:\.\d+)?)".join(parts), text).groups()


def rounded(values, like):
    """The values with as many decimals as the texts `like` have."""
    decimals = [len(text.partition(".")[2]) for text in like]
    return tuple(f"{value:.{n}f}" for value, n in zip(values, decimals, strict=True))


def test_a_point_that_is_kept(tmp_path):
    printed = figures_of(
        "docs/overruling.md",
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
        "docs/rings.md",
        "the error is () L with rows of 1 mm, () L with 5 mm, () L with 10 mm, and () L with 50 mm",
    )
    even = [error_of_interpolation(np.linspace(0, 2.4, n + 1))[0] for n in (2400, 480, 240, 48)]
    assert rounded(even, printed) == printed
    printed = figures_of(
        "docs/table.md",
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


def test_figures_of_closed_forms():
    printed = figures_of(
        "docs/strapping.md",
        "A tape of () N/m (13 mm wide, 0.2 mm thick) at () N over a free span of (), () or () m "
        "reads (), () or () mm too long",
    )
    weight, tension, *spans = map(float, printed[:5])
    sag = [1000 * weight**2 * span**3 / (24 * tension**2) for span in spans]
    assert rounded(sag, printed[5:]) == printed[5:]
    arcsec = math.radians(1 / 3600)
    printed = figures_of(
        "docs/reference-lines.md",
        '()" over () m is () mm, or () ppm of the volume at () m',
    )
    angle, length, of_radius, ppm, radius = map(float, printed)
    assert 1000 * angle * arcsec * length == pytest.approx(of_radius, abs=0.005)
    assert 2e3 * of_radius / radius == pytest.approx(ppm, abs=1)
    printed = figures_of(
        "docs/tangents.md",
        "a sight of () seconds of arc over a tangent of () m contributes () mm to a radius, and "
        "sixteen sights per level () mm",
    )
    angle, length = map(float, printed[:2])
    one = 1000 * angle * arcsec * length
    assert rounded([one, one / 4], printed[2:]) == printed[2:]
    printed = figures_of(
        "docs/rings.md",
        "p R² / (E t). This is () mm for R () m, () bar and () mm, and () mm for R () m, "
        "() bar and () mm (E = 206 GPa)",
    )
    for bulge, *sizes in (printed[:4], printed[4:]):
        radius, bar, plate = map(float, sizes)
        found = 1000 * bar * 1e5 * radius**2 / (206e9 * plate / 1000)
        assert rounded([found], [bulge]) == (bulge,)
