"""Four tests whether two calibrations of a camera give equal bundles of rays.

A grid of image points is corrected with both calibrations. With the ideal points (x1, y1), (x2, y2)
and the focal lengths c1, c2, the figure of a pair, in pixels, is

    mis   sqrt(mean(dx^2 + dy^2)) of (x2, y2) - (x1, y1). No unknowns; c has no influence
    zrot  sqrt(mean(dx^2 + dy^2)) of (x2, y2) c1/c2 - (x1, y1). Both at the image distance of the
          first; the figure is zero if both bundles are equal in space
    rot   sigma0 = sqrt(v'v/(2n - 3)) after rotation of the second bundle onto the first. A rotation
          of the bundle, and most of a shift of the principal point, has no influence
    spr   sigma0 = sqrt(v'v/(2n - 6)) of a resection with the second bundle, for points that the
          first bundle sees on a terrain; pooled over ten random terrains. Rotation and shift of the
          camera have no influence, nor has c on flat ground. The remaining difference is the
          effect on an adjustment with free orientation

mis does not depend on the order of a pair. To first order the other figures change only by the
factor c1/c2 of the image in which they are computed: the first image (spr: the second). Two
calibrations are similar if the figure is below the accuracy of image coordinates (Pessoa: 0.5 or
0.33 px).

With as_published, Pessoa's definitions are used: zrot is the mean of hypot(dx, dy), and rot uses
the focal length of the first for both bundles. Source: Pessoa 2017 (14-19); Habib et al. 2006.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tankcal.calibration.stability.fits import (
    SEED,
    TERRAINS,
    Grid,
    Terrain,
    camera_covariance,
    compute_expected_px,
    default_grid,
    fit_resection,
    fit_rotation,
    ideal_derivatives,
)
from tankcal.camera.model import correct_image_points, distort_image_points
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.rotations import angles_of
from tankcal.messages import message
from tankcal.survey.measurements import CameraSetup

METHODS = ("mis", "zrot", "rot", "spr")
THRESHOLDS_PX = (0.5, 0.33)  # thresholds of Pessoa
UNKNOWNS = {"mis": 0, "zrot": 0, "rot": 3, "spr": 6}  # number of unknowns of each method
# Largest relative difference of pixel sizes; programs with two focal lengths give slightly
# different pixels for each calibration
SAME_PIXEL = 2e-3
MOST_DIFFERENCES = 20_000_000  # largest number of pairs times grid points
UNDONE_MM = 1e-9  # tolerance of a point after correction and renewed distortion, mm


@dataclass(frozen=True)
class Convention:
    """Convention of a figure: a code and its values (tankcal.record.camera).

    Example: "focal_same", {"of": "first"}.
    """

    code: str
    values: Mapping = field(default_factory=dict)


@dataclass(frozen=True)
class Pair:
    """Comparison of two calibrations at n grid points.

    For spr, `difference_px`, `rotation_rad` and `shift_m` refer to the first terrain.

    Attributes
    ----------
    a, b : str
        Names of the first and the second calibration, in the order of the file.
    figure_px : float
        Figure of the method, px; for spr the root mean square over the terrains.
    similar : bool
        Whether the figure is below the threshold.
    difference_px : ndarray, shape (n, 2)
        Second minus first after the fit of the method, px, x to the right and y upwards.
    expected_px : float or None
        Root mean square expected from the declared standard deviations alone, to first order, px;
        None if they are not declared.
    scale : float or None
        Scale factor of the second calibration (zrot only).
    rotation_rad : ndarray, shape (3,), or None
        omega, phi, kappa of R, where ray in second = R ray in first (rot and spr only).
    shift_m : ndarray, shape (3,), or None
        Second projection centre minus first, m (spr only).
    scatter_px : float or None
        Standard deviation of the figure between terrains, px (spr only).
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
    """Comparison of all pairs of calibrations by one method.

    Attributes
    ----------
    method : str
        One of METHODS.
    as_published : bool
        Whether Pessoa's conventions are followed.
    conventions : tuple of Convention
        Conventions of the figures.
    grid : Grid
        Grid of image points.
    format_px : tuple of int
        Columns and lines of the frame.
    threshold_px : float
        Threshold below which two calibrations are similar, px.
    terrain : Terrain or None
        Terrain of spr.
    seed : int
        Seed of the heights of the terrain.
    setups : tuple of CameraSetup
        Calibrations in the given order.
    pairs : tuple of Pair
        Pairs (2, 1), (3, 1), (3, 2), (4, 1) ..., the order of the rows in the published tables.
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
    """Compare all pairs of calibrations by one of METHODS (see the module docstring).

    Parameters
    ----------
    setups : sequence of CameraSetup
        Two or more calibrations with pixels, of one frame.
    method : str
        One of METHODS.
    grid : Grid, optional
        Grid of image points; by default the grid of Pessoa in the proportions of the frame.
    threshold_px : float, optional
        Threshold below which two calibrations are similar, px.
    terrain : Terrain, optional
        Terrain of spr; by default TERRAINS["I"].
    as_published : bool, optional
        Whether Pessoa's conventions are followed.
    seed : int, optional
        Seed of the heights of the terrain.
    covariances : dict, optional
        {name: covariance matrix (13, 13) of PARAMETERS} of cameras for which correlations are
        known.
    file : str, optional
        Name of the file of the calibrations in messages.

    Returns
    -------
    Stability

    Raises
    ------
    InputError
        If the calibrations cannot be compared.
    SolutionError
        If the adjustment of a pair has no solution.
    """
    setups = tuple(setups)
    _check_options(method, threshold_px, seed)
    format_px = _find_common_frame(setups, file)
    grid = grid or default_grid(format_px)
    _check_size(len(setups), grid, UNKNOWNS[method], file)
    terrain = (terrain or TERRAINS["I"]) if method == "spr" else None
    sets = [_correct_grid(setup, grid, format_px) for setup in setups]
    depths_m = terrain and [terrain.depths_m(grid.size, seed, i) for i in range(terrain.drawn)]
    known = covariances or {}
    pairs = tuple(
        _make_pair((first, second), method, as_published, threshold_px, (terrain, depths_m), known)
        for i, second in enumerate(sets)
        for first in sets[:i]
    )
    return Stability(
        method=method,
        as_published=as_published,
        conventions=_list_conventions(
            method, as_published, sets, grid, terrain, seed, pairs, known
        ),
        grid=grid,
        format_px=format_px,
        threshold_px=float(threshold_px),
        terrain=terrain,
        seed=seed,
        setups=setups,
        pairs=pairs,
    )


def _check_options(method, threshold_px, seed):
    """Raise InputError for an invalid method, threshold (px) or seed."""
    problems = []
    if method not in METHODS:
        expected = message(
            "compare_method",
            "found {found!r}; expected {methods}",
            found=str(method)[:60],
            methods=", ".join(METHODS),
        )
        problems.append(Problem("--method", expected))
    if not (np.isfinite(threshold_px) and threshold_px > 0):
        expected = message(
            "compare_threshold",
            "found {found}; expected pixels above 0, such as 0.5 or 0.33",
            found=threshold_px,
        )
        problems.append(Problem("--threshold", expected))
    if seed < 0:
        problems.append(
            Problem(
                "--seed",
                message(
                    "compare_seed", "found {seed}; expected a whole number, 0 or more", seed=seed
                ),
            )
        )
    if problems:
        raise InputError(problems)


def _check_size(cameras, grid, unknowns, file):
    """Raise InputError for too few points for the unknowns, or too many differences for memory.

    Parameters
    ----------
    cameras : int
        Number of calibrations.
    grid : Grid
        Grid of image points.
    unknowns : int
        Number of unknowns of the method.
    file : str
        Name of the file of the calibrations in messages.
    """
    if 2 * grid.size <= unknowns:
        expected = message(
            "compare_few_points",
            "{count} points; expected more than {least} for this method",
            count=grid.size,
            least=unknowns // 2,
        )
        raise InputError(Problem("--grid", expected))
    count = cameras * (cameras - 1) // 2
    if count * grid.size > MOST_DIFFERENCES:
        expected = message(
            "compare_too_many",
            "{count} pairs of {points} points; expected fewer calibrations or points",
            count=count,
            points=grid.size,
        )
        raise InputError(Problem(file, expected))


def _find_common_frame(setups, file):
    """Common frame (columns, lines); raise InputError if the frames differ."""
    if len(setups) < 2:
        expected = message(
            "compare_too_few",
            "{count} calibration; expected two or more to compare",
            count=len(setups) or message("compare_none", "no"),
        )
        raise InputError(Problem(file, expected))
    lacking = [setup.camera.name for setup in setups if setup.pixel_mm is None]
    if lacking:
        expected = message(
            "compare_no_pixel", "the size of a pixel is not known; expected format_px with pixel_um"
        )
        raise InputError([Problem(file, expected, None, name) for name in lacking])
    first, frame = setups[0], setups[0].format_px
    problems = []
    for setup_to_check in setups[1:]:
        complaint = _why_not_comparable(setup_to_check, first, frame)
        if complaint:
            problems.append(Problem(file, complaint, None, setup_to_check.camera.name))
    if problems:
        raise InputError(problems)
    return int(frame[0]), int(frame[1])


def _why_not_comparable(setup, first, frame):
    """Message why a setup cannot be compared with the first, or None."""
    first_name = first.camera.name
    if np.any(setup.format_px != frame):
        return message(
            "compare_frame",
            "a frame of {found} px; expected {frame}, as {first} has",
            found=_format_sides(setup.format_px),
            frame=_format_sides(frame),
            first=first_name,
        )
    if np.all(np.abs(setup.pixel_mm / first.pixel_mm - 1) <= SAME_PIXEL):
        return None
    return message(
        "compare_pixel",
        "a pixel of {found} micrometres; expected that of {first}, {pixel}, within {percent:g} %",
        found=_format_sides(1000 * setup.pixel_mm),
        first=first_name,
        pixel=_format_sides(1000 * first.pixel_mm),
        percent=100 * SAME_PIXEL,
    )


def _format_sides(pair):
    return f"{pair[0]:.8g} x {pair[1]:.8g}"


@dataclass(frozen=True)
class _CorrectedSet:
    """One calibration, with the ideal points (n, 2) of the grid, mm."""

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

    def scale_to_pixels(self, other):
        """Ideal points (n, 2), mm, scaled to the pixels of another set.

        For comparisons of images rather than rays. Programs with two focal lengths in pixels give
        each calibration different pixels.
        """
        return self.ideal_mm * (other.pixel_mm / self.pixel_mm)


@dataclass(frozen=True)
class _MethodResult:
    """Result of a method for a pair; `designs_px` are the design matrices (2n, u) of its fits."""

    figure_px: float
    difference_px: np.ndarray
    designs_px: tuple = (None,)
    scale: float | None = None
    rotation_rad: np.ndarray | None = None
    shift_m: np.ndarray | None = None
    scatter_px: float | None = None


def _correct_grid(setup, grid, format_px):
    """Correct the grid with a calibration; raise SolutionError if it folds the frame."""
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
    return _CorrectedSet(setup, ideal)


def _make_pair(pair, method, as_published, threshold_px, ground, known):
    """Compare two corrected sets; `ground` is the terrain and its depths, or None and None."""
    result = _compare_pair(pair, method, as_published, *ground)
    return Pair(
        a=pair[0].name,
        b=pair[1].name,
        figure_px=result.figure_px,
        similar=result.figure_px < threshold_px,
        difference_px=result.difference_px,
        expected_px=_compute_expected_figure(pair, method, as_published, result, known),
        scale=result.scale,
        rotation_rad=result.rotation_rad,
        shift_m=result.shift_m,
        scatter_px=result.scatter_px,
    )


def _compare_pair(pair, method, as_published, terrain, depths_m):
    """_MethodResult of a pair; an error names both calibrations."""
    try:
        if method == "rot":
            return _compare_rotation(*pair, as_published)
        if method == "spr":
            return _compare_resections(*pair, terrain, depths_m)
    except SolutionError as error:
        text = message(
            "compare_of_pair",
            "{one} and {other}: {error}",
            one=pair[0].name,
            other=pair[1].name,
            error=error.texts[0],
        )
        raise SolutionError(text) from error
    return _compare_coordinates(*pair, method, as_published)


def _compare_coordinates(first, second, method, as_published):
    """Compare image points without a fit (mis and zrot)."""
    scale = first.c_mm / second.c_mm if method == "zrot" else None
    second_mm = second.scale_to_pixels(first) if scale is None else second.ideal_mm * scale
    difference = (second_mm - first.ideal_mm) / first.pixel_mm
    squares = np.sum(difference**2, axis=1)
    is_mean = as_published and method == "zrot"
    figure = np.mean(np.sqrt(squares)) if is_mean else np.sqrt(np.mean(squares))
    return _MethodResult(float(figure), difference, scale=scale)


def _compare_rotation(first, second, as_published):
    second_mm, second_c = second.ideal_mm, second.c_mm
    if as_published:
        second_mm, second_c = second.scale_to_pixels(first), first.c_mm
    fit = fit_rotation(first.ideal_mm, first.c_mm, second_mm, second_c, first.pixel_mm)
    return _MethodResult(
        fit.sigma0_px, fit.residuals_px, (fit.design_px,), rotation_rad=angles_of(fit.rotation.T)
    )


def _compare_resections(first, second, terrain, depths_m):
    """Compare by resections on all terrains (spr); all but the figure is from the first terrain."""
    results = [_compare_resection(first, second, terrain, depth_m) for depth_m in depths_m]
    figures = [result.figure_px for result in results]
    scatter = float(np.std(figures, ddof=1)) if len(figures) > 1 else 0.0
    return replace(
        results[0],
        figure_px=float(np.sqrt(np.mean(np.square(figures)))),
        designs_px=tuple(design for result in results for design in result.designs_px),
        scatter_px=scatter,
    )


def _compare_resection(first, second, terrain, depth_m):
    object_m = terrain.object_points_m(first.ideal_mm, first.c_mm, depth_m)
    fit = fit_resection(object_m, second.ideal_mm, second.c_mm, first.pixel_mm, terrain.position_m)
    return _MethodResult(
        fit.sigma0_px,
        -fit.residuals_px,
        (fit.design_px,),
        rotation_rad=angles_of(fit.rotation),
        shift_m=fit.position_m - terrain.position_m,
    )


def _compute_expected_figure(pair, method, as_published, result, known):
    """Expected figure of a pair, px, or None if a calibration has no standard deviations."""
    # Figures of these methods depend on the focal lengths of both bundles.
    needs_c = method in ("zrot", "spr") or (method == "rot" and not as_published)
    covariances = [
        camera_covariance(calibration.setup.camera, known.get(calibration.name), needs_c)
        for calibration in pair
    ]
    if any(covariance is None for covariance in covariances):
        return None
    first, second = pair
    parts = [
        ideal_derivatives(
            calibration.ideal_mm, calibration.setup.camera.values, calibration.setup.camera.form
        )
        for calibration in pair
    ]
    # Derivatives by both focal lengths, at the scale of the first.
    if needs_c:
        parts[0][:, :, 0] = -first.ideal_mm / first.c_mm
        parts[1][:, :, 0] = -second.ideal_mm / second.c_mm
        parts[1] = parts[1] * (first.c_mm / second.c_mm)
    in_pixels = [(part / first.pixel_mm[:, None]).reshape(-1, part.shape[2]) for part in parts]
    points = len(first.ideal_mm)
    unknowns = UNKNOWNS[method]
    divisor = 2 * points - unknowns if unknowns else points
    figures = [
        compute_expected_px(zip(in_pixels, covariances, strict=True), design, divisor)
        for design in result.designs_px
    ]
    return float(np.sqrt(np.mean(np.square(figures))))


def _list_conventions(method, as_published, sets, grid, terrain, seed, pairs, known):
    """Conventions that the figures of all pairs depend on, in the order of reading."""
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
        full = [calibration.name for calibration in sets if calibration.name in known]
        sds = Convention("covariance_known", {"cameras": full}) if full else None
        listed.append(sds or Convention("sds_uncorrelated"))
    return tuple(listed)
