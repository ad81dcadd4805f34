"""Every kind of observation: what it computes (closed form) and its derivatives (differences)."""

import numpy as np
import pytest
from jacobians import assert_derivative

from tankcal.camera.model import AFFINITIES, CONVENTIONS, Form
from tankcal.geometry.rotations import apply_small_rotation, rotation_of_angles
from tankcal.survey.network import Survey
from tankcal.survey.observations import (
    KINDS as TABLES,
)
from tankcal.survey.observations import (
    NUISANCES,
    Azimuths,
    ControlCoordinates,
    Correlated,
    Directions,
    Distances,
    HeightDifferences,
    HeldOrientation,
    HorizontalAngles,
    ImageCoordinates,
    KnownUnknowns,
    Layout,
    Observations,
    PhotoOrientation,
    PhotoRotation,
    PlumbLines,
    State,
    SystemCoordinates,
    Vectors,
    VerticalAngles,
)

RNG = np.random.default_rng(5)
POINTS, PHOTOS = 6, 3
INTERIOR = [100, 0.3, -0.2, 2e-6, 3e-10, -1e-14, 1e-18, 3e-6, -2e-6, 1e-5, 1e-9, 2e-3, -1e-3]
INTERIOR_STEP = [1, 1, 1, 1e-4, 1e-8, 1e-12, 1e-16, 1e-4, 1e-4, 1e-1, 1e-5, 1, 1]


def made_state():
    """Points about the origin; photos some 20 m away that look at them."""
    angles = RNG.normal(0, 0.2, (PHOTOS, 3)) + [0.4, -0.1, 1.0]
    rotation = rotation_of_angles(*angles.T)
    away = 20 * rotation[:, 2, :] + RNG.normal(0, 1, (PHOTOS, 3))
    return State(
        xyz_m=RNG.uniform(-4, 4, (POINTS, 3)),
        photo_xyz_m=away,
        rotation=rotation,
        interior=np.append(INTERIOR, 0.0),
        nuisance={
            "orientation_rad": np.array([0.3, 2.0]),
            "scale": np.array([1e-3, -2e-3]),
            "offset_m": np.array([0.01, 0.02]),
        },
        system=rotation_of_angles(*RNG.normal(0, 1, (3, 2))),
        system_shift_m=RNG.normal(0, 5, (2, 3)),
        system_scale=np.array([0.01, -0.02]),
    )


def made_layout(state):
    """Every unknown gets a column, in the order of the fields."""
    next_column = iter(range(10**6))

    def columns(*shape):
        size = int(np.prod(shape))
        return np.array([next(next_column) for _ in range(size)]).reshape(shape)

    return Layout(
        points=columns(POINTS, 3),
        photos=columns(PHOTOS, 6),
        interior=np.append(columns(13), -1),
        nuisance={of: columns(2) for of in state.nuisance},
        system=columns(2, 7),
    )


STATE = made_state()
LAYOUT = made_layout(STATE)
UNKNOWNS = int(LAYOUT.system.max()) + 1
ENDS = {"start": np.array([0, 1, 2, 5]), "end": np.array([3, 4, 5, 0])}
FOUR = np.zeros(4), np.ones(4)
TOOLS = np.array([0, 1, -1, 0])


def images(form, value=0.0):
    point, photo = (a.ravel() for a in np.meshgrid(np.arange(POINTS), np.arange(PHOTOS)))
    table = np.tile(np.arange(13), (PHOTOS, 1))
    n = len(point)
    return ImageCoordinates(
        np.full((n, 2), value), np.ones((n, 2)), point, photo, form, np.arange(13), table
    )


