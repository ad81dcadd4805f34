"""Fit of two bundles of rays, and the difference expected from their standard deviations.

With (u, v, w) = R (X - S) the ideal image of a point X is -c u / w, -c v / w (see
tankcal.camera.model). The rotation R, and optionally the projection centre S, are adjusted to image
points:

    fit_rotation     X: the rays (x, y, -c) of the second bundle; image: that of the first
    fit_resection    X: object points; image: that of the second bundle

by least squares in pixels, sigma0 = sqrt(v'v / (2n - u)), u = 3 or 6 unknowns. The initial rotation
minimises the distances between the unit vectors of the rays (Wahba's problem, solved by singular
values), so that the rotation may have any size.

The ideal point xi of a measured point m(xi, q) depends on the interior parameters q:
d xi = -(d m / d xi)^-1 (d m / d q) dq. J contains these derivatives over the grid, in pixels. P is
the projection that removes the fitted parameters. To first order, the standard deviations of both
calibrations alone give

    expected = sqrt(trace(P (J1 C1 J1' + J2 C2 J2') P) / divisor)

Source: Pessoa 2017 (17-19); Habib, Pullivelli, Mitishita, Ghanma & Kim 2006; Markley 1988; JCGM
100.

Grids of image points and random terrain for the comparison of calibrations of a camera.

The image coordinates of column C and line L, counted from the centre of the first pixel, are

    x = (C - (columns - 1) / 2) pixel      y = -(L - (lines - 1) / 2) pixel

Source: Pessoa 2017 (1, 2; grid of section 7 of its method: 46 x 35 points from (50, 50), 100 px
apart, on 4608 x 3456 px).

Random terrain for resections
-----------------------------

The camera looks down from a position. Each image point sees the terrain at a random height

    Z = low + U(0, 1) range

Only ratios of depths affect the residuals of a resection, not their size. Source: Pessoa 2017,
section of the method SPR: position (300, 300, 450) m, Z = 200 + U(0, 1) 100 (terrain I) or 20
(terrain II).
"""

import re
from dataclasses import dataclass

import numpy as np

from tankcal.adjust import adjust
from tankcal.camera.imaging import ideal_point, image_point_derivatives
from tankcal.errors import InputError, Problem, SolutionError
from tankcal.geometry.rotations import apply_small_rotation, vector_derivatives
from tankcal.messages import message

STEPS_ON_LONGEST_SIDE = 46.08  # Pessoa: 4608 px in steps of 100 px
MOST_POINTS = 250_000  # largest number of points of a grid
_NUMBER = r"([0-9]{1,6}(?:\.[0-9]{1,6})?)"
_FORM = re.compile(rf"([0-9]{{1,6}})[xX]([0-9]{{1,6}}),{_NUMBER},{_NUMBER},{_NUMBER}")
EXPECTED = message(
    "compare_grid_form",
    "expected COLUMNSxROWS,FIRST_COLUMN,FIRST_LINE,STEP in pixels, such as 46x35,50,50,100",
)
SEED = 1  # default seed of the heights
DRAWN = 10  # number of random terrains for one figure
_SIGNED_NUMBER = r"(-?[0-9]{1,6}(?:\.[0-9]{1,6})?)"
_PAIR = re.compile(rf"{_SIGNED_NUMBER},{_SIGNED_NUMBER}")


@dataclass(frozen=True)
class Fit:
    """Orientation adjusted to n image points with u unknowns.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        Rotation R.
    position_m : ndarray, shape (3,)
        Projection centre S, m; zeros if it is not adjusted.
    residuals_px : ndarray, shape (n, 2)
        Computed minus given image points, px.
    sigma0_px : float
        sqrt(v'v / (2n - u)), px.
    design_px : ndarray, shape (2n, u)
        Derivatives of the image points, with x and y of each point in turn.
    """

    rotation: np.ndarray
    position_m: np.ndarray
    residuals_px: np.ndarray
    sigma0_px: float
    design_px: np.ndarray


def rays(ideal_mm, c_mm):
    """Rays (x, y, -c), shape (n, 3), of ideal image points (n, 2)."""
    return np.column_stack([ideal_mm, np.full(len(ideal_mm), -float(c_mm))])


def find_nearest_rotation(to, of):
    """Rotation R (3, 3) that minimises |to - R of|^2, with `to` and `of` (n, 3) as unit vectors."""
    to, of = (vectors / np.linalg.norm(vectors, axis=1)[:, None] for vectors in (to, of))
    # The sign makes the determinant +1, a rotation without reflection.
    left, _, right = np.linalg.svd(to.T @ of)
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    return left @ np.diag([1.0, 1.0, sign]) @ right


