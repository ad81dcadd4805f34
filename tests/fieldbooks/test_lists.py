"""`tankcal import` of a technician's own list. The truth is the job whose points the list has."""

import json
import shlex
import sys

import pytest
from job_builder import assert_same_job, job_parts, write_folder

from tankcal.cli import main
from tankcal.errors import InputError
from tankcal.job import load
from tankcal.job.contract import columns_of
from tankcal.job.headings import meanings_of

HEADINGS = {
    "pt-BR": ("Ponto", "Este (m)", "Norte (m)", "Cota (m)"),
    "es": ("Punto", "Coord. X", "Coord. Y", "Altura"),
    "en": ("Point ID", "Easting [m]", "Northing [m]", "Elevation [m]"),
}


@pytest.fixture
def job(tmp_path):
    """(a job, its folder without points but with the empty table of a form)."""
    folder = write_folder(tmp_path / "job", job_parts())
    known = load(write_folder(tmp_path / "known", job_parts()))
    (folder / "points.csv").write_text("# points\npoint,x_m,y_m,z_m\n")
    return known, folder


def list_of(known, path, headings, separator=";", decimal=",", encoding="utf-8", scale=1):
    rows = [
        [name, *(f"{scale * x:.9f}".replace(".", decimal) for x in xyz), "wall"]
        for name, xyz in zip(known.points.names, known.points.xyz_m, strict=True)
    ]
    lines = [separator.join(row) for row in ([*headings, "Código"], *rows)]
    path.write_bytes("\r\n".join(lines).encode(encoding))
    return path


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "cp1252"])
@pytest.mark.parametrize("language", [*HEADINGS])
def test_a_list_becomes_the_points_of_the_job(job, tmp_path, capsys, language, encoding):
    known, folder = job
    path = list_of(known, tmp_path / "lista.csv", HEADINGS[language], encoding=encoding)
    assert main(["import", str(path), "--out", str(folder)]) == 0
    printed = capsys.readouterr()
    for heading, column in zip(HEADINGS[language], ("point", "x_m", "y_m", "z_m"), strict=True):
        assert f"  {heading} = {column}\n" in printed.out
    assert "  Código: not used\n" in printed.out
    assert ("Windows-1252" in printed.err) == (encoding == "cp1252")
    found = load(folder)
    assert found.points.names == known.points.names
    assert found.points.xyz_m == pytest.approx(known.points.xyz_m, abs=1e-9)
    assert (folder / "points.csv").read_text(encoding="utf-8").startswith("# points\n")


def test_a_list_in_millimetres_is_converted(job, tmp_path):
    known, folder = job
    headings = ("Ponto", "X (mm)", "Y (mm)", "Z (mm)")
    path = list_of(known, tmp_path / "lista.csv", headings, scale=1000)
    assert main(["import", str(path), "--out", str(folder)]) == 0
    assert load(folder).points.xyz_m == pytest.approx(known.points.xyz_m, abs=1e-9)


def test_headings_of_the_user_are_remembered(job, tmp_path, capsys):
    known, folder = job
    path = list_of(
        known, tmp_path / "lista.csv", ("Ponto", "A (mm)", "B (mm)", "Cota (mm)"), scale=1000
    )
    out = ["--out", str(folder)]
    assert main(["import", str(path), "--table", "points", *out]) == 2
    said = capsys.readouterr().err.splitlines()
    assert ["no heading for" in one for one in said] == [True, True]
    assert "expected --column 'HEADING=x_m'" in said[0]
    assert not (folder / "headings.toml").exists()
    named = ["--column", "A (mm)=x_m", "--column", "B (mm)=y_m"]
    assert main(["import", str(path), *named, *out]) == 0
    first = load(folder).points.xyz_m
    assert first == pytest.approx(known.points.xyz_m, abs=1e-9)
    assert main(["import", str(path), *out, "--replace"]) == 0  # without --column
    assert (load(folder).points.xyz_m == first).all()