KINDS = {
    **{
        f"image {convention} {affinity} {balance}": images(Form(convention, affinity, balance))
        for convention in CONVENTIONS
        for affinity in AFFINITIES
        for balance in (0.0, 30.0)
    },
    **{
        f"ideal image {convention} {affinity}": images(
            Form(convention, affinity, 30.0, "ideal"), value=[21.0, -34.0]
        )
        for convention in CONVENTIONS
        for affinity in AFFINITIES
    },
    "orientation": PhotoOrientation(
        np.zeros(6), np.ones(6), np.array([0, 1, 2, 0, 1, 2]), np.arange(6)
    ),
    "rotation": PhotoRotation(
        np.zeros((3, 3)),
        np.full((3, 3), 0.01) * [1, 2, 3],
        np.arange(3),
        apply_small_rotation(STATE.rotation, RNG.normal(0, 0.5, (3, 3))),
    ),
    "photo held": HeldOrientation(
        *(np.linspace(-0.4, 0.5, 11), np.ones(11)),
        photo=np.arange(11) % 3,
        row=np.arange(11),
        rotation=np.tile(
            apply_small_rotation(STATE.rotation, RNG.normal(0, 0.4, (3, 3))), (4, 1, 1)
        )[:11],
    ),
    "control": ControlCoordinates(*FOUR, np.array([0, 1, 2, 5]), np.array([0, 1, 2, 0])),
    "system": SystemCoordinates(
        *FOUR, np.array([0, 1, 2, 5]), np.array([0, 1, 2, 0]), np.array([0, 1, 0, 1])
    ),
    "height difference": HeightDifferences(*FOUR, **ENDS),
    "plumb line": PlumbLines(np.zeros((4, 2)), np.ones((4, 2)), **ENDS),
    "vector": Vectors(np.zeros((4, 3)), np.ones((4, 3)), **ENDS),
    "distance": Distances(*FOUR, **ENDS, instrument=TOOLS),
    "horizontal distance": Distances(*FOUR, **ENDS, instrument=TOOLS, horizontal=True),
    "slope distance": Distances(*FOUR, **ENDS, instrument=TOOLS, rise_m=np.full(4, 0.3)),
    "azimuth": Azimuths(*FOUR, **ENDS),
    "direction": Directions(*FOUR, **ENDS, set=np.array([0, 0, 1, 1])),
    "horizontal angle": HorizontalAngles(*FOUR, **ENDS, origin=np.array([4, 5, 0, 2])),
    "vertical angle": VerticalAngles(*FOUR, **ENDS, rise_m=np.full(4, -0.2)),
    "zenith angle": VerticalAngles(*FOUR, **ENDS, zenith=True, bend_per_m=1e-3),
    **{
        f"known {of}": KnownUnknowns(np.zeros(1), np.ones(1), of, np.array([1]))
        for of in ("interior", *NUISANCES, "system_scale")
    },
}
KINDS["correlated"] = Correlated(
    *(np.zeros((1, 4)), np.ones((1, 4))),
    parts=(
        (KINDS["vector"].taken([1]).taken([0, 0, 0]), np.arange(3)),
        (KINDS["distance"].taken([0]), np.array([0])),
    ),
    covariance=np.eye(4) + 0.3 * (1 - np.eye(4)),
    all_of=LAYOUT,
)


def test_all_kinds_are_compared():
    """A further kind of observation must stand in the table of this file."""

    def below(kind):
        return {kind}.union(*(below(one) for one in kind.__subclasses__()))

    kinds = {one for one in below(Observations) if "computed" in vars(one) or "fill" in vars(one)}
    assert kinds - {Observations} == {type(one) for one in KINDS.values()}
    assert {one.observes for one in TABLES.values()} <= kinds


def test_nuisances_are_those_of_a_survey():
    """Property: each has a start and an sd in a survey, and observations name no other."""
    assert list(Survey((), np.zeros((0, 3))).nuisances) == list(NUISANCES)
    assert {of for one in KINDS.values() for of, _ in one.nuisances} == set(NUISANCES)


@pytest.mark.parametrize("kind", KINDS)
def test_rows_are_taken_whole(kind):
    """Property: what some rows of a table compute is what they compute in the whole table."""
    observed = KINDS[kind]
    keep = np.arange(len(observed))[::-2]
    assert observed.taken(keep).columns(LAYOUT).tolist() == observed.columns(LAYOUT)[keep].tolist()
    w, part = np.empty((len(observed), observed.rows)), np.empty((len(keep), observed.rows))
    none = np.empty((0, observed.rows, 0))
    if "image" in kind:
        none = np.empty((0, 2, observed.columns(LAYOUT).shape[1]))
    observed.fill(STATE, w, none)
    observed.taken(keep).fill(STATE, part, none)
    assert part.tolist() == w[keep].tolist()


