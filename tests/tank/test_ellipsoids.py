"""Ellipsoids and pressed spheres: closed forms, published figures, a mesh, second methods."""

import numpy as np
import pytest
import trimesh
from jacobians import assert_derivative
from scipy.integrate import quad

from tankcal.errors import HeightError, SolutionError
from tankcal.tank.meshes import mesh_part, parse_mesh
from tankcal.tank.solids import Ellipsoid, Membrane, PressedSphere, Pressure, Sphere

DIPS = np.array([0.0, 1.0, 5.0, 10.0, 15.0, 20.0])
PLATE = Membrane(0.02, 206e9)


def test_published_partial_volumes_of_a_sphere():
    """Published: D = 20 m."""
    published = [30.368729, 654.498469, 2094.395102, 3534.291735, 4188.790205]
    found = Ellipsoid(10.0, 10.0, 10.0).volume_m3(DIPS[1:])
    assert found == pytest.approx(published, abs=5e-7)


def test_equal_axes_are_the_sphere():
    """Second method: the sphere's own closed form, volumes, areas and derivatives."""
    ball, sphere = Ellipsoid(10.0, 10.0, 10.0), Sphere(20.0)
    assert ball.volume_m3(DIPS) == pytest.approx(sphere.volume_m3(DIPS), abs=1e-9)
    assert ball.area_m2(DIPS) == pytest.approx(sphere.area_m2(DIPS), abs=1e-9)
    for name, expected in sphere.derivatives(DIPS).items():
        assert ball.derivatives(DIPS)[name] == pytest.approx(expected, abs=1e-9)


def test_full_ellipsoid_is_the_published_one():
    """Published example: 10.002506, 10.003652, 10.001074 hold 4191.8202 m3."""
    found = Ellipsoid(10.002506, 10.003652, 10.001074)
    assert found.capacity_m3 == pytest.approx(4191.8202, abs=1e-3)  # the axes are rounded
    assert found.volume_m3([found.top_m])[0] == pytest.approx(found.capacity_m3, rel=1e-14)


@pytest.mark.slow
def test_against_a_mesh():
    """Second method: a mesh of an ellipsoid, cut at each dip: one inside it, and one round it."""
    ball = trimesh.creation.icosphere(subdivisions=5)
    ball.apply_scale([10.3, 9.6, 9.9])
    unit = trimesh.creation.icosphere(subdivisions=5)
    outwards = 1 / np.min(np.sum(unit.triangles_center * unit.face_normals, axis=1))
    exact, dips = Ellipsoid(10.3, 9.6, 9.9), np.array([2.0, 9.9, 15.0])

    def cut(scale):
        whole = ball.copy()
        whole.apply_scale(scale)
        mesh = parse_mesh("ball.stl", whole.export(file_type="stl"), 1.0)
        return mesh_part(mesh, -9.9).volume_m3(dips)

    low, high = cut(1.0), cut(outwards)
    assert np.all(low <= exact.volume_m3(dips))
    assert np.all(exact.volume_m3(dips) <= high)
    assert np.all(high - low < 2e-3 * exact.capacity_m3)


def test_derivatives_of_an_ellipsoid():
    axes = [10.3, 9.6, 9.9]
    dips = DIPS[1:-1]
    assert_derivative(lambda x: Ellipsoid(*x).volume_m3(dips), axes, Ellipsoid(*axes).by_axes(dips))
    found = Ellipsoid(*axes).derivatives(dips)
    for name, move in (("diameter", [0.5] * 3), ("plate_thickness", [-1.0] * 3), ("scale", axes)):
        assert_derivative(
            lambda x, move=move: Ellipsoid(*(axes + x[0] * np.array(move))).volume_m3(dips),
            [0.0],
            found[name][:, None],
        )
    assert_derivative(
        lambda x: Ellipsoid(*axes).volume_m3(dips + x[0]), [0.0], found["datum"][:, None]
    )


def test_published_widening_by_pressure():
    """Published: 5 bar, r 10 m, t 20 mm, E 206 GPa, nu 0.3: 4.25e-4, and +0.127 % of volume."""
    loaded = PressedSphere(Sphere(20.0), PLATE, Pressure(gas_pa=5e5))
    assert loaded.strain(3.0)[0] == pytest.approx(4.25e-4, abs=5e-7)
    assert loaded.capacity_m3 / Sphere(20.0).capacity_m3 - 1 == pytest.approx(1.27e-3, abs=5e-6)


def test_pressure_of_the_survey_is_taken_off():
    """Property: a sphere surveyed under the pressure of its table is the table's."""
    same = Pressure(gas_pa=5e5, survey_gas_pa=5e5)
    loaded = PressedSphere(Sphere(20.0), PLATE, same)
    assert loaded.volume_m3(DIPS) == pytest.approx(Sphere(20.0).volume_m3(DIPS), rel=1e-14)
    assert same.is_there
    assert not Pressure(survey_density_kg_m3=500.0).is_there


