"""Are two calibrations of a camera the same? Four tests of their bundles of rays.

A grid of image points is corrected by both sets. With (x1, y1), (x2, y2) the ideal points and
c1, c2 the focal lengths the figure of a pair, in pixels, is

    mis   sqrt(mean(dx^2 + dy^2)) of (x2, y2) - (x1, y1). Nothing is given away; c does not count
    zrot  the same of (x2, y2) c1/c2 - (x1, y1). Nothing is given away but the distance of the
          image: it is zero when both are the same bundle in space
    rot   sigma0 = sqrt(v'v/(2n - 3)) after the second bundle was rotated onto the first: a turn of
          the whole bundle, and most of a shift of the principal point, does not count
    spr   sigma0 = sqrt(v'v/(2n - 6)) of a resection by the second bundle of points that the first
          one sees on a terrain, pooled over ten random ones: a turn and a shift of the camera do
          not count, nor does c on flat ground. What is left is what an adjustment with free
          orientation would feel

mis is the same for both orders of a pair; the others, to first order, but for the factor c1/c2 of
the image in which they are counted: the first one's (spr: the second one's). Two calibrations are
similar when the figure is below the accuracy of image coordinates (Pessoa: 0.5 or 0.33 px).

as_published follows Pessoa instead: zrot is the mean of hypot(dx, dy); rot gives both bundles the
focal length of the first. Source: Pessoa 2017 (14-19); Habib et al. 2006.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.calibration.stability.checks import check_options, check_size, common_frame
from tankcal.calibration.stability.expected import covariance_of, expected_px, ideal_derivatives
from tankcal.calibration.stability.fits import resection, rotation_between
from tankcal.calibration.stability.grids import Grid, default_grid
from tankcal.calibration.stability.terrains import SEED, TERRAINS, Terrain
from tankcal.camera.model import correct_image_points, distort_image_points
from tankcal.errors import SolutionError
from tankcal.geometry.rotations import angles_of
from tankcal.messages import message
from tankcal.survey.measurements import CameraSetup

METHODS = ("mis", "zrot", "rot", "spr")
THRESHOLDS_PX = (0.5, 0.33)  # Pessoa's
UNKNOWNS = {"mis": 0, "zrot": 0, "rot": 3, "spr": 6}
UNDONE_MM = 1e-9  # of a measured point that is corrected and distorted again


@dataclass(frozen=True)
class Convention:
    """One choice that a figure depends on: a code and its values (tankcal.record.camera_stability).

    code, values  such as "focal_same", {"of": "first"}
    """

    code: str
    values: Mapping = field(default_factory=dict)


@dataclass(frozen=True)
class Pair:
    """Two calibrations against each other; n grid points.

    a, b           names; a stands before b in the file and is the first set
    figure_px      figure of the method; of spr the root of the mean square over the terrains
    scatter_px     standard deviation of that figure from terrain to terrain, spr; else None
    similar        whether it is below the threshold
    difference_px  (n, 2) second minus first, x to the right and y up, after the method's fit
    expected_px    figure that the declared standard deviations alone would make (root of the mean
                   square, whatever the figure), first order; None: not declared
                   (what follows is of spr on the first terrain)
    scale          factor of the second set, zrot; else None
    rotation_rad   (3,) omega, phi, kappa of R with ray in second = R ray in first; rot, spr; else
                   None
    shift_m        (3,) second projection centre minus first, spr; else None
    """

    a: str
    b: str
    figure_px: float
    similar: bool
    difference_px: np.ndarray
    expected_px: float | None = None
    scale: float | None = None
    rotation_rad: np.ndarray | None = None
    shift_m: np.ndarray | None = None
    scatter_px: float | None = None


@dataclass(frozen=True)
class Stability:
    """All pairs of some calibrations, by one method.

    method        one of METHODS
    as_published  whether Pessoa's conventions are followed
    conventions   tuple of Convention
    grid          Grid of image points        format_px  (columns, lines) of the frame
    threshold_px  similar when the figure is below it
    terrain       Terrain of spr, else None   seed  of its heights
    setups        tuple of CameraSetup, as they were given
    pairs         tuple of Pair: (2, 1), (3, 1), (3, 2), (4, 1) ... as the published tables' rows
    """

    method: str
    as_published: bool
    conventions: tuple[Convention, ...]
    grid: Grid
    format_px: tuple[int, int]
    threshold_px: float
    terrain: Terrain | None
    seed: int
    setups: tuple[CameraSetup, ...]
    pairs: tuple[Pair, ...]


def compare(
    setups,
    method,
    grid=None,
    threshold_px=THRESHOLDS_PX[0],
    terrain=None,
    as_published=False,
    seed=SEED,
    covariances=None,
    file="cameras.toml",
):
    """Compare all pairs of calibrations by one of METHODS (see above).

    Parameters
    ----------
    setups : sequence of CameraSetup
        Two or more with pixels, of one frame.
    method : str
        One of METHODS.
    grid : Grid, optional
        None: Pessoa's in the proportions of the frame.
    threshold_px : float, optional
        Similar below it, px.
    terrain : Terrain, optional
        For spr; None: TERRAINS["I"].
    as_published : bool, optional
        Pessoa's conventions.
    seed : int, optional
        Of the terrain's heights.
    covariances : dict, optional
        {name: (13, 13)} of PARAMETERS where more is known than standard deviations.
    file : str, optional
        What messages call the place where the calibrations stand.

    Returns
    -------
    Stability

    Raises
    ------
    InputError
        For calibrations that cannot be compared.
    SolutionError
        For a pair whose adjustment has no solution.
    """
    setups = tuple(setups)
    check_options(method, METHODS, threshold_px, seed)
    format_px = common_frame(setups, file)
    grid = grid or default_grid(format_px)
    check_size(len(setups), grid, UNKNOWNS[method], file)
    terrain = (terrain or TERRAINS["I"]) if method == "spr" else None
    sets = [_corrected(setup, grid, format_px) for setup in setups]
    depths_m = terrain and [terrain.depths_m(grid.size, seed, i) for i in range(terrain.drawn)]
    known = covariances or {}
    pairs = tuple(
        _pair((first, second), method, as_published, threshold_px, (terrain, depths_m), known)
        for i, second in enumerate(sets)
        for first in sets[:i]
    )
    return Stability(
        method=method,
        as_published=as_published,
        conventions=_conventions(method, as_published, sets, grid, terrain, seed, pairs, known),
        grid=grid,
        format_px=format_px,
        threshold_px=float(threshold_px),
        terrain=terrain,
        seed=seed,
        setups=setups,
        pairs=pairs,
    )


@dataclass(frozen=True)
class _Set:
    """One calibration on the grid: ideal points (n, 2), mm."""

    setup: CameraSetup
    ideal_mm: np.ndarray

    @property
    def name(self):
        return self.setup.camera.name

    @property
    def c_mm(self):
        return float(self.setup.camera.values[0])

    @property
    def pixel_mm(self):
        return self.setup.pixel_mm

    def in_pixels_of(self, other):
        """Ideal points (n, 2), mm, as if its pixels were those of another set.

        For what compares images rather than rays: programs with two focal lengths in pixels give
        each calibration pixels of its own.
        """
        return self.ideal_mm * (other.pixel_mm / self.pixel_mm)


@dataclass(frozen=True)
class _Found:
    """What a method finds of a pair; designs_px: what its fits took out, each (2n, u) or None."""

    figure_px: float
    difference_px: np.ndarray
    designs_px: tuple = (None,)
    scale: float | None = None
    rotation_rad: np.ndarray | None = None
    shift_m: np.ndarray | None = None
    scatter_px: float | None = None


def _corrected(setup, grid, format_px):
    camera = setup.camera
    points_mm = grid.image_points_mm(format_px, setup.pixel_mm)
    with np.errstate(all="ignore"):
        ideal = correct_image_points(points_mm, camera.values, camera.form)
        is_undone = np.all(np.isfinite(ideal))
        if is_undone and camera.form.convention == "distortion_of_ideal":
            again = distort_image_points(ideal, camera.values, camera.form)
            is_undone = np.abs(again - points_mm).max() < UNDONE_MM
    if not is_undone:
        raise SolutionError(
            message(
                "compare_folds",
                "{name}: its distortion cannot be removed at every point of the grid: the "
                "polynomial turns back within the frame",
                name=camera.name,
            )
        )
    return _Set(setup, ideal)


def _pair(pair, method, as_published, threshold_px, ground, known):
    found = _compared(pair, method, as_published, *ground)
    return Pair(
        a=pair[0].name,
        b=pair[1].name,
        figure_px=found.figure_px,
        similar=found.figure_px < threshold_px,
        difference_px=found.difference_px,
        expected_px=_expected(pair, method, as_published, found, known),
        scale=found.scale,
        rotation_rad=found.rotation_rad,
        shift_m=found.shift_m,
        scatter_px=found.scatter_px,
    )


def _compared(pair, method, as_published, terrain, depths_m):
    try:
        if method == "rot":
            return _by_rotation(*pair, as_published)
        if method == "spr":
            return _by_resections(*pair, terrain, depths_m)
    except SolutionError as error:
        text = message(
            "compare_of_pair",
            "{one} and {other}: {error}",
            one=pair[0].name,
            other=pair[1].name,
            error=error.texts[0],
        )
        raise SolutionError(text) from error
    return _by_coordinates(*pair, method, as_published)


def _by_coordinates(first, second, method, as_published):
    """mis and zrot: image points against each other."""
    scale = first.c_mm / second.c_mm if method == "zrot" else None
    second_mm = second.in_pixels_of(first) if scale is None else second.ideal_mm * scale
    difference = (second_mm - first.ideal_mm) / first.pixel_mm
    squares = np.sum(difference**2, axis=1)
    is_mean = as_published and method == "zrot"
    figure = np.mean(np.sqrt(squares)) if is_mean else np.sqrt(np.mean(squares))
    return _Found(float(figure), difference, scale=scale)


def _by_rotation(first, second, as_published):
    second_mm, second_c = second.ideal_mm, second.c_mm
    if as_published:
        second_mm, second_c = second.in_pixels_of(first), first.c_mm
    fit = rotation_between(first.ideal_mm, first.c_mm, second_mm, second_c, first.pixel_mm)
    return _Found(
        fit.sigma0_px, fit.residuals_px, (fit.design_px,), rotation_rad=angles_of(fit.rotation.T)
    )


def _by_resections(first, second, terrain, depths_m):
    """spr: on each of the terrains; everything but the figure is that of the first."""
    found = [_by_resection(first, second, terrain, depth_m) for depth_m in depths_m]
    figures = [one.figure_px for one in found]
    scatter = float(np.std(figures, ddof=1)) if len(figures) > 1 else 0.0
    return replace(
        found[0],
        figure_px=float(np.sqrt(np.mean(np.square(figures)))),
        designs_px=tuple(design for one in found for design in one.designs_px),
        scatter_px=scatter,
    )


def _by_resection(first, second, terrain, depth_m):
    object_m = terrain.object_points_m(first.ideal_mm, first.c_mm, depth_m)
    fit = resection(object_m, second.ideal_mm, second.c_mm, first.pixel_mm, terrain.position_m)
    return _Found(
        fit.sigma0_px,
        -fit.residuals_px,
        (fit.design_px,),
        rotation_rad=angles_of(fit.rotation),
        shift_m=fit.position_m - terrain.position_m,
    )


def _has_own_focal_lengths(method, as_published):
    return method in ("zrot", "spr") or (method == "rot" and not as_published)


def _expected(pair, method, as_published, found, known):
    """expected_px of a pair, or None: a set has no standard deviations."""
    needs_c = _has_own_focal_lengths(method, as_published)
    covariances = [covariance_of(one.setup.camera, known.get(one.name), needs_c) for one in pair]
    if any(one is None for one in covariances):
        return None
    first, second = pair
    parts = [
        ideal_derivatives(one.ideal_mm, one.setup.camera.values, one.setup.camera.form)
        for one in pair
    ]
    if needs_c:
        parts[0][:, :, 0] = -first.ideal_mm / first.c_mm
        parts[1][:, :, 0] = -second.ideal_mm / second.c_mm
        parts[1] = parts[1] * (first.c_mm / second.c_mm)
    in_pixels = [(part / first.pixel_mm[:, None]).reshape(-1, part.shape[2]) for part in parts]
    points = len(first.ideal_mm)
    unknowns = UNKNOWNS[method]
    divisor = 2 * points - unknowns if unknowns else points
    of_terrains = [
        expected_px(zip(in_pixels, covariances, strict=True), design, divisor)
        for design in found.designs_px
    ]
    return float(np.sqrt(np.mean(np.square(of_terrains))))


def _conventions(method, as_published, sets, grid, terrain, seed, pairs, known):
    unknowns = UNKNOWNS[method]
    if unknowns:
        figure = Convention("figure_sigma0", {"points": grid.size, "unknowns": unknowns})
    else:
        is_mean = as_published and method == "zrot"
        figure = Convention("figure_mean_distance" if is_mean else "figure_rmse")
    focal = {
        "mis": Convention("focal_as_they_are"),
        "zrot": Convention("focal_scaled", {"of": "second", "to": "first"}),
        "spr": Convention("focal_own"),
        "rot": Convention("focal_same", {"of": "first"}) if as_published else None,
    }[method] or Convention("focal_own")
    x_um, y_um = (1000 * sets[0].pixel_mm).tolist()
    listed = [
        figure,
        focal,
        Convention("direction", {"from": "second", "to": "first"}),
        Convention("pixel", {"x_um": x_um, "y_um": y_um}),
    ]
    if terrain is not None:
        values = {"position_m": list(terrain.position_m), "low_m": terrain.low_m}
        listed.append(
            Convention(
                "terrain_random",
                {**values, "range_m": terrain.range_m, "seed": seed, "terrains": terrain.drawn},
            )
        )
    if any(pair.expected_px is not None for pair in pairs):
        full = [one.name for one in sets if one.name in known]
        sds = Convention("covariance_known", {"cameras": full}) if full else None
        listed.append(sds or Convention("sds_uncorrelated"))
    return tuple(listed)