def fit_rotation(first_mm, first_c_mm, second_mm, second_c_mm, pixel_mm):
    """Fit the rotation of the second bundle onto the first, in the image of the first.

    Parameters
    ----------
    first_mm, second_mm : ndarray, shape (n, 2)
        Ideal image points of the same n measured points, mm.
    first_c_mm, second_c_mm : float
        Focal lengths of the bundles, mm.
    pixel_mm : ndarray, shape (2,)
        Sides of a pixel, mm.

    Returns
    -------
    Fit

    Raises
    ------
    SolutionError
        If the points do not determine the rotation.
    """
    second = rays(second_mm, second_c_mm)
    start = find_nearest_rotation(rays(first_mm, first_c_mm), second)
    return _fit_orientation(second, first_mm, first_c_mm, pixel_mm, start, None)


def fit_resection(object_m, image_mm, c_mm, pixel_mm, position_m):
    """Fit rotation and projection centre of an image of object points.

    Parameters
    ----------
    object_m : ndarray, shape (n, 3)
        Object points, m.
    image_mm : ndarray, shape (n, 2)
        Ideal image points, mm.
    c_mm : float
        Focal length, mm.
    pixel_mm : ndarray, shape (2,)
        Sides of a pixel, mm.
    position_m : array_like, shape (3,)
        Initial projection centre, m.

    Returns
    -------
    Fit

    Raises
    ------
    SolutionError
        If the points do not determine the orientation.
    """
    start = find_nearest_rotation(rays(image_mm, c_mm), object_m - position_m)
    return _fit_orientation(
        object_m, image_mm, c_mm, pixel_mm, start, np.asarray(position_m, dtype=float)
    )


def make_orientation_model(place, c_mm, start, pixel_mm):
    """Create the model of an orientation for `adjust`.

    The unknowns are the rotation vector d of exp([d]x) start and, if there are six, the projection
    centre. The observations are image points in pixels, with x and y of each point in turn.

    Parameters
    ----------
    place : ndarray, shape (n, 3)
        Points X.
    c_mm : float
        Focal length, mm.
    start : ndarray, shape (3, 3)
        Initial rotation.
    pixel_mm : array_like, shape (2,)
        Sides of a pixel, mm.

    Returns
    -------
    callable
        model(x, image_px) returns misclosures, design matrix and None.
    """

    def model(x, image_px):
        turn = x[None, :3]
        rotation = apply_small_rotation(start[None], turn)[0]
        position = x[3:] if len(x) > 3 else np.zeros(3)
        seen = rotation @ (place - position).T
        if np.any(seen[2] >= 0):
            raise SolutionError(
                message(
                    "compare_behind",
                    "points behind the camera; expected bundles of rays of one camera",
                )
            )
        xi, eta, by_x, by_y = ideal_point(*seen, rotation.ravel(), c_mm)
        by = np.stack([np.column_stack(by_x[:6]), np.column_stack(by_y[:6])], axis=1)
        by /= np.asarray(pixel_mm)[:, None]
        by = by.reshape(-1, 6)
        # Chain rule: from small rotations to the rotation vector
        of_turn = by[:, 3:] @ np.linalg.inv(vector_derivatives(turn)[0])
        design = of_turn if len(x) == 3 else np.column_stack([of_turn, -by[:, :3]])
        return (np.column_stack([xi, eta]) / pixel_mm).ravel() - image_px, design, None

    return model


def _fit_orientation(place, image_mm, c_mm, pixel_mm, start, position):
    """Fit the rotation, and the projection centre unless `position` is None; return a Fit."""
    model = make_orientation_model(place, c_mm, start, pixel_mm)
    unknowns = np.zeros(3) if position is None else np.append(np.zeros(3), position)
    image = (image_mm / pixel_mm).ravel()
    if len(image) <= len(unknowns):
        raise SolutionError(
            message(
                "compare_fit_few",
                "{points} points for {unknowns} unknowns: too few",
                points=len(place),
                unknowns=len(unknowns),
            )
        )
    adjusted = adjust(model, unknowns, image, np.ones(len(image)))
    x = adjusted.unknowns
    misclosure, design, _ = model(x, image)
    return Fit(
        rotation=apply_small_rotation(start[None], x[None, :3])[0],
        position_m=np.zeros(3) if position is None else x[3:],
        residuals_px=misclosure.reshape(-1, 2),
        sigma0_px=float(np.sqrt(misclosure @ misclosure / adjusted.dof)),
        design_px=design,
    )