def test_mean_pressure_of_a_liquid():
    """Second method: the pressure of each ring of the wall, by quadrature over the sphere."""
    level, density, radius = 14.0, 600.0, 10.0
    loaded = PressedSphere(Sphere(2 * radius), PLATE, Pressure(density_kg_m3=density))
    rings = quad(lambda z: density * 9.80665 * (level - z) * 2 * np.pi * radius, 0.0, level)[0]
    mean = rings / (4 * np.pi * radius**2)
    expected = mean * radius * 0.7 / (2 * 206e9 * 0.02)
    assert loaded.strain(level)[0] == pytest.approx(expected, rel=1e-9)


def test_whole_volume_by_membrane_theory():
    """Second method: membrane stresses of a full sphere on its equator (Flugge), integrated.

    The volume added is the integral of w = r (hoop strain) corrected for the meridional
    displacement v: dV = r^2 times the integral of w; w + v' = r e_phi, w + v cot = r e_theta.
    """
    radius, density, plate = 10.0, 600.0, PLATE
    gamma = density * 9.80665
    angle = (np.arange(200_000) + 0.5) * np.pi / 200_000  # from the top
    cos, sin = np.cos(angle), np.sin(angle)
    load = gamma * radius * (1 - cos)
    resultant = 2 * np.pi * radius**2 * load * sin * cos * np.pi / len(angle)  # vertical
    from_top = np.cumsum(resultant) - resultant / 2
    total = resultant.sum()  # weight of the liquid, downwards: carried at the equator
    carried = np.where(angle > np.pi / 2, -total, 0.0)
    meridional = (from_top + carried) / (2 * np.pi * radius * sin**2)
    hoop = load * radius - meridional
    stiff = plate.e_pa * plate.thickness_m
    by_phi = radius * (meridional - plate.poisson * hoop) / stiff
    by_theta = radius * (hoop - plate.poisson * meridional) / stiff
    # sum of both: 2 w + v' + v cot; weighted with sin, the v terms are the derivative of v sin
    width = np.pi / len(angle)
    added = 2 * np.pi * radius**2 * np.sum((by_phi + by_theta) / 2 * sin) * width
    loaded = PressedSphere(Sphere(2 * radius), plate, Pressure(density_kg_m3=density))
    strain = loaded.strain(2 * radius)[0]
    assert added == pytest.approx(4 * np.pi * radius**3 * strain, rel=1e-5)


LOADS = Pressure(8e5, 600.0, 1e5, 1000.0, 3.0)


@pytest.mark.parametrize("solid", [Sphere(20.0), Ellipsoid(10.3, 9.6, 9.9)], ids=["ball", "oval"])
def test_derivatives_of_a_pressed_sphere(solid):
    dips = np.array([0.5, 4.0, 11.0, 18.0])
    tank = PressedSphere(solid, PLATE, LOADS)
    found = tank.derivatives(dips)

    def moved(**changes):
        membrane = Membrane(
            PLATE.thickness_m, PLATE.e_pa + changes.pop("youngs_modulus", 0.0), PLATE.poisson
        )
        names = ("pressure", "liquid_density", "survey_pressure", "survey_density", "survey_level")
        values = (8e5, 600.0, 1e5, 1000.0, 3.0)
        loads = [value + changes.get(name, 0.0) for name, value in zip(names, values, strict=True)]
        return PressedSphere(solid, membrane, Pressure(*loads)).volume_m3(dips)

    steps = {"youngs_modulus": 1e6, "pressure": 10.0, "survey_pressure": 10.0,
             "liquid_density": 0.1, "survey_density": 0.1, "survey_level": 1e-3}  # fmt: skip
    for name, step in steps.items():
        assert_derivative(
            lambda x, name=name: moved(**{name: x[0]}), [0.0], found[name][:, None], step=step,
            tolerance=1e-6,
        )  # fmt: skip
    assert_derivative(lambda x: tank.volume_m3(dips + x[0]), [0.0], found["datum"][:, None])


def test_thicker_plate_of_a_pressed_sphere():
    """Derivative: the inside radius is less, and the wall stiffer."""
    dips = np.array([0.5, 4.0, 11.0, 18.0])

    def of(change):
        return PressedSphere(
            Sphere(20.0 - 2 * change), Membrane(0.02 + change, 206e9), LOADS
        ).volume_m3(dips)

    found = PressedSphere(Sphere(20.0), PLATE, LOADS).derivatives(dips)
    assert_derivative(lambda x: of(x[0]), [0.0], found["plate_thickness"][:, None])

    def wider(change):
        return PressedSphere(Sphere(20.0 + change), PLATE, LOADS).volume_m3(dips)

    assert_derivative(lambda x: wider(x[0]), [0.0], found["diameter"][:, None])


def test_refusals():
    with pytest.raises(SolutionError, match="semi-axis c"):
        Ellipsoid(1.0, 1.0, 0.0)
    with pytest.raises(SolutionError, match="thickness"):
        PressedSphere(Sphere(20.0), Membrane(0.0, 206e9), LOADS)
    with pytest.raises(SolutionError, match="widens"):
        PressedSphere(Sphere(20.0), Membrane(1e-4, 40e9), LOADS)
    with pytest.raises(HeightError):
        Ellipsoid(1.0, 1.0, 1.0).volume_m3([2.1])
    with pytest.raises(HeightError):
        PressedSphere(Sphere(20.0), PLATE, LOADS).volume_m3([20.1])