def test_a_number_with_two_meanings_is_refused(job, tmp_path, capsys):
    _, folder = job
    path = tmp_path / "lista.csv"
    path.write_text("Ponto;X;Y;Z\nP1;1,234;2,345;3,456\nP2;4,234;2,345;3,456\n")
    before = {one.name: one.read_bytes() for one in folder.iterdir()}
    assert main(["import", str(path), "--out", str(folder)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "lista.csv, row 2, x_m: found '1,234', which is 1.234 or 1234" in line
    assert {one.name: one.read_bytes() for one in folder.iterdir()} == before


@pytest.mark.parametrize("answer", ["", "n"])
def test_a_terminal_is_asked(job, tmp_path, monkeypatch, capsys, answer):
    known, folder = job
    path = list_of(known, tmp_path / "lista.csv", ("Ponto", "A", "Y", "Z"))
    answers = iter(["1", answer])  # A is x_m; write it?
    monkeypatch.setattr("builtins.input", lambda prompt: next(answers))
    for stream in (sys.stdin, sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: True)
    status = main(["import", str(path), "--out", str(folder)])
    assert status == (2 if answer else 0)
    assert (folder / "headings.toml").exists() == (not answer)


def test_another_table_and_json(job, tmp_path, capsys):
    known, folder = job
    (folder / "courses.csv").unlink()
    path = tmp_path / "virolas.txt"
    rows = [f"{one.name}\t{one.height_m:.3f}\t{8:.1f}" for one in known.courses]
    path.write_text("\n".join(["Virola\tAltura (m)\tEspesor (mm)", *rows]).replace(".", ","))
    arguments = ["import", str(path), "--table", "courses", "--out", str(folder), "--json"]
    assert main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["files"] == [str(folder / "courses.csv")]
    main(["import", str(list_of(known, tmp_path / "p.csv", HEADINGS["en"])), "--out", str(folder)])
    assert [one.height_m for one in load(folder).courses] == [1.9] * 5


def test_a_job_in_a_workbook_gets_no_files_beside_it(tmp_path, capsys):
    folder = tmp_path / "job"
    assert main(["new", str(folder), "--workbook"]) == 0
    path = tmp_path / "lista.csv"
    path.write_text("Ponto;X;Y;Z\nP1;1,2;2,3;3,4\n")
    capsys.readouterr()
    assert main(["import", str(path), "--out", str(folder)]) == 2
    assert "contains the workbook job.xlsx" in capsys.readouterr().err
    assert [one.name for one in folder.iterdir()] == ["job.xlsx"]


# ---- headings of files in the folder itself


@pytest.mark.slow(after=2)
@pytest.mark.parametrize("language", [*HEADINGS])
def test_foreign_headings_in_the_folder_are_read_and_told(job, language):
    _, folder = job
    rows = (folder.parent / "known" / "points.csv").read_text().splitlines()[1:]
    (folder / "points.csv").write_text("\n".join([",".join(HEADINGS[language]), *rows]) + "\n")
    found = load(folder)
    [warning] = found.warnings
    assert f"{HEADINGS[language][0]} = point" in str(warning)
    (folder / "points.csv").write_text("\n".join(["point,x_m,y_m,z_m", *rows]) + "\n")
    assert_same_job(load(folder), found)


def test_a_heading_in_another_unit_is_refused(job):
    _, folder = job
    (folder / "points.csv").write_text("Ponto;X (mm);Y (mm);Z (mm)\nP1;1200;2300;3400\n")
    with pytest.raises(InputError) as refused:
        load(folder)
    said = [str(one) for one in refused.value.problems if "X (mm)" in str(one)]
    assert ["is x_m in mm" in one for one in said] == [True]


@pytest.mark.slow(after=2)
@pytest.mark.parametrize(
    ("table", "heading", "column"),
    [
        ("courses", "Espessura (mm)", "thickness_mm"),
        ("circumferences", "Lectura", "reading_m"),
        ("wall_hits", "Dirección (gon)", "direction_gon"),
        ("wall_hits", "Direction (deg)", "direction_deg"),
        ("wall_hits", "Dirección", None),  # in which unit?
        ("points", "X_M", "x_m"),
        ("points", "Desvio padrão x (mm)", "sx_mm"),
        ("points", "Desviación estándar Z (mm)", "sz_mm"),
        ("points", "Std dev y (mm)", "sy_mm"),
        ("points", "Desvio (mm)", None),  # of which coordinate?
        ("points", "Diâmetro", None),
        ("points", "Vértice", "point"),
        ("points", "N° do ponto", "point"),
        ("points", "Nº de punto", "point"),
        ("points", "Coord. Este (m)", "x_m"),
        ("points", "Coordenada Norte", "y_m"),
    ],
)
def test_headings_mean_columns(table, heading, column):
    found = meanings_of([heading], columns_of(table, "vertical"))
    assert (found[heading].column if found else None) == column


def test_two_headings_of_one_column_are_not_chosen_between():
    assert meanings_of(["Este", "X"], columns_of("points", "vertical")) == {}


@pytest.mark.parametrize(
    ("options", "place"),
    [(["--table", "nothing"], "--table"), (["--column", "without a mark"], "--column")],
)
def test_bad_options_are_refused_in_one_line(tmp_path, capsys, options, place):
    """A traceback before: such options were refused as if argparse were still reading them."""
    source = tmp_path / "list.csv"
    source.write_text("point,x_m,y_m,z_m\nP1,1,2,3\n", encoding="utf-8")
    assert main(["import", str(source), "--out", str(tmp_path), *options]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert place in lines[0]


def test_import_outside_a_job_needs_a_folder(tmp_path, capsys, monkeypatch):
    source = tmp_path / "list.csv"
    source.write_text("point,x_m,y_m,z_m\nP1,1,2,3\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert main(["import", str(source)]) == 2
    assert f"tankcal import {source} --out DIR" in capsys.readouterr().err


def test_an_import_without_a_job_prints_the_command_to_repeat(tmp_path, capsys, monkeypatch):
    source = tmp_path / "my list.csv"
    source.write_text("point,x_m,y_m,z_m\nP1,1,2,3\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert main(["import", source.name, "--out", "T 1", "--table", "points"]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    new, again = (
        shlex.split(line) for line in lines if line.startswith(("tankcal new", "tankcal import"))
    )
    assert again == ["tankcal", "import", source.name, "--table", "points", "--out", new[2]]
    assert main(new[1:]) == 0
    assert main(again[1:]) == 0
