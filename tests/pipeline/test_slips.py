"""A slip of the hand is told by file and key: each one, in every kind of job where it can happen.

The truth of these tests is the property itself: what slipped is known. A slip that moves the volume
by more than its uncertainty must be told; what is plausible must not be.
"""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from job_builder import job_parts, write_folder
from messages_told import lines
from plausible_jobs import plausible_jobs
from shapes import azimuths
from surveyed import known

import tankcal
from tankcal.cli.running import _tell
from tankcal.errors import InputError
from tankcal.job.contract import COLUMNS, KEYS
from tankcal.job.plausibility import CODES, TABLE
from tankcal.pipeline.checks import size as plausibility
from tankcal.pipeline.scanned_solids import fit_scan
from tankcal.record import record_of
from tankcal.report import certificate
from tankcal.report.paper import Paper
from tankcal.survey.diagnosis.diagnoses import check_readings_off, scale_of_control
from tankcal.survey.measurements import Setup
from tankcal.survey.results import Reading, Readings
from tankcal.text.shipped import shipped_folder
from tankcal.text.words import load_words

DOCS = Path(__file__).resolve().parents[2] / "docs"
BOX = np.array([[x, y, z] for x in (0.0, 12.0) for y in (0.0, 5.0) for z in (0.0, 3.0)])
FACES = [
    *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
    *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
]


def box():
    """A barge's tank as an OFF file, 12 x 5 x 3 m."""
    rows = [f"{x} {y} {z}" for x, y, z in BOX] + [f"3 {a} {b} {c}" for a, b, c in FACES]
    return "\n".join(["OFF", f"{len(BOX)} {len(FACES)} 0", *rows, ""])


