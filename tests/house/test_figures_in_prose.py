"""Figures in running text, which no session prints: each is the rounded result of a run."""

import csv
import math
import re
import shutil

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
