"""Small surveys of every kind of observation against a dense second method, without its formulas.

The second method knows the survey only through `reading`, written here from the definitions, and
differentiates by differences.
"""

from dataclasses import replace

import dense
import numpy as np
import pytest
from networks import by_total_station

from tankcal.camera.model import Form, distort_image_points
from tankcal.geometry.rotations import rotation_of_angles
from tankcal.survey.network import Camera, Instrument, Photos, Survey, System, adjust
from tankcal.survey.observations import (
    Azimuths,
    ControlCoordinates,
    Directions,
    Distances,
    HeightDifferences,
    HorizontalAngles,
    ImageCoordinates,
    KnownUnknowns,
    PlumbLines,
    SystemCoordinates,
    VerticalAngles,
)

ARCSEC = np.pi / 648000
PHOTOGRAPHED = 10  # points
PLACES = np.array(
    [
        [0.0, 0.0, 0.0], [22.0, 3.0, 0.4], [19.0, 25.0, -0.3], [-2.0, 21.0, 0.2],
        [9.0, 11.0, 6.0], [12.0, 9.0, 3.0], [12.0, 9.0, 8.0], [7.0, 14.0, 4.5],
    ]
)  # fmt: skip


def toward(xyz, start, end, rise=0.0):
    """Differences (3, n) from start to end."""
    x, y, z = (xyz[end] - xyz[start]).T
    return x, y, z - rise


def reading(one, xyz, more):
    """(n, m) what observations read at points xyz (n, 3); more: {name: values} of the rest."""
    kind = type(one).__name__
    if kind == "ControlCoordinates":
        return xyz[one.point, one.axis]
    if kind == "SystemCoordinates":
        rotation = rotation_of_angles(*more["turn"])
        moved = (1 + more["stretch"][0]) * (xyz[one.point] @ rotation.T) + more["shift"]
        return moved[np.arange(len(one)), one.axis]
    if kind == "KnownUnknowns":
        return more[one.of][one.index]
    if kind == "HeightDifferences":
        return xyz[one.end, 2] - xyz[one.start, 2]
    if kind == "PlumbLines":
        return (xyz[one.end] - xyz[one.start])[:, :2]
    rise = 0.0 if one.rise_m is None else one.rise_m
    x, y, z = toward(xyz, one.start, one.end, rise)
    if kind == "Distances":
        length = np.hypot(x, y) if one.horizontal else np.sqrt(x * x + y * y + z * z)
        scale = np.append(more["scale"], 0.0)[one.instrument]
        return length * (1 + scale) + np.append(more["offset_m"], 0.0)[one.instrument]
    if kind == "VerticalAngles":
        up = np.arctan2(z - one.bend_per_m * (x * x + y * y), np.hypot(x, y))
        return np.pi / 2 - up if one.zenith else up
    azimuth = np.arctan2(x, y)
    if kind == "Directions":
        return azimuth - more["sets"][one.set]
    if kind == "HorizontalAngles":
        x, y, _ = toward(xyz, one.start, one.origin)
        return azimuth - np.arctan2(x, y)
    return azimuth


ANGLES = ("Directions", "HorizontalAngles", "Azimuths", "VerticalAngles")


def misclosure(one, xyz, more):
    """Whitened (rows,), angles by the shorter way."""
    away = reading(one, xyz, more) - one.value
    if type(one).__name__ in ANGLES:
        away = np.angle(np.exp(1j * away))
    return (away / one.sd).ravel()


def observed(one, xyz, more, rng):
    """The observations with values as they would be read."""
    true = reading(one, xyz, more)
    return replace(one, value=true + rng.normal(size=np.shape(true)) * one.sd)


