"""Vectors, and values that are correlated, from a job's files to the adjusted points.

Second method: a dense adjustment with the full covariance, in numpy, of the numbers in the files.
"""

import numpy as np
import pytest

import tankcal
from tankcal.errors import InputError
from tankcal.survey import adjust_survey

PLACES = {
    "A": (402.35, -4652995.3, 4349760.78),
    "B": (8086.03, -4642712.85, 4360439.08),
    "C": (12046.58, -4649394.08, 4353160.06),
    "D": (-3081.58, -4643107.37, 4359531.12),
}
LINES = ["AC", "BC", "BD", "DC", "AD"]
SDS_MM = np.array([14.0, 9.0, 11.0])
R = np.array([[1.0, -0.6, 0.4], [-0.6, 1.0, -0.5], [0.4, -0.5, 1.0]])
SHARED = 0.3  # correlation of dx of the first two vectors, of one session
CONTROL_R = 0.8  # of x of A and x of B


def written(folder, *, correlated=True, control_sd_mm=5.0, change=lambda files: None):
    """A job of five vectors and two control points; and its observed values."""
    rng = np.random.default_rng(3)
    vectors = [
        np.subtract(PLACES[b], PLACES[a]) + 1e-3 * SDS_MM * rng.normal(size=3) for a, b in LINES
    ]
    files = {
        "job.toml": '[adjustment]\ndatum = "control"\n',
        "control.csv": "point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm\n"
        + "".join(
            f"{name},{','.join(map(str, PLACES[name]))},{','.join(3 * [str(control_sd_mm)])}\n"
            for name in "AB"
        ),
        "vectors.csv": "from,to,dx_m,dy_m,dz_m,sx_mm,sy_mm,sz_mm,r_xy,r_xz,r_yz\n"
        + "".join(
            f"{a},{b},{','.join(f'{v:.6f}' for v in vector)},14,9,11,-0.6,0.4,-0.5\n"
            for (a, b), vector in zip(LINES, vectors, strict=True)
        ),
    }
    if correlated:
        files["correlated_readings.csv"] = (
            "table_1,row_1,value_1,table_2,row_2,value_2,r\n"
            f"vectors,2,x,vectors,3,x,{SHARED}\ncontrol,2,x,control,3,x,{CONTROL_R}\n"
        )
    change(files)
    for name, text in files.items():
        (folder / name).write_text(text)
    return np.round(vectors, 6)


def measured(folder):
    return tankcal.load(folder, only="adjustment").measurements


def dense(vectors, *, correlated, control_sd_mm=5.0):
    """Coordinates (4, 3) of A to D and their covariance (12, 12)."""
    names = list(PLACES)
    a, observed = np.zeros((21, 12)), np.concatenate([vectors.ravel(), PLACES["A"], PLACES["B"]])
    q = np.zeros((21, 21))
    for i, (start, end) in enumerate(LINES):
        rows = slice(3 * i, 3 * i + 3)
        a[rows, 3 * names.index(end) : 3 * names.index(end) + 3] = np.eye(3)
        a[rows, 3 * names.index(start) : 3 * names.index(start) + 3] = -np.eye(3)
        q[rows, rows] = 1e-6 * R * np.outer(SDS_MM, SDS_MM)
    a[15:, :6] = np.eye(6)
    q[15:, 15:] = 1e-6 * control_sd_mm**2 * np.eye(6)
    if correlated:
        q[0, 3] = q[3, 0] = 1e-6 * SHARED * SDS_MM[0] ** 2
        q[15, 18] = q[18, 15] = 1e-6 * CONTROL_R * control_sd_mm**2
    p = np.linalg.inv(q)
    cofactors = np.linalg.inv(a.T @ p @ a)
    middle = np.tile(PLACES["A"], 4)
    x = middle + cofactors @ a.T @ p @ (observed - a @ middle)
    v = a @ x - observed
    return x.reshape(4, 3), cofactors, v @ p @ v


@pytest.mark.parametrize("correlated", [True, False])
def test_vectors_of_a_job(tmp_path, correlated):
    vectors = written(tmp_path, correlated=correlated)
    adjustment = adjust_survey(measured(tmp_path))
    xyz, cofactors, chi2 = dense(vectors, correlated=correlated)
    order = [adjustment.names.index(name) for name in PLACES]
    np.testing.assert_allclose(adjustment.xyz_m[order], xyz, rtol=0, atol=2e-8)
    for i, place in enumerate(order):
        mine = slice(3 * i, 3 * i + 3)
        found = adjustment.covariance_m2[place]
        np.testing.assert_allclose(found, cofactors[mine, mine], rtol=1e-6, atol=1e-13)
    assert adjustment.redundancy == 9
    assert adjustment.sigma0**2 * 9 == pytest.approx(chi2, rel=1e-6)
    square = sum(one.factor**2 * one.redundancy for one in adjustment.groups)
    assert square == pytest.approx(chi2, rel=1e-6)
    assert sum(one.redundancy for one in adjustment.readings) == pytest.approx(9, abs=1e-9)


@pytest.mark.slow
def test_a_wrong_vector_is_found_whole(tmp_path):
    """A blunder of 0.3 m in one component: that vector goes, as a whole, and no other."""

    def spoil(files):
        rows = files["vectors.csv"].splitlines()
        cells = rows[3].split(",")
        cells[2] = f"{float(cells[2]) + 0.3:.6f}"
        files["vectors.csv"] = "\n".join([*rows[:3], ",".join(cells), *rows[4:]]) + "\n"

    written(tmp_path, change=spoil)
    removed = adjust_survey(measured(tmp_path)).removed
    assert {(one.file, one.row) for one in removed} == {("vectors.csv", 4)}