def ball(scale=(1.0, 1.0, 1.0), radius=10.0):
    """Points of a sphere, its axes to scale."""
    rng = np.random.default_rng(5)
    unit = rng.normal(size=(60, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    xyz = (radius * unit + rng.normal(0, 0.002, unit.shape)) * scale
    return [(f"P{i}", *map(float, one)) for i, one in enumerate(xyz)]


def tube(scale=(1.0, 1.0, 1.0)):
    """Points of a lying cylinder, 2.4 x 10 m along x."""
    azimuth = np.tile(azimuths(20), 6)
    x = np.repeat(np.linspace(0.3, 9.7, 6), 20)
    xyz = np.column_stack([x, 1.2 * np.cos(azimuth), 1.2 * np.sin(azimuth)]) * scale
    return [(f"P{i}", *map(float, one)) for i, one in enumerate(xyz)]


COMMON = {
    "survey.shell_temperature_c": 26.0,
    "checks.air_temperature_c": 22.0,
    "material.expansion_per_k": 1.1e-5,
}
VERTICAL = COMMON | {
    "datum.reference_height_m": 9.8,
    "datum.dip_plate_z_m": 0.01,
    "checks.top_z_m": 9.5,
    "checks.circumference_m": 40.841,
    "checks.diameter_is": "outside",
    "tank.nominal_volume_m3": 1260.0,
    "table.liquid_density_kg_m3": 850.0,
    "material.e_gpa": 206.0,
}
LYING = COMMON | {
    "tank.nominal_diameter_m": 2.4,
    "checks.length_m": 10.0,
    "checks.diameter_is": "outside",
    "horizontal.end_a": "ellipsoidal",
    "horizontal.end_b": "ellipsoidal",
    "horizontal.end_a_depth_m": 0.6,
    "horizontal.end_b_depth_m": 0.6,
    "survey.side": "outside",
    "horizontal.thickness_mm": 6.0,
    "datum.reference_height_m": 2.6,
    "datum.dip_plate_z_m": 0.005,
}
DISHED = {
    key: value for key, value in LYING.items() if "depth" not in key and "nominal" not in key
} | {
    "horizontal.end_a": "torispherical",
    "horizontal.end_b": "torispherical",
    "horizontal.end_a_dish_radius_m": 2.4,
    "horizontal.end_b_dish_radius_m": 2.4,
    "horizontal.end_a_knuckle_radius_m": 0.24,
    "horizontal.end_b_knuckle_radius_m": 0.24,
}
SPHERE = COMMON | {
    "tank.nominal_diameter_m": 20.0,
    "checks.diameter_is": "outside",
    "survey.side": "outside",
    "sphere.thickness_mm": 30.0,
    "datum.reference_height_m": 20.5,
    "datum.dip_plate_z_m": 0.005,
}
SPHERE_POINTS = {
    "sphere.diameter_m": None,
    "tank.nominal_diameter_m": None,
    "datum.dip_plate_z_m": None,
    "datum.reference_height_m": 20.5,
}
TUBE = {
    "horizontal.diameter_m": None,
    "horizontal.azimuth_deg": 90.0,
    "horizontal.dip_from_a_m": 5.0,
    "datum.dip_plate_z_m": None,
}
CONE = {"bottom.form": "cone", "bottom.centre_z_m": -0.2, "checks.bottom_slopes": "down"}
MESH = COMMON | {
    "mesh.file": "tank.off",
    "datum.reference_height_m": 3.1,
    "tank.nominal_volume_m3": 180.0,
}
PLATES = (9.0, 8.0, 7.0, 6.3, 6.3)
HEIGHTS = (2.2, 2.0, 1.9, 1.8, 1.6)


def sound(kind, **more):
    """Parts of a plausible job of a kind; "sphere points", "tube": of a wall that was surveyed."""
    settings = dict(more.pop("settings", {}))
    if kind == "vertical":
        given = {"thickness_mm": PLATES, "courses": HEIGHTS, "noise_mm": 1.0, "rings": 2} | more
        return job_parts(settings=VERTICAL | settings, **given)
    if kind == "mesh":
        parts = job_parts(kind="mesh", settings=MESH | settings, **more)
        parts.beside["tank.off"] = box().encode()
        return parts
    points = more.pop("points", None)
    if kind == "sphere points":
        more["extra_points"] = ball() if points is None else points
        return job_parts(kind="sphere", settings=SPHERE | SPHERE_POINTS | settings, **more)
    if kind == "tube":
        more["extra_points"] = tube() if points is None else points
        return job_parts(kind="horizontal", settings=LYING | TUBE | settings, **more)
    of_kind = {"horizontal": LYING, "dished": DISHED, "sphere": SPHERE}[kind]
    kind = "horizontal" if kind == "dished" else kind
    return job_parts(kind=kind, settings=of_kind | settings, **more)


def told(folder, parts):
    """{code: line} of everything that a job is told, as it is read or computed."""
    try:
        result = tankcal.run(tankcal.load(write_folder(folder, parts)))
    except InputError as error:
        return {getattr(one.expected, "code", None): one for one in error.problems}
    assert lines(result.warnings)
    return {one.expected.code: one for one in result.warnings}


def implausible(found):
    return {code: str(one) for code, one in found.items() if code in CODES}


KINDS = ("vertical", "horizontal", "dished", "sphere", "sphere points", "tube", "mesh")
STEEL = ("vertical", "horizontal", "sphere", "sphere points", "tube", "mesh")
FAHRENHEIT = 26 * 9 / 5 + 32


def settings(**given):
    """{"section.key": value} of section__key = value."""
    return {"settings": {name.replace("__", "."): value for name, value in given.items()}}


OF_ALL = [  # slips that any kind knows: what is changed, the code, file and key
    (settings(survey__shell_temperature_c=FAHRENHEIT), "temperature_strange",
     "survey.shell_temperature_c"),
    (settings(survey__shell_temperature_c=12 * 9 / 5 + 32, checks__air_temperature_c=10.0),
     "temperature_strange", "survey.shell_temperature_c"),
    (settings(survey__shell_temperature_c=8 * 9 / 5 + 32, checks__air_temperature_c=6.0),
     "shell_unlike_air", "survey.shell_temperature_c"),
    (settings(checks__air_temperature_c=71.6), "air_temperature_strange",
     "checks.air_temperature_c"),
    (settings(table__reference_temperature_c=68.0), "temperature_strange",
     "table.reference_temperature_c"),
    (settings(table__reference_temperature_c=59.0), "temperature_strange",
     "table.reference_temperature_c"),
    (settings(material__expansion_per_k=1.1e-6), "constant_strange", "material.expansion_per_k"),
    (settings(material__expansion_per_k=2.3e-5), "constant_strange", "material.expansion_per_k"),
    (settings(material__expansion_per_k=None, checks__shell="aluminium"), "constant_missing",
     "material.expansion_per_k"),
    (settings(survey__date="1024-05-31"), "survey_date_impossible", "survey.date"),
    (settings(survey__date="2924-05-31"), "survey_date_impossible", "survey.date"),
    (settings(certificate__date_of_issue="2924-05-31"), "issue_date_far",
     "certificate.date_of_issue"),
    ({"deadwood": [("heating coil", 0.5, 1.0, 0.02)]}, "deadwood_takes", "volume_m3"),
    ({"deadwood": [("serpentina", 0.5, 1.0, 0.02)]}, "deadwood_takes", "volume_m3"),
    ({"deadwood": [("item 7", 0.5, 1.0, 0.02)]}, "deadwood_sign_unsaid", "volume_m3"),
    ({"deadwood": [("boca de visita", 0.5, 1.0, -0.02)]}, "deadwood_gives", "volume_m3"),
]  # fmt: skip
UP = settings(bottom__form="cone", bottom__centre_z_m=0.2, checks__bottom_slopes="down")
OF_KIND = [
    ("vertical", {"thickness_mm": [10 * one for one in PLATES]}, "plate_thick", "thickness_mm"),
    *(("vertical", {"thickness_mm": [times * one for one in PLATES]}, "plate_thick",
       "thickness_mm") for times in (2, 3)),
    *(("vertical", {"thickness_mm": [one / times for one in PLATES]}, "plate_thin",
       "thickness_mm") for times in (2, 3)),
    ("vertical", {"deadwood": [("coil", 0.5, 1.0, -9.0)]}, "deadwood_large", "volume_m3"),
    ("vertical", {"thickness_mm": [1.2] * 5}, "plate_thin", "thickness_mm"),
    ("vertical", {"thickness_mm": PLATES[::-1]}, "courses_top_down", "thickness_mm"),
    ("vertical", {"paint_mm": 3.0}, "paint_thick", "paint_mm"),
    ("vertical", {"paint_mm": 0.3} | settings(survey__side="inside"), "paint_of_inside",
     "paint_mm"),
    ("vertical", settings(survey__side="inside"), "circumference_off", "checks.circumference_m"),
    ("vertical", settings(survey__side="inside", checks__circumference_m=None), "side_doubtful",
     "checks.diameter_is"),
    *((kind, settings(checks__diameter_is="inside", checks__circumference_m=None), "side_doubtful",
       "checks.diameter_is") for kind in ("vertical", "horizontal", "tube", "sphere")),
    ("tube", settings(checks__diameter_is="inside", horizontal__thickness_mm=16.0),
     "side_doubtful", "checks.diameter_is"),
    ("sphere", settings(checks__diameter_is="middle", sphere__thickness_mm=60.0),
     "inside_unlike_drawing", "checks.diameter_is"),
    ("vertical", settings(bottom__form="cone", bottom__centre_z_m=0.1), "bottom_slopes_unsaid",
     "checks.bottom_slopes"),
    ("vertical", settings(checks__circumference_m=40.841 / 0.3048), "circumference_off",
     "checks.circumference_m"),
    ("vertical", settings(datum__bottom_z_m=0.5, datum__dip_plate_z_m=0.51), "top_not_met",
     "datum.bottom_z_m"),
    ("vertical", settings(datum__dip_plate_z_m=0.51), "dip_plate_far", "datum.dip_plate_z_m"),
    ("vertical", settings(datum__dip_plate_z_m=-0.5), "dip_plate_far", "datum.dip_plate_z_m"),
    ("vertical", UP, "bottom_slopes_otherwise", "bottom.centre_z_m"),
    ("vertical", settings(bottom__form="cone", bottom__centre_z_m=0.4), "bottom_rises_much",
     "bottom.centre_z_m"),
    ("vertical", settings(bottom__form="cone", bottom__centre_z_m=0.1, datum__dip_x_m=0.5,
                          datum__dip_y_m=0.3, datum__dip_plate_z_m=-0.09),
     "dip_plate_off_bottom", "bottom.centre_z_m"),
    ("vertical", {"bottom": [(r * np.sin(a), r * np.cos(a), -0.5) for r in (1.5, 4.0, 6.2)
                             for a in azimuths(8)]}, "rim_off", "z_m"),
    ("vertical", settings(datum__reference_height_m=8.9), "reference_below_top",
     "datum.reference_height_m"),
    ("vertical", settings(datum__reference_height_m=9.8 / 0.3048), "reference_far_above",
     "datum.reference_height_m"),
    ("vertical", {"radius": 6.6}, "points_unlike_drawing", "tank.nominal_diameter_m"),
    ("vertical", settings(material__e_gpa=70.0), "constant_strange", "material.e_gpa"),
    ("vertical", settings(checks__shell="aluminium", material__expansion_per_k=2.3e-5,
                          material__e_gpa=None), "constant_missing", "material.e_gpa"),
    ("vertical", {"roof": {"mass_kg": 900.0, "critical_bottom_m": 1.0, "critical_top_m": 1.3}},
     "roof_mass_strange", "roof.mass_kg"),
    ("vertical", settings(tank__nominal_volume_m3=1400.0), "not_nominal",
     "tank.nominal_volume_m3"),
    ("horizontal", settings(horizontal__thickness_mm=60.0), "solid_plate_thick",
     "horizontal.thickness_mm"),
    ("horizontal", settings(horizontal__thickness_mm=0.6), "solid_plate_tiny",
     "horizontal.thickness_mm"),
    ("horizontal", settings(horizontal__thickness_mm=1.2), "solid_plate_thin",
     "horizontal.thickness_mm"),
    ("tube", settings(horizontal__thickness_mm=60.0), "solid_plate_thick",
     "horizontal.thickness_mm"),
    ("sphere", settings(sphere__thickness_mm=3.0), "solid_plate_thin", "sphere.thickness_mm"),
    ("sphere", settings(sphere__thickness_mm=0.03), "solid_plate_tiny", "sphere.thickness_mm"),
    ("sphere", settings(sphere__diameter_m=8.0, tank__nominal_diameter_m=8.0,
                        sphere__thickness_mm=80.0), "solid_plate_thick",
     "sphere.thickness_mm"),
    ("horizontal", settings(horizontal__diameter_m=1.2), "size_unlike_drawing",
     "horizontal.diameter_m"),
    ("dished", settings(horizontal__diameter_m=1.2, datum__reference_height_m=None),
     "end_radius_strange", "horizontal.end_b_dish_radius_m"),
    ("sphere", settings(sphere__diameter_m=10.0), "size_unlike_drawing", "sphere.diameter_m"),
    ("sphere", settings(sphere__diameter_m=65.6, tank__nominal_diameter_m=None), "sphere_large",
     "sphere.diameter_m"),
    ("horizontal", settings(horizontal__length_m=100.0), "size_unlike_drawing",
     "horizontal.length_m"),
    ("horizontal", settings(horizontal__length_m=100.0, checks__length_m=None),
     "length_impossible", "horizontal.length_m"),
    ("horizontal", settings(horizontal__length_m=10 / 0.3048 * 1.4, checks__length_m=None),
     "length_strange", "horizontal.length_m"),
    ("horizontal", settings(horizontal__end_a_depth_m=1.2), "ends_differ",
     "horizontal.end_a_depth_m"),
    ("horizontal", settings(horizontal__end_a_depth_m=1.2, horizontal__end_b_depth_m=1.2),
     "end_depth_strange", "horizontal.end_b_depth_m"),
    ("dished", settings(horizontal__end_b_dish_radius_m=4.8), "end_radius_strange",
     "horizontal.end_b_dish_radius_m"),
    ("dished", settings(horizontal__end_b_knuckle_radius_m=0.48), "ends_differ",
     "horizontal.end_b_knuckle_radius_m"),
    ("horizontal", settings(datum__dip_plate_z_m=0.2), "dip_plate_far", "datum.dip_plate_z_m"),
    ("sphere", settings(sphere__diameter_m=20.5), "size_unlike_drawing", "sphere.diameter_m"),
    *((kind, settings(datum__dip_plate_z_m=0.5), "dip_plate_far", "datum.dip_plate_z_m")
      for kind in ("horizontal", "dished", "sphere")),
    ("horizontal", settings(datum__reference_height_m=1.9), "reference_below_top",
     "datum.reference_height_m"),
    ("sphere", settings(datum__reference_height_m=19.0), "reference_below_top",
     "datum.reference_height_m"),
    ("mesh", settings(datum__reference_height_m=2.6), "reference_below_top",
     "datum.reference_height_m"),
    ("mesh", settings(mesh__unit="ft"), "not_nominal", "tank.nominal_volume_m3"),
    ("tube", settings(datum__reference_height_m=1.9), "reference_below_top",
     "datum.reference_height_m"),
    ("tube", {"points": tube((1.0, 0.5, 1.0))}, "points_make_no_shape", None),
    ("sphere points", {"points": ball((3.281, 3.281, 3.281))}, "reference_below_top",
     "datum.reference_height_m"),
    ("sphere points", {"points": ball((3.281, 3.281, 3.281))}
     | settings(tank__nominal_diameter_m=20.0), "size_in_other_unit",
     "tank.nominal_diameter_m"),
    ("sphere points", {"points": ball((1.1, 1.1, 1.1))} | settings(tank__nominal_diameter_m=20.0),
     "points_unlike_drawing", "tank.nominal_diameter_m"),
    ("sphere points", {"points": ball((1.0, 1.0, 0.5))}, "points_make_no_shape", None),
    ("sphere points", {"points": ball((1.0, 1.0, 0.98))}, "points_misfit", None),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_plausible_job_has_no_warning(tmp_path, kind):
    assert implausible(told(tmp_path / "job", sound(kind))) == {}


@pytest.mark.slow
def test_plausible_cone_has_no_warning(tmp_path):
    assert implausible(told(tmp_path / "job", sound("vertical", settings=CONE))) == {}


@pytest.mark.slow
def test_random_realistic_jobs_have_no_warning(tmp_path):
    """200 of all kinds and sizes, of three metals, at any temperature that tanks are kept at."""
    alarms = []
    for number, parts in enumerate(plausible_jobs(200)):
        folder = write_folder(tmp_path / f"{number}", parts)
        alarms += [(number, str(one)) for one in tankcal.load(folder).warnings]
    assert alarms == []


@pytest.mark.slow
@pytest.mark.parametrize(("slip", "code", "key"), OF_ALL)
@pytest.mark.parametrize("kind", STEEL)
def test_slips_of_every_kind(tmp_path, kind, slip, code, key):
    assert_told(tmp_path, sound(kind, **slip), code, key)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "slip", "code", "key"), OF_KIND)
def test_a_slip_of_a_kind(tmp_path, kind, slip, code, key):
    assert_told(tmp_path, sound(kind, **slip), code, key)


@pytest.mark.slow
@pytest.mark.parametrize("miss_m", [-0.6, 0.8])
def test_a_bottom_that_leaves_a_ring_beyond_the_shell(tmp_path, miss_m):
    """The rings lie 0.55 m above the bottom and 0.4 m below the top; nothing else tells."""
    parts = sound("vertical", settings={"datum.dip_plate_z_m": None, "checks.top_z_m": None})
    for row in parts.tables["points"][1:]:
        row[3] -= miss_m
    assert_told(tmp_path, parts, "points_off_shell", "datum.bottom_z_m")


def assert_told(tmp_path, parts, code, key):
    found = told(tmp_path / "job", parts)
    assert code in found
    line = found[code]
    assert (line.file in ("job.toml", "points.csv", "courses.csv", "deadwood.csv",
                          "bottom.csv"), line.column) == (
        True, key,
    )  # fmt: skip
    assert "\n" not in str(line)


# ---- where it is told


@pytest.mark.slow
def test_doubtful_input_is_on_first_page_and_last_in_terminal(tmp_path, capsys):
    slip = settings(datum__reference_height_m=8.9, table__language="pt-BR")
    result = tankcal.run(tankcal.load(write_folder(tmp_path / "job", sound("vertical", **slip))))
    _tell(tmp_path / "out", [tmp_path / "record.json"], result.warnings, result, None)
    err = capsys.readouterr().err.splitlines()
    (line,) = err[err.index(next(one for one in err if "DOUBTFUL" in one)) + 1 :]
    assert "datum.reference_height_m" in line
    record = record_of(result)
    kinds = [block.data for block in certificate.doubtful_input(Paper(record))]
    assert [one["kind"] for one in kinds] == ["notice", "paragraph", "list"]
    (told,) = kinds[2]["items"]
    assert "8,9 m, e o topo do tanque" in told
    cells = json.loads(
        (shipped_folder("report_templates") / "certificate.ipynb").read_text("utf-8")
    )
    sources = ["".join(cell["source"]) for cell in cells["cells"]]
    place = next(i for i, text in enumerate(sources) if "doubtful_input" in text)
    assert "blocks.result(" in sources[place - 1]


@pytest.mark.slow
def test_certificate_without_doubts_has_no_doubtful_section(tmp_path):
    result = tankcal.run(tankcal.load(write_folder(tmp_path / "job", sound("sphere"))))
    assert certificate.doubtful_input(Paper(record_of(result))) == []


# ---- a survey


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "within", "without"),
    [
        ("tube", [5.0, 0.2, 0.4], [(5.0, 3.0, 0.0), (-3.0, 0.0, 0.0), (13.0, 0.0, 0.1)]),
        ("sphere points", [3.0, 0.2, -4.0], [(0.0, 14.0, -9.0), (0.0, 0.0, 10.5)]),
    ],
)
def test_places_within_the_wall_of_points(tmp_path, kind, within, without):
    """Off the end of a lying tank is outside of it, on its axis, too."""
    scan = fit_scan(tankcal.load(write_folder(tmp_path / "job", sound(kind))))
    assert scan.is_within(np.array([within, *without])).tolist() == [True, *[False] * len(without)]