def everything(seed=0):
    """A Survey with every kind of observation but photographs, its other unknowns, near start."""
    rng = np.random.default_rng(seed)
    start, end = (a.ravel() for a in np.mgrid[:4, :8])
    keep = start != end
    start, end = start[keep], end[keep]
    n, none = len(start), np.zeros(len(start))
    rise = 1.6 - 0.1 * (end % 3)
    tool = np.where(start < 2, 0, 1)
    more = {
        "sets": np.array([0.3, 2.0, -1.2, 5.0]),
        "scale": np.array([4e-5, -2e-5]),
        "offset_m": np.array([0.003, -0.001]),
        "turn": np.array([0.01, -0.02, 0.7]),
        "shift": np.array([100.0, 50.0, 7.0]),
        "stretch": np.array([1e-4]),
    }
    point, axis = (a.ravel() for a in np.mgrid[:4, :3])
    far_point, far_axis = (a.ravel() for a in np.mgrid[2:7, :3])
    kinds = (
        ControlCoordinates(np.zeros(12), np.full(12, 0.004), point, axis),
        Directions(none, np.full(n, 4 * ARCSEC), start, end, set=start),
        VerticalAngles(
            none, np.full(n, 6 * ARCSEC), start, end, zenith=True, rise_m=rise, bend_per_m=6.8e-8
        ),
        VerticalAngles(none[:3], np.full(3, 20 * ARCSEC), np.array([4, 5, 6]), np.array([7, 7, 7])),
        Distances(none, np.full(n, 0.002), start, end, instrument=tool, rise_m=rise),
        Distances(
            none[:2], np.full(2, 0.003), np.array([4, 5]), np.array([7, 7]),
            instrument=np.full(2, -1), horizontal=True,
        ),
        Azimuths(none[:2], np.full(2, 9 * ARCSEC), np.array([0, 2]), np.array([4, 7])),
        HorizontalAngles(
            none[:2], np.full(2, 7 * ARCSEC), np.array([7, 4]), np.array([0, 1]),
            origin=np.array([2, 3]),
        ),
        HeightDifferences(none[:3], np.full(3, 0.0008), np.array([0, 1, 2]), np.array([1, 2, 3])),
        PlumbLines(np.zeros((1, 2)), np.full((1, 2), 0.001), np.array([5]), np.array([6])),
        SystemCoordinates(
            np.zeros(15), np.full(15, 0.003), far_point, far_axis, system=np.zeros(15, dtype=int)
        ),
        KnownUnknowns(np.zeros(2), np.array([2e-5, 2e-5]), of="scale", index=np.array([0, 1])),
        KnownUnknowns(np.zeros(1), np.array([0.002]), of="offset_m", index=np.array([0])),
    )  # fmt: skip
    kinds = tuple(observed(one, PLACES, more, rng) for one in kinds)
    survey = Survey(
        points=tuple("ABCDEFGH"),
        xyz_m=PLACES + rng.normal(0, 0.02, PLACES.shape),
        observations=kinds[:-2],
        sets=more["sets"] + 1e-3,
        instruments=(
            Instrument("one", *_known(kinds, 0), 2e-5, 0.002),
            Instrument("two", float(kinds[-2].value[1]), 0.0, 2e-5, np.nan),
        ),
        systems=(
            System("far", rotation_of_angles(0.0, 0.0, 0.69), np.array([100.1, 50, 7]), 0.0, True),
        ),
    )
    return survey, kinds, more


def _known(kinds, number):
    return float(kinds[-2].value[number]), float(kinds[-1].value[number])


