"""The tutorials: each command is run in an empty folder and prints what the page shows."""

import csv
import io
import math
import re
import tomllib
from pathlib import Path

import openpyxl
import pytest
from filled_forms import fill_form, place_of
from page_figures import figures_of, value_of
from page_sessions import FENCE, agrees, blocks_of, commands_of, run_page

import tankcal
from tankcal.cli import main

DOCS = Path(__file__).parents[2] / "docs"
TUTORIALS = {"tutorial-pt-BR.md": "tq-21", "tutorial-es.md": "tk-21"}
SESSIONS = sorted(one.name for one in DOCS.glob("*.md") if "```console" in one.read_text("utf-8"))
FEWEST = dict.fromkeys([*TUTORIALS, "tutorial-strapping.md"], 4)  # commands; 1 of other pages


CHECKS = {
    "tutorial-pt-BR.md": (
        "docs/tutorial-pt-BR.md",
        "são (), (), () e () m. Os quatro cilindros de () m (π r² h) somam () m³; a boca de visita "
        "e o dreno, () m³; a pressão do líquido aumenta o raio de cada anel de ρ g z r² / (E t), "
        "ao todo () m³. São () m³, e a tabela dá () m³ com U = () m³.",
    ),
    "tutorial-es.md": (
        "docs/tutorial-es.md",
        "son (), (), () y () m. Los cuatro cilindros de () m (π r² h) suman () m³; la boca de "
        "hombre y el drenaje, () m³; la presión del líquido aumenta el radio de cada anillo en "
        "ρ g z r² / (E t), en total () m³. Son () m³, y la tabla da () m³ con U = () m³.",
    ),
}


def files_of(page):
    """{name of a file: its last text in the page}."""
    blocks = blocks_of((DOCS / page).read_text(encoding="utf-8"))
    found = {}
    for one in blocks:
        if one.path is not None:
            name = Path(one.path).name
            found[name] = found.get(name, "") + one.text if one.append else one.text
    return found


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.slow
@pytest.mark.parametrize("page", SESSIONS)
def test_commands_print_what_the_page_shows(page, tmp_path):
    done = run_page(DOCS / page, tmp_path)
    told = [one for _, commands in done for one in commands]
    assert len(told) >= FEWEST.get(page, 1)
    for command, expected, printed in told:
        assert agrees(expected, printed), f"{command}\n{printed}"


@pytest.mark.parametrize("page", SESSIONS)
def test_each_file_of_a_session_has_a_name(page):
    """Otherwise the file is not written, and the page shows how a command fails."""
    blocks = blocks_of((DOCS / page).read_text(encoding="utf-8"))
    assert [one.text for one in blocks if one.kind in ("csv", "toml") and not one.path] == []


@pytest.mark.parametrize("page", TUTORIALS)
def test_text_states_the_numbers_of_the_session(page):
    text = (DOCS / page).read_text(encoding="utf-8")
    stated = r"([\d,]+) m³ (?:a 7,200 m,|com|con) U = ([\d,]+) m³"
    (in_text,) = re.findall(stated, FENCE.sub("", text))
    assert {in_text} == set(re.findall(stated, text))


def test_both_tutorials_have_the_same_numbers():
    first, second = map(files_of, TUTORIALS)
    for name in ("courses.csv", "circumferences.csv", "instruments.toml"):
        numbers = [
            re.findall(r"[\d.]+", files[name].split("certificate")[0]) for files in (first, second)
        ]
        assert numbers[0] == numbers[1]
        assert len(numbers[0]) >= 2 or name == "instruments.toml"


