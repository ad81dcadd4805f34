"""`tankcal standard`: each volume is that of a ticket, and of a plain second implementation."""

import csv
from dataclasses import replace

import numpy as np
import openpyxl
import plain_quantity
import pypdf
import pytest
from calculated_tanks import afloat
from quantity_cases import ticket_of

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.products.quantity.standard_table import compute_standard_table, list_dips
from tankcal.products.quantity.table import TankTable, read_table
from tankcal.tank.volume_correction.petroleum import Petroleum
from tankcal.text.shipped import LANGUAGES

TOML = '[product]\ncorrection = "D1250-04"\ngroup = "products"\nbase = "20C"\n'
DENSITIES, TEMPERATURES = [742.5, 835.2], [12.0, 20.0, 31.5]
M3_PER_M, A = 131.0, 1.116e-5


def cylinder():
    """Table of a cylinder of 131 m3 per metre, with errors of its scale and of its bottom."""
    height = np.linspace(0.0, 12.0, 121)
    factor = np.column_stack([M3_PER_M * height * 3e-4, np.full(len(height), 0.05)])
    return TankTable("TK-1", "vertical", height, M3_PER_M * height, factor,
                     np.full(len(height), np.inf), 1e-3, 20.0, A)  # fmt: skip


@pytest.fixture
def settings(tmp_path):
    path = tmp_path / "product.toml"
    path.write_text(TOML, encoding="utf-8")
    return path


@pytest.mark.parametrize("air_c", [None, 5.0])
def test_volumes_are_those_of_the_closed_form(settings, air_c):
    """Plain equations: V(h) (1 + a dT)^2 VCF, and U by the propagation of four inputs."""
    standard = compute_standard_table(cylinder(), settings, TEMPERATURES, DENSITIES, 50, air_c)
    assert standard.dip_m.tolist() == [0.5 * step for step in range(25)]
    for i, density in enumerate(DENSITIES):
        for j, celsius in enumerate(TEMPERATURES):
            vcf = plain_quantity.vcf("products", 20.0, density, celsius)
            shell = celsius if air_c is None else (7 * celsius + air_c) / 8
            stretch = 1 + A * (shell - 20.0)
            observed = M3_PER_M * standard.dip_m * stretch**2
            expected = observed * vcf
            np.testing.assert_allclose(standard.volume_m3[i, j], expected, rtol=2e-9, atol=1e-12)
            distance = abs(celsius - 20.0)
            u_vcf = 0.05 / 22.2 * distance / 100 / 1.96  # below 22.2 K
            parts = (
                3e-4 * expected,
                0.05 * stretch**2 * vcf * np.ones(len(expected)),
                1e-3 / np.sqrt(3) * stretch**2 * vcf * np.ones(len(expected)),
                u_vcf * expected,
                2 * (shell - 20.0) / stretch * 1e-6 * expected,
            )
            u = np.sqrt(sum(np.square(part) for part in parts))
            np.testing.assert_allclose(standard.U_m3[i, j], 1.959964 * u, rtol=2e-6)


@pytest.mark.slow
def test_each_cell_is_the_ticket_of_its_readings(settings, example_record, tmp_path):
    table = read_table(example_record)
    standard = compute_standard_table(table, settings, TEMPERATURES, DENSITIES, 70, 9.0)
    exact = dict.fromkeys(("u_dip_mm", "u_tape_ppm", "u_temperature_k", "u_thermometer_k",
                           "u_ambient_k", "u_density_kg_m3"), 0.0)  # fmt: skip
    for i, j, row in ((0, 0, 3), (1, 2, 11), (0, 2, 7)):
        ticket = ticket_of({
            "product": {"correction": "D1250-04", "group": "products", "base": "20C",
                        "density_kg_m3": DENSITIES[i], "density_is": "base"},
            "closing": {"dip_m": standard.dip_m[row].item(), "temperature_c": TEMPERATURES[j],
                        "ambient_c": 9.0},
            "uncertainty": exact,
        }, tmp_path, table)  # fmt: skip
        result = ticket.quantities["closing"]
        assert standard.volume_m3[i, j, row] == pytest.approx(result.value[0, 2], rel=1e-13)
        assert standard.U_m3[i, j, row] == pytest.approx(result.U[0, 2], rel=1e-12)
        assert standard.k[i, j, row] == pytest.approx(result.k[0, 2], rel=1e-12)