@pytest.mark.slow
def test_every_kind_by_a_second_method(figure):
    """Second method: coordinates, covariance and v'Pv; all kinds in one adjustment."""
    survey, kinds, more = everything()
    sizes = {
        "sets": 1e-5, "scale": 1e-5, "offset_m": 1e-3, "turn": 1e-4, "shift": 1e-3, "stretch": 1e-4
    }  # fmt: skip
    start = np.concatenate([PLACES.ravel(), *more.values()])

    def misclosures(u):
        first, parts = PLACES.size, {}
        for name, values in more.items():
            parts[name] = u[first : first + len(values)]
            first += len(values)
        xyz = u[: PLACES.size].reshape(-1, 3)
        return np.concatenate([misclosure(one, xyz, parts) for one in kinds])

    size = np.concatenate(
        [np.full(PLACES.size, 1e-3), *(np.full(len(v), sizes[k]) for k, v in more.items())]
    )
    found, cofactors, square = dense.solved(misclosures, start, size)
    adjusted = adjust(survey, tolerance=1e-8)
    away = np.abs(adjusted.xyz_m.ravel() - found[: PLACES.size]).max()
    mine, own = adjusted.covariance_m2(), cofactors[: PLACES.size, : PLACES.size]
    difference = np.abs(mine - own).max() / np.abs(own).max()
    figure("every kind by a second method", f"{away:.1e} m, covariance {difference:.1e}")
    assert away < 1e-8
    assert difference < 1e-8
    assert adjusted.solution.chi2 == pytest.approx(square, rel=1e-8)
    assert adjusted.dof == sum(np.size(one.value) for one in kinds) - len(start)
    first = PLACES.size + len(more["sets"])
    assert adjusted.solution.unknowns.nuisance["scale"] == pytest.approx(
        found[first : first + 2], abs=1e-10
    )


@pytest.mark.parametrize("over", [None, np.arange(24, 28)])
def test_a_free_network_by_a_second_method(over, figure):
    """Second method: least norm by the pseudo-inverse, then an S-transformation to the datum."""
    survey, truth = by_total_station()
    n = len(truth.xyz_m)

    def misclosures(u):
        xyz, more = u[: 3 * n].reshape(-1, 3), {"scale": [], "offset_m": [], "sets": u[3 * n :]}
        return np.concatenate([misclosure(one, xyz, more) for one in survey.observations])

    start = np.concatenate([survey.xyz_m.ravel(), survey.sets])
    adjusted = adjust(survey, datum="inner", over=over, tolerance=1e-8)
    at = np.concatenate(
        [adjusted.xyz_m.ravel(), adjusted.solution.unknowns.nuisance["orientation_rad"]]
    )
    sizes = np.concatenate([np.full(3 * n, 1e-3), np.full(4, 1e-5)])
    jac = dense.jacobian(misclosures, at, 1e-2 * sizes)
    gradient = jac.T @ misclosures(at)
    cofactors = sizes[:, None] * _pseudo(jac * sizes) * sizes
    assert np.abs(cofactors @ gradient).max() < 1e-9  # it is the minimum
    moves = _motions(adjusted.xyz_m, len(start))
    chosen = np.zeros(len(start))
    chosen[: 3 * n].reshape(-1, 3)[slice(None) if over is None else over] = 1.0
    held = moves * chosen[:, None]
    assert np.abs(held.T @ (at - start)).max() < 1e-6 * np.abs(held).sum()
    s = np.eye(len(start)) - moves @ np.linalg.solve(held.T @ moves, held.T)
    own = (s @ cofactors @ s.T)[: 3 * n, : 3 * n]
    difference = np.abs(adjusted.covariance_m2() - own).max() / np.abs(own).max()
    figure("free network by a second method: covariance", f"{difference:.1e}")
    assert difference < 1e-8


def _pseudo(jac):
    root = np.linalg.pinv(jac, rcond=1e-9)
    return root @ root.T


def _motions(xyz, unknowns):
    """(unknowns, 4) three shifts, and the turn about the vertical with its four orientations."""
    moves = np.zeros((unknowns, 4))
    places = moves[: xyz.size].reshape(-1, 3, 4)
    places[:, :, :3] = np.eye(3)
    places[:, 0, 3], places[:, 1, 3] = xyz[:, 1], -xyz[:, 0]
    moves[xyz.size :, 3] = 1.0
    return moves