def test_a_survey_from_the_other_side_of_a_solid_is_refused(monkeypatch):
    monkeypatch.setattr(plausibility, "stations_of", lambda *_: np.array([[0.0, 0.0, 1.0]]))
    job = SimpleNamespace(survey=SimpleNamespace(side="outside"), measurements=None)
    with pytest.raises(InputError, match=r"survey\.side"):
        plausibility.refuse_other_side(job, lambda places: places[:, 0] < 1, None)
    plausibility.refuse_other_side(job, lambda places: places[:, 0] > 1, None)


def reading(kind, ids, value, residual, check=False):
    """A length with an sd of 1 mm, unit m."""
    nan = float("nan")
    return Reading(
        kind, ids, "", "slope_distances.csv", 7, 1, "m", value, residual, 0.001, 1.0,
        residual / 0.001, nan, nan, nan, check=check,
    )  # fmt: skip


def of_control(factor, readings=(), sd_m=0.0):
    """`scale_of_control` of two held points 20 m apart that were adjusted `factor` apart."""
    table = known(["A", "B"], [[0, 0, 1], [20, 0, 1]], 0.002)
    adjusted = SimpleNamespace(
        survey=SimpleNamespace(points=("A", "B")),
        xyz_m=np.array([[0.0, 0, 1], [20 * factor, 0, 1]]),
        covariance_m2=lambda points: np.diag(3 * [0.0] + 3 * [sd_m**2]),
    )
    setups = (Setup("S1", "A"),)
    measurements = SimpleNamespace(control=table, setups=setups)
    return scale_of_control(adjusted, Readings.of(readings), measurements)