@pytest.mark.slow
def test_a_roof_has_no_volumes_below_the_level_at_which_it_floats(settings, tmp_path):
    afloat(tmp_path)
    table = read_table(tmp_path / "record.json")
    standard = compute_standard_table(table, settings, [30.0], [760.0], 10)
    is_blank = np.isnan(standard.volume_m3[0, 0])
    assert is_blank.tolist() == [dip < 1.3 for dip in standard.dip_m]
    # A lighter liquid than that of the table: the roof displaces more.
    observed = 760.0 * Petroleum(2004, "products", "20C").factor(760.0, 30.0)
    fra = 9000.0 * (1 - 1.2 / 8000) * (1 / (850.0 - 1.2) - 1 / (observed - 1.2))
    shell = (1 + table.expansion_per_k * (30.0 - table.temperature_c)) ** 2
    expected = (table.volume(np.array([5.0]))[0] * shell + fra) * standard.vcf[0, 0]
    row = standard.dip_m.tolist().index(5.0)
    assert standard.volume_m3[0, 0, row] == pytest.approx(expected, rel=1e-12)


def test_dips_are_whole_steps_within_the_table():
    table = replace(cylinder(), height_m=np.linspace(0.137, 1.21, 5))
    assert list_dips(table, 10).tolist() == [step / 10 for step in range(2, 13)]
    assert list_dips(table, 7).tolist() == [7 * step / 100 for step in range(2, 18)]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("suffix", ["csv", "xlsx", "pdf"])
@pytest.mark.parametrize("language", LANGUAGES)
def test_the_files_contain_the_volumes(
    settings, example_record, tmp_path, suffix, language, capsys
):
    out = tmp_path / f"out.{suffix}"
    command = ["standard", str(example_record), str(settings), "--temperatures", "15", "30.5",
               "--densities", "800", "850.5", "--step-cm", "100", "--language", language,
               "--out", str(out)]  # fmt: skip
    assert main(command) == 0
    capsys.readouterr()
    standard = compute_standard_table(
        read_table(example_record), settings, [15.0, 30.5], [800.0, 850.5], 100
    )
    volumes = standard.volume_m3.ravel()
    if suffix == "csv":
        with out.open(encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        assert [float(row["gsv_m3"]) for row in rows] == volumes.tolist()
        assert [float(row["U_gsv_m3"]) for row in rows] == standard.U_m3.ravel().tolist()
        assert (rows[-1]["temperature_c"], rows[-1]["density_kg_m3"]) == ("30.5", "850.5")
    elif suffix == "xlsx":
        (sheet,) = openpyxl.load_workbook(out).worksheets
        cells = [cell.value for row in sheet for cell in row if isinstance(cell.value, float)]
        written = {f"{value:.12g}" for value in (*cells, 0.0)}
        assert {f"{volume:.12g}" for volume in volumes} <= written
        assert sheet.protection.sheet
    else:
        text = "".join(page.extract_text() for page in pypdf.PdfReader(out).pages)
        digits = "".join(sign for sign in text if sign.isdigit())
        for volume in volumes:
            assert f"{volume:.3f}".replace(".", "") in digits
        assert f"{standard.vcf[1, 1]:.5f}"[2:] in text


@pytest.mark.slow
def test_problems_name_the_option_or_the_file(settings, example_record, tmp_path, capsys):
    table = read_table(example_record)

    def problems(temperatures, densities, step_cm=10):
        with pytest.raises(InputError) as refused:
            compute_standard_table(table, settings, temperatures, densities, step_cm)
        return [(problem.file, problem.column) for problem in refused.value.problems]

    assert problems([15.0, 155.0], [840.0, 2000.0]) == [
        ("--temperatures", None), ("--densities", None)]  # fmt: skip
    assert problems([15.0], [300.0]) == [("--densities", None)]
    rows = [700.0 + step for step in range(300)]
    assert problems([15.0, 16.0], rows, 2) == [("--step-cm", None)]
    settings.write_text(TOML.replace("base", "bse"), encoding="utf-8")
    assert problems([15.0], [840.0]) == [("product.toml", "product.bse")]
    settings.write_text(TOML.replace('base = "20C"\n', ""), encoding="utf-8")
    assert problems([15.0], [840.0]) == [("product.toml", "product.base")]
    settings.write_text(TOML, encoding="utf-8")
    command = ["standard", str(example_record), str(settings), "--language", "en"]
    for options, expected in (
        (["--temperatures", "20", "15", "--densities", "840"], "ascending order"),
        (["--temperatures", "15", "--densities", "840", "--out", str(tmp_path / "a.doc")], ".pdf"),
        (["--temperatures", *map(str, range(10, 20)), "--densities", "840",
          "--out", str(tmp_path / "a.pdf")], "at most 9"),
    ):  # fmt: skip
        assert main([*command, *options]) == 2
        assert expected in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["product.toml"]