@pytest.mark.slow
@pytest.mark.parametrize(
    "form",
    [
        Form("distortion_of_ideal"),
        Form("correction_added", "both_y"),
        Form("correction_subtracted", "both_x", 40.0),
    ],
)
def test_photographs_by_a_second_method(form, figure):
    """Second method: two cameras' worth of parameters, photos, points and control, dense."""
    rng = np.random.default_rng(1)
    xyz = rng.uniform([-4, -4, -2], [4, 4, 2], (PHOTOGRAPHED, 3))
    last = xyz.size
    interior = np.array([90.0, 0.1, -0.2, 3e-6, -2e-10, 0, 0, 2e-6, -3e-6, 0, 0, 2e-4, -1e-4])
    active = [0, 1, 2, 3, 4, 7, 8, 11, 12]
    centre = np.array([[-6.0, -3, 14], [6, -4, 13], [0, 7, 14], [1, 0, 12]])
    angles = np.array([[0.2, -0.4, 0.1], [0.25, 0.4, 1.6], [-0.5, 0.0, 3.0], [0.05, 0.1, -1.5]])

    def images(points, photos, camera):
        whole = interior * (np.isin(np.arange(13), active, invert=True))
        whole[active] = camera
        seen = np.einsum(
            "pij,pnj->pni", rotation_of_angles(*photos[:, 3:].T), points[None] - photos[:, None, :3]
        )
        ideal = -whole[0] * seen[..., :2] / seen[..., 2:]
        return distort_image_points(ideal.reshape(-1, 2), whole, form)

    exterior = np.hstack([centre, angles])
    xy = images(xyz, exterior, interior[active])
    xy = xy + rng.normal(0, 0.004, xy.shape)
    point, axis = (a.ravel() for a in np.mgrid[:5, :3])
    control = ControlCoordinates(
        xyz[:5].ravel() + rng.normal(0, 0.002, 15), np.full(15, 0.002), point, axis
    )
    photo, number = (a.ravel() for a in np.mgrid[:4, :PHOTOGRAPHED])
    scope = tuple("block" if i in active else "off" for i in range(13))
    survey = Survey(
        points=tuple(f"P{i}" for i in range(PHOTOGRAPHED)),
        xyz_m=xyz + rng.normal(0, 0.01, xyz.shape),
        image_points=ImageCoordinates(xy, np.full(xy.shape, 0.004), number, photo),
        photos=Photos(tuple("abcd"), np.zeros(4, dtype=int), centre, rotation_of_angles(*angles.T)),
        cameras=(Camera(interior, form, scope=scope),),
        observations=(control,),
    )
    adjusted = adjust(survey, tolerance=1e-8)

    def misclosures(u):
        points, photos, camera = (
            u[:last].reshape(-1, 3),
            u[last : last + 24].reshape(-1, 6),
            u[last + 24 :],
        )
        away = (images(points, photos, camera) - xy) / 0.004
        return np.concatenate([away.ravel(), misclosure(control, points, {})])

    start = np.concatenate([xyz.ravel(), exterior.ravel(), interior[active]])
    sizes = np.concatenate(
        [
            np.full(last, 1e-3), np.tile([1e-3] * 3 + [1e-4] * 3, 4),
            [0.01, 0.01, 0.01, 1e-7, 1e-10, 1e-7, 1e-7, 1e-5, 1e-5],
        ]
    )  # fmt: skip
    found, cofactors, square = dense.solved(misclosures, start, sizes)
    away = np.abs(adjusted.xyz_m.ravel() - found[:last]).max()
    own = cofactors[:last, :last]
    difference = np.abs(adjusted.covariance_m2() - own).max() / np.abs(own).max()
    figure(f"{form.convention} by a second method", f"{away:.1e} m, covariance {difference:.1e}")
    assert away < 1e-8
    assert difference < 1e-7
    assert adjusted.solution.chi2 == pytest.approx(square, rel=1e-8)
    centres, turns, covariance = adjusted.photos
    assert np.hstack([centres, turns]).ravel() == pytest.approx(found[last : last + 24], abs=1e-8)
    blocks = np.stack([cofactors[i : i + 6, i : i + 6] for i in range(last, last + 24, 6)])
    assert np.abs(covariance - blocks).max() < 1e-7 * np.abs(blocks).max()