@pytest.mark.parametrize("page", TUTORIALS)
def test_volume_is_that_of_a_calculation_by_hand(page):
    """Closed form: circles of the mean readings, the head of the liquid in thin hoops."""
    files = files_of(page)
    job = tomllib.loads(files["job.toml"])
    (tape,) = tomllib.loads(files["instruments.toml"])["instruments"].values()
    steel, warm = 1.1e-5, job["survey"]["shell_temperature_c"] - 20
    depth_m = sum(float(one["height_m"]) for one in rows(files["courses.csv"]))
    volume_m3 = sum(float(one["volume_m3"]) for one in rows(files["deadwood.csv"]))
    for one in rows(files["courses.csv"]):
        read = [
            float(strap["reading_m"])
            for strap in rows(files["circumferences.csv"])
            if strap["course"] == one["course"]
        ]
        length_m = sum(read) / len(read) * (1 + tape["correction"])
        length_m *= 1 + tape["expansion_per_k"] * warm
        outside_m = length_m / (2 * math.pi) - tape["thickness_mm"] / 2000
        inside_m = outside_m / (1 + steel * warm)
        plate_m, height_m = float(one["thickness_mm"]) / 1000, float(one["height_m"])
        inside_m -= plate_m + float(one["paint_mm"]) / 1000
        load_pa = job["table"]["liquid_density_kg_m3"] * 9.80665 * (depth_m - height_m / 2)
        inside_m += load_pa * inside_m**2 / (206e9 * plate_m)
        volume_m3 += math.pi * inside_m**2 * height_m
        depth_m -= height_m
    text = (DOCS / page).read_text(encoding="utf-8")
    told = re.search(r"^T[QK]-21: ([\d,]+) m³ .*U = ([\d,]+) m³", text, re.MULTILINE)
    printed, expanded = (float(one.replace(",", ".")) for one in told.groups())
    assert abs(printed - volume_m3) < 0.1  # the area that a wall out of round has less: 0.03
    assert abs(printed - volume_m3) < expanded


@pytest.mark.parametrize("page", TUTORIALS)
def test_numbers_of_the_check_by_hand_add_up(page):
    *radii, height, cylinders, fittings, head, whole, table, _ = map(
        value_of, figures_of(*CHECKS[page])
    )
    assert abs(sum(math.pi * radius**2 * height for radius in radii) - cylinders) < 1e-3
    assert abs(cylinders + fittings + head - whole) < 1e-3
    assert abs(table - whole) < 0.1  # the table itself: test_text_states_the_numbers_of_the_session


@pytest.mark.slow
def test_the_same_readings_in_the_workbook_give_the_same_table(tmp_path):
    """The walk of coming-from.md as a person does it in Excel."""
    files = files_of("coming-from.md")
    settings = tomllib.loads(files["job.toml"])
    tables = {}
    for name in ("circumferences", "courses"):
        heading, *lines = csv.reader(io.StringIO(files[f"{name}.csv"]), delimiter=";")
        cells = [[one if i == 0 else number(one) for i, one in enumerate(line)] for line in lines]
        tables[name] = [heading, *cells]
    book = tmp_path / "tank-9.xlsx"
    assert main(["new", str(book), "--workbook", "--survey", "strapping"]) == 0
    given = {
        f"{section}.{key}": value
        for section, keys in settings.items()
        for key, value in keys.items()
        if section != "csv"
    }
    fill_form(book, given, tables)
    form = openpyxl.load_workbook(book)
    for key, value in tomllib.loads(files["instruments.toml"])["instruments"]["tape"].items():
        cell = place_of(form["instruments"], f"NAME.{key}")
        cell.value = value
    form.save(book)
    result = tankcal.run(tankcal.load(book), simulated=False)
    text = (DOCS / "coming-from.md").read_text(encoding="utf-8")
    told = re.search(r"^TANK-9: ([\d.]+) m3 at 3.600 m, U = ([\d.]+) m3", text, re.MULTILINE)
    assert f"{result.table.volume_m3[-1]:.3f}" == told[1]
    assert abs(result.intervals.U_m3[-1] - float(told[2])) < 6e-4


def number(text):
    return float(text.replace(",", "."))


def test_dots_stand_for_anything():
    assert agrees("a ... c\n", "a b b c\n")
    assert not agrees("a ... c\n", "a b b d\n")
    assert not agrees("a (b)\n", "a b\n")


def test_blocks_of_a_page():
    file = "Em **`x/a.csv`**:\n\n```csv\n1\n```\n\nNo fim de **`x/a.csv`**:\n\n```csv\n2\n```\n\n"
    page = f"{file}```console\n$ ls x\na.csv\n$ true\n```\n"
    first, second, third = blocks_of(page)
    assert (first.path, first.append, first.text) == ("x/a.csv", False, "1\n")
    assert (second.path, second.append, second.text) == ("x/a.csv", True, "2\n")
    assert third.path is None
    assert commands_of(third.text) == [("ls x", "a.csv\n"), ("true", "")]