def test_two_control_points_reveal_a_scale_error():
    (line,) = of_control(1.001)
    assert (line.file, line.expected.code) == ("control.csv", "control_scale")
    assert "+1000.0 ppm" in str(line)
    assert "A-B" in str(line)
    (line,) = of_control(1.0, [reading("slope distance", ("S1", "B"), 20.02, -0.02)])
    assert "+999.0 ppm" in str(line)


def test_lengths_within_their_sds_give_no_warning():
    sound = [reading("slope distance", ("S1", "B"), 20.0, -0.003)]
    assert of_control(1.0002, sound) == []
    assert of_control(1.001, sd_m=0.02) == []  # 20 mm: no more than the adjusted point's own sd
    opposite = [reading("slope distance", ("S1", "B"), 20.0, 0.02)]
    assert of_control(1.001, opposite) == []  # no scale: a blunder, which the search tells


def test_check_reading_against_the_scale_is_reported():
    off = reading("distance", ("P1", "P5"), 6.44, 0.0069, check=True)
    close = reading("distance", ("P1", "P5"), 6.44, 0.002, check=True)
    (line,) = check_readings_off(Readings.of([off, close]))
    assert (line.file, line.row, line.expected.code) == (
        "slope_distances.csv", 7, "check_reading_off",
    )  # fmt: skip
    adjusted = reading("distance", ("P1", "P5"), 6.44, 0.0069)
    assert check_readings_off(Readings.of([adjusted])) == []