def ideal_derivatives(ideal_mm, interior, form):
    """Derivatives of ideal image points by PARAMETERS, for fixed measured points.

    Parameters
    ----------
    ideal_mm : ndarray, shape (n, 2)
        Ideal image points relative to the principal point, mm.
    interior : array_like, shape (13,)
        Interior parameters.
    form : tankcal.camera.model.Form
        Form of the distortion model.

    Returns
    -------
    ndarray, shape (n, 2, 13)
        Derivatives; zero for c, because the points are in mm and not directions.
    """
    is_of_ideal = form.convention == "distortion_of_ideal"
    q = tuple(np.asarray(interior, dtype=float))
    rays = (*(ideal_mm.T / q[0]), -np.ones(len(ideal_mm)))
    rows = image_point_derivatives(rays, np.eye(3).ravel(), q, form.numbers, is_of_ideal)[2:]
    derivatives = np.stack([np.column_stack(np.broadcast_arrays(*row)) for row in rows], axis=1)
    by_point, by_parameters = derivatives[:, :, :2] / q[0], derivatives[:, :, 6:]
    by_parameters[:, :, 0] = 0.0
    return -np.linalg.solve(by_point, by_parameters)


def camera_covariance(camera, known=None, needs_c=True):
    """Covariance matrix of the parameters of a camera.

    Parameters
    ----------
    camera : network.Camera
        Camera with values and standard deviations. A parameter with value 0 and without standard
        deviation is not in the model.
    known : array_like, shape (13, 13), optional
        Covariance matrix; by default the parameters are uncorrelated.
    needs_c : bool, optional
        Whether the figure depends on c. If not, c needs no standard deviation.

    Returns
    -------
    ndarray, shape (13, 13), or None
        None if a standard deviation is missing.
    """
    if known is not None:
        return np.asarray(known, dtype=float)
    sd = np.where(np.isnan(camera.sd) & (np.asarray(camera.values) == 0), 0.0, camera.sd)
    if not needs_c:
        sd[0] = 0.0
    return None if np.any(np.isnan(sd)) or not np.any(sd) else np.diag(sd**2)


def compute_expected_px(parts, design_px, divisor):
    """Expected figure of stability (see the module docstring), px.

    Parameters
    ----------
    parts : iterable of tuple
        Derivatives (2n, 13) and covariance matrix (13, 13) of each calibration.
    design_px : ndarray, shape (2n, u), or None
        Design matrix of the fit of the method.
    divisor : float
        Degrees of freedom of the fit, or number of points without a fit.

    Returns
    -------
    float
    """
    total = 0.0
    # P = I - Q Q', with an orthonormal basis Q of the design matrix
    basis = None
    if design_px is not None:
        basis = np.linalg.qr(design_px / np.linalg.norm(design_px, axis=0))[0]
    for derivatives, covariance in parts:
        projected = derivatives if basis is None else derivatives - basis @ (basis.T @ derivatives)
        total += float(np.sum((projected @ covariance) * projected))
    return float(np.sqrt(max(total, 0.0) / divisor))


# ---- grids of image points and random terrain for the comparison of calibrations of a camera


@dataclass(frozen=True)
class Grid:
    """Square grid of image points, row by row from the first line downwards.

    Attributes
    ----------
    columns, rows : int
        Number of points in each direction.
    start_px : tuple of float
        Column and line of the first point, px.
    step_px : float
        Distance between neighbours in both directions, px.
    """

    columns: int
    rows: int
    start_px: tuple[float, float]
    step_px: float

    @property
    def size(self):
        """Number of points."""
        return self.columns * self.rows

    @property
    def places_px(self):
        """Column and line of each point, shape (size, 2), px."""
        column = self.start_px[0] + self.step_px * np.arange(self.columns)
        line = self.start_px[1] + self.step_px * np.arange(self.rows)
        return np.column_stack([part.ravel() for part in np.meshgrid(column, line)])

    def image_points_mm(self, format_px, pixel_mm):
        """Image coordinates of the points from the centre, mm, x to the right and y upwards.

        Parameters
        ----------
        format_px : tuple of int
            Columns and lines of the frame.
        pixel_mm : ndarray, shape (2,)
            Sides of a pixel, mm.

        Returns
        -------
        ndarray, shape (size, 2)

        Raises
        ------
        InputError
            If a point is outside the frame.
        """
        first = np.array(self.start_px)
        last = first + self.step_px * np.array([self.columns - 1, self.rows - 1])
        size = np.array(format_px, dtype=float)
        if np.any(first < -0.5) or np.any(last > size - 0.5):
            raise InputError(
                Problem(
                    "--grid",
                    message(
                        "compare_grid_off",
                        "columns {first_column:g} to {last_column:g}, lines {first_line:g} "
                        "to {last_line:g}; expected the whole grid on the frame of "
                        "{columns:g} x {lines:g} px",
                        first_column=first[0],
                        last_column=last[0],
                        first_line=first[1],
                        last_line=last[1],
                        columns=size[0],
                        lines=size[1],
                    ),
                )
            )
        return (self.places_px - (size - 1) / 2) * pixel_mm * [1, -1]

    def __str__(self):
        x, y = self.start_px
        return f"{self.columns}x{self.rows},{x:.9g},{y:.9g},{self.step_px:.9g}"