@pytest.mark.parametrize("table", TABLES)
def test_axes_that_enter(table):
    """Property: `axes` names the coordinates by which an observation has derivatives."""
    for observed in KINDS.values():
        if type(observed) is TABLES[table].observes:
            _, jac = observed.computed(STATE, True)
            ends = jac[:, :, :6].reshape(-1, 2, 3)
            assert set(np.flatnonzero(np.abs(ends).max(axis=(0, 1))).tolist()) == set(observed.axes)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("kind", KINDS)
def test_derivatives(kind):
    """Second method: central differences over all unknowns, through the layout's own steps."""
    observed = KINDS[kind]
    columns = observed.columns(LAYOUT)
    w = np.empty((len(observed), observed.rows))
    jac = np.empty((len(observed), observed.rows, columns.shape[1]))
    observed.fill(STATE, w, jac)
    full = np.zeros((len(observed), observed.rows, UNKNOWNS))
    for i in range(len(observed)):
        np.add.at(full[i].T, columns[i][columns[i] >= 0], jac[i][:, columns[i] >= 0].T)
    unit = np.ones(UNKNOWNS)
    unit[LAYOUT.interior[:13]] = INTERIOR_STEP

    def misclosures(step):
        found = np.empty_like(w)
        observed.fill(LAYOUT.moved(STATE, step * unit), found, jac[:0])
        return found.ravel()

    assert_derivative(misclosures, np.zeros(UNKNOWNS), full.reshape(-1, UNKNOWNS) * unit)
    assert misclosures(np.zeros(UNKNOWNS)) == pytest.approx(w.ravel(), abs=1e-13)


def test_closed_forms():
    """3-4-5 triangles and eighths of a circle."""
    xyz = np.array([[0.0, 0, 0], [3, 4, 0], [1, 1, 2**0.5], [-2, 0, 0]])
    state = State(xyz_m=xyz, nuisance={"scale": np.array([0.01]), "offset_m": np.array([0.5])})
    one, zero, origin = np.zeros(1), np.array([-1]), np.array([0])

    def computed(kind, end, **more):
        return kind(one, one + 1, origin, np.array([end]), **more).computed(state, False)[0].item()

    assert computed(Distances, 1, instrument=zero) == pytest.approx(5)
    assert computed(Distances, 1, instrument=origin) == pytest.approx(5 * 1.01 + 0.5)
    assert computed(Distances, 2, instrument=zero) == pytest.approx(2)
    assert computed(Distances, 2, instrument=zero, horizontal=True) == pytest.approx(2**0.5)
    assert computed(Azimuths, 2) == pytest.approx(np.pi / 4)
    assert computed(Azimuths, 3) == pytest.approx(-np.pi / 2)
    assert computed(VerticalAngles, 2) == pytest.approx(np.pi / 4)
    assert computed(VerticalAngles, 2, zenith=True) == pytest.approx(np.pi / 4)
    assert computed(HorizontalAngles, 2, origin=np.array([3])) == pytest.approx(3 * np.pi / 4)
    assert computed(HeightDifferences, 2) == pytest.approx(2**0.5)


def test_angles_are_compared_the_shorter_way_round():
    state = State(xyz_m=np.array([[0.0, 0, 0], [-1e-9, -1, 0]]))
    seen = Azimuths(np.array([np.pi]), np.ones(1), np.array([0]), np.array([1]))
    assert abs(seen.difference(seen.computed(state, False)[0])).max() < 1e-8


def test_known_rotation_holds_at_a_photo_that_looks_along_x():
    """At phi = 90 deg misclosure and derivatives stay finite, and the sds keep their size."""
    known = rotation_of_angles(np.array([0.2]), np.array([np.pi / 2]), np.array([0.5]))
    seen = PhotoRotation(np.zeros((1, 3)), np.full((1, 3), 1e-3), np.array([0]), known)
    state = State(xyz_m=STATE.xyz_m, photo_xyz_m=np.zeros((1, 3)), rotation=known)
    w, jac = np.empty((1, 3)), np.empty((1, 3, 3))
    seen.fill(state, w, jac)
    assert np.abs(w).max() < 1e-9
    assert np.linalg.svd(jac[0])[1] == pytest.approx([1e4, 1e3, 1e3 / 2**0.5], rel=1e-9)