# ---- the table


def rows_of_docs():
    text = (DOCS / "plausible-values.md").read_text(encoding="utf-8")
    return [
        [cell.strip() for cell in line.strip("| ").split(" | ")]
        for line in text.splitlines()
        if line.startswith("| ") and not line.startswith(("| what", "| ---"))
    ]


def test_the_documentation_shows_the_table():
    unverified = {False: " (not verified)", True: ""}
    expected = [
        [one.what, one.expected + unverified[one.verified], one.slip, one.against or "–"]
        for one in TABLE
    ]
    assert rows_of_docs() == expected


def test_the_table_names_keys_and_columns_that_there_are():
    known = {f"{section}.{field.name}" for section, fields in KEYS.items() for field in fields}
    known |= {f"{table}.{field.name}" for table, fields in COLUMNS.items() for field in fields}
    sections = "|".join([*KEYS, *COLUMNS])
    for one in TABLE:
        named = re.findall(
            rf"\b(?:{sections})\.[a-z]\w+", f"{one.what} {one.expected} {one.against}"
        )
        assert {name for name in named if not name.endswith(("csv", "toml"))} <= known


@pytest.mark.parametrize("language", ["pt-BR", "es"])
def test_plausibility_table_is_translated(language):
    assert set(load_words(language)["warnings"]) >= CODES
