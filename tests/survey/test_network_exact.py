"""What holds exactly (sd 0): the limit of small sds, a second method, contradictions in words."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from networks import by_total_station, photographed
from test_network import whole_matrix

from tankcal.errors import SolutionError
from tankcal.geometry.rotations import angles_of, apply_small_rotation, rotation_of_angles
from tankcal.survey.network import Instrument, Survey, System, adjust, snoop
from tankcal.survey.observations import (
    Azimuths,
    ControlCoordinates,
    Distances,
    HeightDifferences,
    HorizontalAngles,
    KnownUnknowns,
    PhotoOrientation,
    PhotoRotation,
    PlumbLines,
    State,
    SystemCoordinates,
    VerticalAngles,
)


@pytest.fixture(scope="module")
def survey():
    return photographed()[0]


TRUTH = photographed()[1]
ENDS = {"start": np.array([0, 5]), "end": np.array([17, 30])}


def exactly(kind, **more):
    """Observations of a kind that hold exactly, off what is there by a mm or an arc minute."""
    zero = np.zeros(2)
    one = kind(zero, zero, **more)
    state = State(
        TRUTH.xyz_m, TRUTH.photo_xyz_m, TRUTH.rotation, np.append(TRUTH.interior, 0.0),
        nuisance={"scale": np.zeros(1), "offset_m": np.zeros(1)},
    )  # fmt: skip
    value = one.computed(state, False)[0].ravel()
    return replace(one, value=value + (1e-3 if one.unit == "m" else 3e-4) * np.array([1, -1]))


def plumb():
    return PlumbLines(np.zeros((2, 2)), np.zeros((2, 2)), np.array([0, 5]), np.array([12, 29]))


KINDS = {
    "control": lambda: exactly(ControlCoordinates, point=np.array([1, 40]), axis=np.array([2, 0])),
    "distance": lambda: exactly(Distances, **ENDS, instrument=np.array([-1, -1])),
    "horizontal distance": lambda: exactly(
        Distances, **ENDS, instrument=np.array([0, 0]), horizontal=True
    ),
    "height difference": lambda: exactly(HeightDifferences, **ENDS),
    "azimuth": lambda: exactly(Azimuths, **ENDS),
    "horizontal angle": lambda: exactly(HorizontalAngles, **ENDS, origin=np.array([3, 22])),
    "vertical angle": lambda: exactly(VerticalAngles, **ENDS),
    "plumb line": plumb,
    "photo": lambda: replace(
        exactly(PhotoOrientation, photo=np.array([1, 4]), element=np.array([2, 0]))
    ),
    "angle": lambda: replace(
        exactly(PhotoOrientation, photo=np.array([1, 4]), element=np.array([3, 5])), sd=np.zeros(2)
    ),
    "phi": lambda: exactly(PhotoOrientation, photo=np.array([1, 4]), element=np.array([4, 4])),
    "rotation": lambda: PhotoRotation(
        np.zeros((2, 3)), np.zeros((2, 3)), np.array([1, 4]),
        apply_small_rotation(TRUTH.rotation[[1, 4]], np.full((2, 3), 2e-4)),
    ),
    "interior": lambda: KnownUnknowns(np.array([100.03]), np.zeros(1), "interior", np.array([0])),
}  # fmt: skip


# sds with a redundancy that is not lost in rounding, yet near the limit
TESTABLE = {"interior": 1e-4, "azimuth": 3e-6, "horizontal angle": 3e-6, "vertical angle": 3e-6}


def with_sd(one, sd):
    return replace(one, sd=np.full(np.shape(one.sd), sd))


@pytest.mark.slow
@pytest.mark.parametrize("what", KINDS)
def test_exact_is_the_limit_of_small_sds(survey, what, figure):
    """Second method: sds of 1e-4 to 1e-6 (m, rad), extrapolated; points, covariance, tests."""
    one = KINDS[what]()
    tools = (Instrument("tape", scale_sd=1e-4),)
    survey = replace(survey, instruments=tools)
    found = adjust(replace(survey, observations=(*survey.observations, one)), tolerance=1e-7)
    near = [
        adjust(
            replace(survey, observations=(*survey.observations, with_sd(one, sd))), tolerance=1e-7
        )
        for sd in (2e-6, 1e-6, TESTABLE.get(what, 2e-5))
    ]
    off = [np.abs(limit.xyz_m - found.xyz_m).max() for limit in near]
    assert off[1] < 1e-6
    assert off[1] < 0.3 * off[0] or off[1] < 1e-9  # with the square of the sd
    q, limit = found.covariance_m2(), near[1].covariance_m2()
    size = np.sqrt(np.diag(limit).mean())
    assert np.abs(q - limit).max() < 1e-4 * size**2
    assert np.linalg.eigvalsh(q).min() > -1e-12 * size**2
    assert found.dof == near[1].dof
    table = next(t for t in found.residuals if t.exact)
    other = next(t for t in near[2].residuals if t.source == table.source)
    if what != "rotation":  # its three values are not those of one observation each
        figure(
            f"{what} held exactly: w, and with an sd", f"{table.w[0, 0]:.5f} {other.w[0, 0]:.5f}"
        )
        assert table.w == pytest.approx(other.w, rel=5e-3, abs=2e-3)
        assert table.mdb == pytest.approx(other.mdb, rel=1e-2)
        assert table.effect_m == pytest.approx(other.effect_m, rel=1e-2)


def test_conditions_hold_to_the_last_digit(survey):
    one = KINDS["distance"]()
    found = adjust(replace(survey, observations=(*survey.observations, one)))
    length = np.linalg.norm(found.xyz_m[one.start] - found.xyz_m[one.end], axis=1)
    assert length == pytest.approx(one.value, abs=1e-13)
    for i, j, d in zip(one.start, one.end, found.xyz_m[one.start] - found.xyz_m[one.end],
                       strict=True):  # fmt: skip
        a = np.concatenate([d, -d]) / np.linalg.norm(d)
        assert a @ found.covariance_m2([i, j]) @ a < 1e-18


def test_covariance_is_that_of_the_null_space(survey):
    """Second method: unknowns = Z y with Z the null space of the conditions, dense inverse."""
    one = exactly(HeightDifferences, **ENDS)
    found = adjust(replace(survey, observations=(*survey.observations, one)))
    a = whole_matrix(found)
    layout = found.problem.layout.points
    c = np.zeros((2, a.shape[1]))
    for row in range(2):
        c[row, layout[one.end[row], 2]], c[row, layout[one.start[row], 2]] = 1, -1
    scale = np.linalg.norm(a, axis=0)
    z = scipy.linalg.null_space(c / scale) / scale[:, None]
    whitened = np.linalg.qr(a @ z, mode="r")
    inner = z @ np.linalg.inv(whitened)
    q = inner @ inner.T
    columns = layout.ravel()
    expected = q[np.ix_(columns, columns)]
    size = np.sqrt(np.maximum(np.diag(expected), 1e-20))
    assert np.abs((found.covariance_m2() - expected) / np.outer(size, size)).max() < 1e-6
    redundancy = np.concatenate([r.ravel() for r in found.solution.cofactor.redundancy()])
    assert redundancy.sum() == pytest.approx(found.dof, rel=1e-9)


@pytest.mark.slow(after=4)
@pytest.mark.parametrize("phi_deg", [89.0, 89.999, 90.0])
@pytest.mark.parametrize("element", [3, 4, 5])
def test_a_single_angle_near_phi_90(survey, element, phi_deg):
    """Property: an angle held at its true value changes nothing in a survey without error."""
    exact, truth = photographed(noise=0.0)
    target = rotation_of_angles(0.7, np.radians(phi_deg), -0.4)
    frame = target.T @ truth.rotation[2]  # X' = frame X: photo 2 then has that rotation
    control, tapes = exact.observations
    control = replace(control, value=(control.value.reshape(-1, 3) @ frame.T).ravel())
    value = np.array([[0.7, np.radians(phi_deg), -0.4][element - 3]])
    held = PhotoOrientation(value, np.zeros(1), np.array([2]), np.array([element]))
    turned_survey = replace(
        exact,
        xyz_m=exact.xyz_m @ frame.T,
        photos=replace(
            exact.photos,
            xyz_m=exact.photos.xyz_m @ frame.T,
            rotation=exact.photos.rotation @ frame.T,
        ),
        observations=(control, tapes, held),
    )
    found = adjust(turned_survey)
    assert 0.5 * found.solution.chi2 < 1e-10
    assert found.xyz_m == pytest.approx(truth.xyz_m @ frame.T, abs=1e-7)
    rotation = found.solution.unknowns.rotation[2]
    angles = angles_of(rotation)
    if phi_deg < 90:
        assert angles[element - 3] == pytest.approx(value[0], abs=1e-7)
    assert rotation == pytest.approx(target, abs=1e-6)


def test_three_angles_of_a_photo_are_one_rotation(survey):
    angles = angles_of(survey.photos.rotation[3])
    single = PhotoOrientation(angles, np.zeros(3), np.full(3, 3), np.array([3, 4, 5]))
    found = adjust(replace(survey, observations=(*survey.observations, single)))
    fixed = np.zeros((8, 4), dtype=bool)
    fixed[3, 3] = True
    other = adjust(replace(survey, photos=replace(survey.photos, fixed=fixed)))
    assert found.xyz_m == pytest.approx(other.xyz_m, abs=1e-9)
    assert found.point_sd_m == pytest.approx(other.point_sd_m, rel=1e-6)
    assert found.dof == other.dof


@pytest.mark.slow
def test_a_datum_of_conditions_only(survey):
    """Second method: six coordinates and a distance held exactly, against the same held fixed."""
    xyz = TRUTH.xyz_m
    point, axis = np.array([0, 0, 0, 9, 9, 40]), np.array([0, 1, 2, 0, 2, 1])
    control = ControlCoordinates(xyz[point, axis], np.zeros(6), point, axis)
    found = adjust(replace(survey, observations=(survey.observations[1], control)))
    fixed = np.zeros((48, 3), dtype=bool)
    fixed[point, axis] = True
    start = survey.xyz_m.copy()
    start[point, axis] = xyz[point, axis]
    other = adjust(replace(survey, xyz_m=start, fixed=fixed, observations=survey.observations[1:]))
    assert found.xyz_m == pytest.approx(other.xyz_m, abs=1e-7)
    assert found.covariance_m2() == pytest.approx(other.covariance_m2(), rel=1e-5, abs=1e-13)
    table = next(t for t in found.residuals if t.exact)
    assert np.isinf(table.mdb).all()  # a minimal datum tests nothing


def test_levels_that_close_and_levels_that_do_not(survey):
    """A loop of exact height differences: consistent is accepted, else the rows are named."""
    z = TRUTH.xyz_m[:, 2]
    start, end = np.array([0, 13, 26]), np.array([13, 26, 0])
    loop = HeightDifferences(z[end] - z[start], np.zeros(3), start, end)
    found = adjust(replace(survey, observations=(*survey.observations, loop)))
    two = adjust(replace(survey, observations=(*survey.observations, loop.taken(slice(0, 2)))))
    assert found.xyz_m == pytest.approx(two.xyz_m, abs=1e-9)
    assert found.dof == two.dof
    bad = replace(loop, value=loop.value + [0, 0, 0.002])
    with pytest.raises(
        SolutionError,
        match=r"contradict one another, by 0.002 m or rad: height difference P13 - P26",
    ):
        adjust(replace(survey, observations=(*survey.observations, bad)))


def test_contradictions_are_reported(survey):
    """A distance against two fixed points; two values of one coordinate; an open triangle."""
    xyz = TRUTH.xyz_m
    point, axis = np.repeat([0, 9], 3), np.tile([0, 1, 2], 2)
    control = ControlCoordinates(xyz[point, axis], np.zeros(6), point, axis)
    tape = exactly(
        Distances, start=np.array([0, 3]), end=np.array([9, 4]), instrument=np.array([-1, -1])
    )
    with pytest.raises(SolutionError, match=r"contradict .* distance P0 - P9"):
        adjust(replace(survey, observations=(*survey.observations, control, tape)))
    twice = ControlCoordinates(
        np.array([1.0, 1.1]), np.zeros(2), np.array([3, 3]), np.array([2, 2])
    )
    with pytest.raises(SolutionError, match=r"by 0.1 m .*control coordinate P3 z"):
        adjust(replace(survey, observations=(*survey.observations, twice)))
    triangle = Distances(
        np.array([1.0, 1.0, 5.0]), np.zeros(3), np.array([0, 1, 2]), np.array([1, 2, 0]),
        instrument=np.full(3, -1),
    )  # fmt: skip
    with pytest.raises(SolutionError, match=r"held exactly contradict one another"):
        adjust(replace(survey, observations=(*survey.observations, triangle)))


@pytest.mark.slow
@pytest.mark.parametrize("away_m", [100.0, 1000.0, 5000.0])
def test_exact_values_hold_to_rounding_however_far_they_reach(away_m):
    """Closed form: an azimuth to a far mark, held exactly, moves a station across the sight alone.

    Its rounding, 4e-16 rad, is 2e-8 of a column of 0.1 mm at 5 km: such surveys were refused for
    values that contradict one another by 4e-16.
    """
    xyz, fixed = np.zeros((2, 3)), np.array([[False] * 3, [True] * 3])
    control = ControlCoordinates(np.zeros(3), np.full(3, 1e-4), np.zeros(3, int), np.arange(3))
    for azimuth in np.linspace(0.1, 6.2, 40):
        xyz[1] = away_m * np.array([np.sin(azimuth), np.cos(azimuth), 0.1])
        held = Azimuths(np.array([azimuth + 1e-7]), np.zeros(1), np.zeros(1, int), np.ones(1, int))
        found = adjust(Survey(("S", "FAR"), xyz, fixed, observations=(control, held))).xyz_m
        x, y, _ = found[1] - found[0]
        assert abs(np.angle(np.exp(1j * (np.arctan2(x, y) - azimuth - 1e-7)))) < 2e-15
        across = np.array([-np.cos(azimuth), np.sin(azimuth), 0.0]) * away_m * 1e-7
        assert found[0] == pytest.approx(across, abs=1e-8)


def test_impossible_exact_values_are_refused(survey):
    images = survey.image_points
    with pytest.raises(SolutionError, match="an image coordinate cannot hold exactly"):
        adjust(replace(survey, image_points=replace(images, sd=0 * images.sd)))
    half = PlumbLines(np.zeros((1, 2)), np.array([[0.0, 1.0]]), np.array([0]), np.array([12]))
    with pytest.raises(SolutionError, match=r"plumb line: all its values .* or none"):
        adjust(replace(survey, observations=(*survey.observations, half)))


@pytest.mark.slow
def test_snooping_keeps_exact_values(survey):
    """A fixed distance 5 cm wrong shows in its test quantity, and is not rejected."""
    one = exactly(Distances, **ENDS, instrument=np.array([-1, -1]))
    wrong = replace(one, value=one.value + [0.05, 0])
    found = snoop(replace(survey, observations=(*survey.observations, wrong)))
    assert all(removed.source != 2 for removed in found.removed)
    assert (found.suspects[0].source, found.suspects[0].row) == (2, 0)
    assert found.suspects[0].w > 20


def test_total_station_with_a_held_side():
    """Property: without noise the truth comes back, directions and an azimuth held exactly."""
    survey, truth = by_total_station(noise=0.0)
    wall = len(truth.xyz_m) - 4
    line = truth.xyz_m[wall + 1] - truth.xyz_m[wall]
    azimuth = Azimuths(
        np.array([np.arctan2(line[0], line[1])]),
        np.zeros(1),
        np.array([wall]),
        np.array([wall + 1]),
    )
    control = ControlCoordinates(
        truth.xyz_m[wall], np.zeros(3), np.full(3, wall), np.array([0, 1, 2])
    )
    found = adjust(replace(survey, observations=(*survey.observations, azimuth, control)))
    assert found.xyz_m == pytest.approx(truth.xyz_m, abs=1e-8)
    assert found.point_sd_m[wall].max() < 1e-9


def test_a_further_system_held_exactly(survey):
    """Property: control of a system that is turned and shifted gives the shape, exactly too."""
    rotation = rotation_of_angles(0.0, 0.0, 0.8)
    point = np.repeat([1, 20, 40], 3)
    axis = np.tile([0, 1, 2], 3)
    there = TRUTH.xyz_m @ rotation.T + [5, -3, 1]
    known = SystemCoordinates(there[point, axis], np.zeros(9), point, axis, np.zeros(9, dtype=int))
    system = System(
        "site",
        apply_small_rotation(rotation[None], np.array([[0.01, 0, 0.02]]))[0],
        np.array([5.1, -3, 1]),
    )
    found = adjust(replace(survey, systems=(system,), observations=(*survey.observations, known)))
    state = found.solution.unknowns
    back = found.xyz_m[point] - found.problem.centre_m
    values = np.einsum("ij,nj->ni", state.system[0], back) + state.system_shift_m[0]
    assert values[np.arange(9), axis] == pytest.approx(known.value, abs=1e-11)


@pytest.mark.slow
@pytest.mark.parametrize("kept", [[], [1], [0, 1]])
def test_photos_held_by_their_elements_or_as_a_whole(survey, kept):
    """Second method: all six elements of all photos exact, or not unknown at all; camera known."""
    state = ("fixed",) * 13
    camera = replace(survey.cameras[0], values=TRUTH.interior, state=state)
    observations = tuple(survey.observations[i] for i in kept)
    value = np.hstack([TRUTH.photo_xyz_m, angles_of(TRUTH.rotation)]).ravel()
    photo, element = np.repeat(np.arange(8), 6), np.tile(np.arange(6), 8)
    held = PhotoOrientation(value, np.zeros(48), photo, element)
    found = adjust(replace(survey, cameras=(camera,), observations=(*observations, held)))
    photos = replace(
        survey.photos,
        xyz_m=TRUTH.photo_xyz_m,
        rotation=TRUTH.rotation,
        fixed=np.ones((8, 4), dtype=bool),
    )
    other = adjust(replace(survey, cameras=(camera,), photos=photos, observations=observations))
    assert found.xyz_m == pytest.approx(other.xyz_m, abs=1e-12)
    assert found.covariance_m2() == pytest.approx(other.covariance_m2(), rel=1e-9, abs=1e-18)
    assert found.dof == other.dof
    assert np.abs(found.photos[2]).max() < 1e-20


@pytest.mark.slow
def test_more_conditions_than_freedom(survey):
    """All points exact, and true distances between them exact: accepted, points have no sd."""
    xyz = TRUTH.xyz_m
    point, axis = np.repeat(np.arange(48), 3), np.tile([0, 1, 2], 48)
    control = ControlCoordinates(xyz.ravel(), np.zeros(144), point, axis)
    start, end = np.arange(40), np.arange(40) + 8
    length = np.linalg.norm(xyz[start] - xyz[end], axis=1)
    tapes = Distances(length, np.zeros(40), start, end, instrument=np.full(40, -1))
    found = adjust(replace(survey, observations=(control, tapes)))
    assert found.xyz_m == pytest.approx(xyz, abs=1e-12)
    assert found.point_sd_m.max() == pytest.approx(0, abs=1e-12)
    assert found.dof == adjust(replace(survey, observations=(control,))).dof