@pytest.mark.slow
def test_blunders_with_correlated_readings(tmp_path):
    """A distance fifty times too long goes; correlated ones of its table stay themselves."""
    length = {one: np.linalg.norm(np.subtract(PLACES[one[1]], PLACES[one[0]])) for one in LINES}

    def with_distances(files):
        rows = [f"A,C,{50 * length['AC']:.4f},10", *(
            f"{a},{b},{length[a + b]:.4f},10" for a, b in ("BC", "BD", "DC", "AD"))]  # fmt: skip
        files["distances.csv"] = "\n".join(["from,to,distance_m,s_mm", *rows]) + "\n"
        files["correlated_readings.csv"] += "distances,3,,distances,4,,0.9\n"

    written(tmp_path, change=with_distances)
    adjustment = adjust_survey(measured(tmp_path))
    assert {(one.file, one.row) for one in adjustment.removed} == {("distances.csv", 2)}
    values = {one.row: one.value for one in adjustment.readings if one.file == "distances.csv"}
    assert values[3] == pytest.approx(length["BC"], abs=1e-4)
    assert values[4] == pytest.approx(length["BD"], abs=1e-4)


@pytest.mark.parametrize("datum", ["minimal", "inner"])
@pytest.mark.parametrize("control_sd_mm", [0.0, 5.0])
def test_a_datum_that_holds_no_distance_denies_no_control(tmp_path, datum, control_sd_mm):
    """The distance of two given points differs from the adjusted one by the vectors' own noise."""

    def change(files):
        files["job.toml"] = files["job.toml"].replace('"control"', f'"{datum}"')

    written(tmp_path, correlated=False, control_sd_mm=control_sd_mm, change=change)
    told = {one.expected.code for one in adjust_survey(measured(tmp_path)).warnings}
    assert "control_scale" not in told


def test_vectors_alone_hang_on_one_point(tmp_path):
    """Without redundancy and with one fixed point: its coordinates and the vectors, added."""

    def fewer(files):
        files["vectors.csv"] = "".join(
            line + "\n" for line in files["vectors.csv"].splitlines()[:1] + [
                one for one in files["vectors.csv"].splitlines() if one.startswith(("A,C", "D,C"))]
        )  # fmt: skip
        files["control.csv"] = "\n".join(files["control.csv"].splitlines()[:2]) + "\n"

    vectors = written(tmp_path, correlated=False, control_sd_mm=0.0, change=fewer)
    adjustment = adjust_survey(measured(tmp_path))
    c = np.array(PLACES["A"]) + vectors[0]
    np.testing.assert_allclose(adjustment.xyz_m[adjustment.names.index("C")], c, atol=1e-8)
    d = c - vectors[3]
    np.testing.assert_allclose(adjustment.xyz_m[adjustment.names.index("D")], d, atol=1e-8)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("vectors,9,x,vectors,3,x,0.3", "row 2, row_1: found 9, and vectors has no such row"),
        ("vectors,2,,vectors,3,x,0.3", "row 2, value_1: expected x, y or z"),
        ("distances,2,,vectors,3,x,0.3", "row_1: found 2, and distances has no such row"),
        ("vectors,3,x,vectors,3,x,0.3", "a value is correlated with itself"),
        ("levels,3,x,vectors,3,x,0.3", "row 2, table_1"),
        ("vectors,2,x,vectors,3,x,1.3", "row 2, r: found '1.3'; expected a number from -1 to 1"),
    ],
)
def test_impossible_correlated_pairs(tmp_path, line, expected):
    heading = "table_1,row_1,value_1,table_2,row_2,value_2,r\n"
    written(
        tmp_path, change=lambda files: files.update({"correlated_readings.csv": heading + line})
    )
    with pytest.raises(InputError) as error:
        measured(tmp_path)
    assert expected in str(error.value)


def test_correlations_that_no_covariance_has(tmp_path):
    def impossible(files):
        files["vectors.csv"] = files["vectors.csv"].replace("-0.6,0.4,-0.5", "0.9,0.9,-0.9")

    written(tmp_path, correlated=False, change=impossible)
    with pytest.raises(InputError, match="not possible together"):
        adjust_survey(measured(tmp_path))


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        ("5,5,5,site", "row_1: row 2 of control is in the system site; expected one in the system"),
        ("0,5,5,", "value_1: x in row 2 of control has no standard deviation above 0"),
        (",5,5,", "value_1: x in row 2 of control has no standard deviation above 0"),
    ],
)
def test_control_that_has_no_correlations(tmp_path, cells, expected):
    """Once these were left out without a word."""

    def change(files):
        heading, first, *rest = files["control.csv"].splitlines()
        first = ",".join(first.split(",")[:4]) + "," + cells
        rows = [f"{heading},system", first, *(f"{row}," for row in rest)]
        files["control.csv"] = "\n".join(rows) + "\n"
        files["correlated_readings.csv"] = (
            "table_1,row_1,value_1,table_2,row_2,value_2,r\ncontrol,2,x,control,3,x,0.8\n"
        )

    written(tmp_path, change=change)
    with pytest.raises(InputError) as error:
        measured(tmp_path)
    assert expected in str(error.value)