def default_grid(format_px):
    """Create the grid of Pessoa in the proportions of a frame (columns, lines).

    On 4608 x 3456 px it equals his grid. The step is the longest side / 46.08, and the first point
    is half a step from the corner. A frame narrower than one step has one row along its middle.
    """
    size = np.array(format_px, dtype=float)
    step = float(size.max()) / STEPS_ON_LONGEST_SIDE
    start = np.minimum(step / 2, (size - 1) / 2)
    columns, rows = np.floor((size - 1 - start) / step + 1e-9).astype(int) + 1
    return Grid(int(columns), int(rows), tuple(start.tolist()), step)


def parse_grid(text):
    """Parse a grid from a text such as 46x35,50,50,100.

    Raises
    ------
    InputError
        If the text has another form.

    Examples
    --------
    >>> print(parse_grid("46x35,50,50,100"))
    46x35,50,50,100
    """
    match = _FORM.fullmatch(text.replace(" ", "")) if len(text) <= 80 else None
    if match is None:
        expected = message(
            "compare_no_grid", "found {found!r}; {expected}", found=text[:60], expected=EXPECTED
        )
        raise InputError(Problem("--grid", expected))
    columns, rows = int(match[1]), int(match[2])
    x, y, step = (float(part) for part in match.groups()[2:])
    if columns * rows == 0 or columns * rows > MOST_POINTS or step == 0:
        expected = message(
            "compare_grid_size",
            "found {found!r}; expected 1 to {most} points and a step above 0",
            found=text[:60],
            most=MOST_POINTS,
        )
        raise InputError(Problem("--grid", expected))
    return Grid(columns, rows, (x, y), step)


@dataclass(frozen=True)
class Terrain:
    """Random terrain below a camera that looks down.

    Attributes
    ----------
    position_m : tuple of float
        Projection centre (x, y, z) of the first bundle, m.
    low_m, range_m : float
        Lowest height, and range of the heights above it, m; a range of 0 is flat.
    """

    position_m: tuple[float, float, float] = (300.0, 300.0, 450.0)
    low_m: float = 200.0
    range_m: float = 100.0

    @property
    def drawn(self):
        """Number of random terrains for one figure; one for flat terrain."""
        return DRAWN if self.range_m else 1

    def depths_m(self, points, seed, number=0):
        """Random depths of the terrain below the camera.

        Parameters
        ----------
        points : int
            Number of points.
        seed, number : int
            Seed, and number of the terrain; they reproduce the depths.

        Returns
        -------
        ndarray, shape (points,)
            Depths, m.
        """
        rng = np.random.default_rng((seed, number) if number else seed)
        return self.position_m[2] - self.low_m - rng.random(points) * self.range_m

    def object_points_m(self, ideal_mm, c_mm, depth_m):
        """Object points on the rays of image points.

        Parameters
        ----------
        ideal_mm : ndarray, shape (n, 2)
            Ideal image points, mm.
        c_mm : float
            Focal length, mm.
        depth_m : ndarray, shape (n,)
            Depths below the camera, m.

        Returns
        -------
        ndarray, shape (n, 3)
            Object points, m.
        """
        along = np.column_stack([ideal_mm / c_mm, np.full(len(ideal_mm), -1.0)])
        return np.asarray(self.position_m) + along * depth_m[:, None]


TERRAINS = {"I": Terrain(), "II": Terrain(range_m=20.0)}


def parse_terrain(text):
    """Parse a terrain from a text: I, II, or LOW,RANGE in metres.

    Raises
    ------
    InputError
        If the text has another form.

    Examples
    --------
    >>> terrain = parse_terrain("100,20")
    >>> terrain.low_m, terrain.range_m
    (100.0, 20.0)
    """
    plain = text.strip()
    if plain.upper() in TERRAINS:
        return TERRAINS[plain.upper()]
    match = _PAIR.fullmatch(plain.replace(" ", "")) if len(plain) <= 40 else None
    camera_m = Terrain().position_m[2]
    if match is not None:
        low, extent = (float(part) for part in match.groups())
        if extent >= 0 and low + extent < camera_m:
            return Terrain(low_m=low, range_m=extent)
    raise InputError(
        Problem(
            "--terrain",
            message(
                "compare_terrain",
                "found {found!r}; expected I, II, or LOW,RANGE in metres with a range of 0 or more "
                "and all of it below the camera at {height:g} m, such as 200,100",
                found=text[:60],
                height=camera_m,
            ),
        )
    )
