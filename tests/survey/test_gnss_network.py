"""A published GNSS network: 13 vectors with their covariance, two fixed and four new stations.

Source: C. D. Ghilani, Adjustment Computations: Spatial Data Analysis, 5th edition, Wiley 2010,
section 17.6; its vectors and their adjustment as carried by the tests of GNU Gama (gama-g3,
tests/compare-xyz/input/ghilani-g3-inp.xml and ghilani-g3-adj.xml), whose printed digits these are.
"""

import numpy as np
import pytest

import tankcal
from tankcal.survey import adjust_survey

FIXED = {
    "A": (402.35087, -4652995.30109, 4349760.77753),
    "B": (8086.03178, -4642712.84739, 4360439.08326),
}
# from, to, dx, dy, dz (m); variances and covariances xx, xy, xz, yy, yz, zz (mm2)
VECTORS = """
A C  11644.2232  3601.2165  3399.2550  988.4  -9.58 9.52 937.7  -9.52 982.7
A E  -5321.7164  3634.0754  3173.6652  215.8  -2.1  2.16 191.9  -2.1  200.5
B C   3960.5442 -6681.2467 -7279.0148  230.5  -2.23 2.07 254.6  -2.23 225.2
B D -11167.6076  -394.5204  -907.9593  270    -2.75 2.85 272.1  -2.72 267
D C  15128.1647 -6286.7054 -6371.0583  146.1  -1.43 1.34 161.4  -1.44 130.8
D E  -1837.7459 -6253.8534 -6596.6697  123.1  -1.19 1.22 127.7  -1.21 128.3
F A  -1116.4523 -4596.1610 -4355.9062   74.75 -0.79 0.88  65.93 -0.81  76.16
F C  10527.7852  -994.9377  -956.6246  256.7  -2.25 2.4  216.3  -2.27 239.7
F E  -6438.1364  -962.0694 -1182.2305   94.42 -0.92 1.04  99.59 -0.89  88.26
F D  -4600.3787  5291.7785  5414.4311   93.3  -0.99 0.9   98.75 -0.99 120.4
F B   6567.2311  5686.2926  6322.3917   66.43 -0.65 0.69  74.65 -0.64  60.48
B F  -6567.2310 -5686.3033 -6322.3807   55.12 -0.63 0.61  74.72 -0.63  66.29
A F   1116.4577  4596.1553  4355.9141   66.19 -0.8  0.9   81.08 -0.82  93.76
"""
ADJUSTED = {
    "C": (12046.58076, -4649394.08256, 4353160.06443),
    "D": (-3081.58313, -4643107.36915, 4359531.12333),
    "E": (-4919.33908, -4649361.21987, 4352934.45480),
    "F": (1518.80119, -4648399.14533, 4354116.69141),
}
# covariance of the adjusted station with the variance factor that was found: xx, xy, xz, yy, yz, zz
COVARIANCE_MM2 = {
    "C": (3.6946370e01, -3.5306106e-01, 3.4643043e-01, 3.7493875e01, -3.5460332e-01, 3.5666776e01),
    "D": (2.4448440e01, -2.4993470e-01, 2.4534045e-01, 2.5623472e01, -2.4950430e-01, 2.6386458e01),
    "E": (2.7391063e01, -2.7075976e-01, 2.8871426e-01, 2.7718495e01, -2.6872008e-01, 2.6760705e01),
    "F": (7.1266873e00, -7.6801444e-02, 8.0593539e-02, 7.9450572e00, -7.7405420e-02, 7.8145938e00),
}
SQUARES, REDUNDANCY, FACTOR = 13.5145, 27, 0.500536
UPPER = np.triu_indices(3)


@pytest.fixture(scope="module")
def adjustment(tmp_path_factory):
    """The network, from a job's files."""
    folder = tmp_path_factory.mktemp("gnss")
    (folder / "job.toml").write_text('[adjustment]\ndatum = "control"\n')
    control = [f"{name},{x},{y},{z},0,0,0" for name, (x, y, z) in FIXED.items()]
    (folder / "control.csv").write_text(
        "\n".join(["point,x_m,y_m,z_m,sx_mm,sy_mm,sz_mm", *control]) + "\n"
    )
    rows = ["from,to,dx_m,dy_m,dz_m,sx_mm,sy_mm,sz_mm,r_xy,r_xz,r_yz"]
    for line in VECTORS.split("\n")[1:-1]:
        start, end, *values = line.split()
        xx, xy, xz, yy, yz, zz = map(float, values[3:])
        sx, sy, sz = np.sqrt([xx, yy, zz])
        spread = [sx, sy, sz, xy / (sx * sy), xz / (sx * sz), yz / (sy * sz)]
        rows.append(",".join([start, end, *values[:3], *(f"{one:.12g}" for one in spread)]))
    (folder / "vectors.csv").write_text("\n".join(rows) + "\n")
    return adjust_survey(tankcal.load(folder, only="adjustment").measurements)


def test_the_published_coordinates(adjustment):
    for name, xyz in ADJUSTED.items():
        found = adjustment.xyz_m[adjustment.names.index(name)]
        np.testing.assert_allclose(found, xyz, rtol=0, atol=6e-6, err_msg=name)


def test_the_published_variance_factor(adjustment):
    assert adjustment.redundancy == REDUNDANCY
    assert adjustment.sigma0**2 == pytest.approx(FACTOR, abs=5e-7)
    assert adjustment.sigma0**2 * REDUNDANCY == pytest.approx(SQUARES, abs=5e-5)


def test_the_published_covariances(adjustment):
    """Gama prints them with the variance factor that was found, this program without."""
    for name, entries in COVARIANCE_MM2.items():
        found = 1e6 * FACTOR * adjustment.covariance_m2[adjustment.names.index(name)][UPPER]
        np.testing.assert_allclose(found, entries, rtol=3e-6, atol=1e-6, err_msg=name)
