"""Shell as a single body: separation of wall and clutter, axis and tilt.

A survey also hits stairs, pipes and the roof. A consensus of circles finds the wall. A leaning
cylinder with one radius for each course refines it. Data snooping about the smooth form of the
shell rejects points clearly in front of the wall, the worst points first. Then the field of the
wall tests each point against all other points: points that agree with each other belong to the wall
and are no blunders.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.geometry.clutter import (
    LEAST_NOISE_M,
    NO_COLUMN,
    distances_from_axis,
    find_buckles,
    find_columns,
    find_form,
    find_rings,
    find_seams,
    shell_problem,
)
from tankcal.geometry.field.blunders import find_blunders, find_uprights
from tankcal.geometry.field.sites import Sites, spans_of
from tankcal.messages import message

# Half width of the band about the wall, relative to the nominal radius: at the start and the end.
WIDE_BAND, WALL_BAND = 0.03, 0.01
LEAST_BAND_M = 0.08  # least half width: buckles and ovalities of small tanks are as deep
END_TOLERANCE_M = 0.020  # a point this far above or below the shell still belongs to its edge
SAMPLES = 1000  # three-point circles; with 50 % clutter, one in eight has three points of the wall
BELIEVED_M = 0.013  # smaller departures from the smooth form are left to the test by the field
AT_ONCE = 16  # circles in one array operation
LEAST_PART = 0.5  # least share of the wall in the points between bottom and top
WIDEST_SLOPE = 0.05  # prior sd of the slope: tanks rarely lean by more
NEAR_M = 0.3  # distance from the wall within which an object may show only its side in the band
VAGUE_TILT = 2e-3  # sd above which the tilt counts as not determined by the points
UNDECIDED = "undecided"  # reason of a point that may belong to the wall or to a fitting
OVERRULED = "overruled"  # reason of a point that the user excluded before the search


@dataclass(frozen=True)
class Shell:
    """Axis, form and accepted points of a shell; n points in the given order.

    Attributes
    ----------
    axis_m : tuple of float
        (x, y) of the axis at height z_m, m.
    z_m : float
        Reference height of the axis, m.
    slope : tuple of float
        (dx/dz, dy/dz) of the axis.
    slope_cofactor : ndarray, shape (2, 2)
        Covariance of the slope.
    reason : ndarray of str, shape (n,)
        "" for points of the wall, "undecided" for points that may belong to a fitting, otherwise
        the reason of the rejection.
    residual_m : ndarray, shape (n,)
        Outward distance from the wall as determined by all other points, m; for points far from the
        wall, distance from the leaning cylinder of the course.
    w : ndarray, shape (n,)
        Normalised residual of the snooping test; nan for points without test.
    noise_m : float
        Standard deviation of a point about the smooth form common to all courses, m; with given
        standard deviations, that of a point of median standard deviation.
    noise_dof : float
        Degrees of freedom of noise_m.
    tilt_known : bool
        False: the points do not determine the tilt, and the shell is assumed upright.
    column : ndarray of int, shape (n,)
        Number of the column of an undecided point; -1 for all other points.
    sizes_m2 : ndarray, shape (components + 1,), optional
        Approximate variances of the components of the wall, and variance factor of the points.
    """

    axis_m: tuple[float, float]
    z_m: float
    slope: tuple[float, float]
    slope_cofactor: np.ndarray
    reason: np.ndarray
    residual_m: np.ndarray
    w: np.ndarray
    noise_m: float
    noise_dof: float
    tilt_known: bool
    column: np.ndarray
    sizes_m2: np.ndarray | None = None

    @property
    def on_wall(self):
        """Mask (n,) of the points of the wall, including undecided points."""
        return (self.reason == "") | (self.reason == UNDECIDED)

    @property
    def tilt(self):
        """Length of the slope, m/m: tangent of the angle to the vertical."""
        return float(np.hypot(*self.slope))

    @property
    def tilt_sd(self):
        """Standard deviation of the tilt, m/m."""
        direction = np.array(self.slope) / self.tilt if self.tilt > 0 else np.array([1.0, 0.0])
        return float(np.sqrt(direction @ self.slope_cofactor @ direction))

    @property
    def tilt_azimuth_rad(self):
        """Azimuth towards which the top leans, clockwise from +y, 0 to 2 pi."""
        return float(np.arctan2(self.slope[0], self.slope[1]) % (2 * np.pi))


def course_of(z_m, joints_m):
    """Return the index of the course of each height.

    Heights below the first joint or above the last joint belong to the first or last course.

    Parameters
    ----------
    z_m : array_like, shape (n,)
        Heights, m.
    joints_m : array_like, shape (courses + 1,)
        Heights of the course joints in the same frame, m.

    Returns
    -------
    ndarray of int, shape (n,)

    Examples
    --------
    >>> course_of([0.0, 1.0, 2.0, 4.0], [0, 2, 4])
    array([0, 0, 1, 1])
    """
    return np.searchsorted(np.asarray(joints_m)[1:-1], z_m, side="right")


def find_shell(
    xyz_m, joints_m, nominal_radius_m, *, sd_m=None, snooping=True, welds_rad=(), decided=None
):
    """Separate the wall from clutter and determine the axis of the shell.

    Parameters
    ----------
    xyz_m : array_like, shape (n, 3)
        Points, m.
    joints_m : array_like, shape (courses + 1,)
        Heights of the course joints in the frame of the points, m.
    nominal_radius_m : float
        Approximate radius of the wall, m.
    sd_m : array_like, shape (n,), optional
        Standard deviations of the radii, m, of which only the ratios are used.
    snooping : bool, optional
        Whether data snooping tests the points.
    welds_rad : sequence of array_like, optional
        Azimuths of the vertical welds of each course; (): unknown.
    decided : ndarray of int, shape (n,), optional
        1 for points that certainly belong to the wall: no test rejects them, but they count like
        any other point, also for the roughness of the wall. -1 for excluded points. None: the
        search decides on all points.

    Returns
    -------
    Shell

    Raises
    ------
    SolutionError
        If no cylinder near the nominal radius contains half of the points between the bottom and
        the top.
    """
    xyz_m = np.asarray(xyz_m, dtype=float)
    decided = np.zeros(len(xyz_m), dtype=int) if decided is None else decided
    reason, kept = _rejection_reasons(xyz_m, joints_m), decided > 0
    reason[decided < 0] = OVERRULED
    candidates = reason == ""
    course = course_of(xyz_m[:, 2], joints_m)
    origin = np.array([*np.median(xyz_m[:, :2], axis=0), (joints_m[0] + joints_m[-1]) / 2])
    local = xyz_m - origin

    start = consensus_circle(local[candidates, :2], nominal_radius_m)
    wall, axis = _fit_leaning_cylinder(local, course, candidates, start, nominal_radius_m)
    wall |= kept & candidates
    reason[candidates & ~wall] = "consensus"
    believed = np.ones(len(xyz_m)) if sd_m is None else np.maximum(sd_m, LEAST_NOISE_M)
    # Only the ratios of the standard deviations enter; the noise level is estimated.
    relative = believed / np.median(believed)
    zeta = _relative_heights(xyz_m[:, 2], course, np.asarray(joints_m, dtype=float))
    least_departure = BELIEVED_M if snooping else None
    band = (local, course, zeta, wall)
    found = find_form(*band, axis, relative, WIDEST_SLOPE, least_departure, kept)
    tilt_known = np.sqrt(np.diag(found.slope_cofactor).max()) < VAGUE_TILT
    # Too uncertain a tilt: repeat the fit with an upright axis, held by a tight prior.
    if not tilt_known:
        upright = np.array([*axis[:2], 0.0, 0.0])
        found = find_form(*band, upright, relative, 1e-9, least_departure, kept)
    in_band, axis, column = wall, found.axis, np.full(len(xyz_m), NO_COLUMN)
    w, residual, wall, sizes = found.w, found.residual.copy(), found.wall, None
    if snooping:
        seams = _mark_seams(local, course, candidates, in_band, found, nominal_radius_m)
        wall = wall | seams | _mark_buckles(local, in_band, axis, residual, wall, nominal_radius_m)
        where = local, course, zeta, joints_m
        of_wall = axis, relative, nominal_radius_m, welds_rad
        # Points of seams, as the smooth form shows them, are no blunders and define no columns of
        # fittings.
        sure = seams | (kept & in_band)
        tested, stands = _test_by_field(*where, in_band, wall, kept, (sure, found.noise), *of_wall)
        wall[in_band], w[in_band], residual[in_band] = tested.accepted, tested.w, tested.departure_m
        wall = wall | seams | _mark_buckles(local, in_band, axis, residual, wall, nominal_radius_m)
        wall[np.flatnonzero(in_band)[stands]] = False
        # The columns are judged by departures from the smooth form, not by the flexible field.
        raw = np.where(wall, found.residual, residual)
        column = _number_columns(local, in_band, axis, raw, wall, found.noise, nominal_radius_m)
        reason[column != NO_COLUMN] = UNDECIDED
        sizes = tested.sizes_m2
    reason[(reason == "") & ~wall] = "snooping"
    if wall.sum() < LEAST_PART * candidates.sum():
        raise SolutionError(
            message(
                "no_shell",
                "only {found} of {all} points between bottom and top lie on one wall: the shell "
                "cannot be told from its surroundings; check nominal_diameter_m and points",
                found=wall.sum(),
                all=candidates.sum(),
            )
        )

    distance = distances_from_axis(local, axis)[1]
    radii = _mean_radii(distance[wall], course[wall], len(joints_m) - 1, nominal_radius_m)
    return Shell(
        axis_m=(float(axis[0] + origin[0]), float(axis[1] + origin[1])),
        z_m=float(origin[2]),
        slope=(float(axis[2]), float(axis[3])),
        slope_cofactor=found.slope_cofactor,
        reason=reason,
        residual_m=np.where(in_band, residual, distance - radii[course]),
        w=w,
        noise_m=found.noise,
        noise_dof=found.noise_dof,
        tilt_known=bool(tilt_known),
        column=column,
        sizes_m2=sizes,
    )


def _test_by_field(
    local, course, zeta, joints_m, in_band, wall, kept, shown, axis, relative, nominal_m, welds_rad
):
    """Test the points near the wall by the field that the accepted points determine.

    Parameters
    ----------
    local : ndarray, shape (n, 3)
        Points about the origin of the axis, m.
    course, zeta : ndarray, shape (n,)
        Course and height within the course, -1 to 1.
    joints_m : array_like, shape (courses + 1,)
    in_band, wall, kept : ndarray of bool, shape (n,)
        Points near the wall, accepted points, and points that no test rejects.
    shown : tuple
        Mask (n,) of seams and kept points, and scatter of the wall about the smooth form, m.
    axis : ndarray, shape (4,)
    relative : ndarray, shape (n,)
        Relative standard deviations.
    nominal_m : float
    welds_rad : sequence of array_like

    Returns
    -------
    tested : ReadingTests
        Results for the points of the band.
    stands : ndarray of bool
        Points of the band in columns that are unlikely for a wall.
    """
    index = np.flatnonzero(in_band)
    offset, distance = distances_from_axis(local[index], axis)
    azimuth = np.arctan2(offset[:, 0], offset[:, 1])
    present, courses = np.unique(course[index], return_inverse=True)
    welds = tuple(np.asarray(welds_rad[number]) for number in present) if welds_rad else ()
    ring, leans = find_rings(courses, zeta[index], azimuth)
    spans = spans_of(np.asarray(joints_m, dtype=float))[present]
    sites = Sites(courses, ring, zeta[index], azimuth, leans, welds, spans=spans)
    field_arguments = sites, distance, relative[index] ** 2, nominal_m
    may_go = ~kept[index]
    tested = find_blunders(*field_arguments, wall[index], may_go=may_go)
    stands = find_uprights(*field_arguments, tested, shown[0][index], shown[1])
    # Columns of fittings would bias their neighbours: repeat the test without them.
    if stands.any():
        tested = find_blunders(*field_arguments, tested.accepted, stands, may_go)
    return tested, stands


def _mark_buckles(local, in_band, axis, departure_m, wall, nominal_radius_m):
    """Mark (n,) rejected points that belong to a buckle of the wall."""
    tested, in_buckle = np.flatnonzero(in_band), np.zeros(len(local), dtype=bool)
    for place in _unroll(local[tested], axis, nominal_radius_m):
        in_buckle[tested] |= find_buckles(place, departure_m[tested], ~wall[tested])
    return in_buckle


def _number_columns(local, in_band, axis, departure_m, wall, noise, nominal_radius_m):
    """Number (n,) the columns of rejected points that may be wall or a fitting; otherwise -1."""
    tested, numbers = np.flatnonzero(in_band), np.full(len(local), NO_COLUMN)
    place = next(_unroll(local[tested], axis, nominal_radius_m))
    turn, rejected = 2 * np.pi * nominal_radius_m, ~wall[tested]
    numbers[tested] = find_columns(place, departure_m[tested], rejected, noise, turn)
    return numbers


def _mark_seams(local, course, candidates, in_band, form, nominal_radius_m):
    """Mark (n,) points of the band that belong to a seam along the whole shell or along a course.

    Points beyond the band are included in the search, since the band may contain only the sides of
    a pipe.
    """
    distance, wall = distances_from_axis(local, form.axis)[1], form.wall
    radii = _mean_radii(distance[wall], course[wall], course.max() + 1, nominal_radius_m)
    departure = np.where(in_band, form.residual, distance - radii[course])
    nearby = np.flatnonzero(candidates & (np.abs(departure) < NEAR_M))
    in_seam = np.zeros(len(local), dtype=bool)
    for place in _unroll(local[nearby], form.axis, nominal_radius_m):
        for band in (nearby >= 0, *np.equal.outer(np.unique(course[nearby]), course[nearby])):
            members = nearby[band]
            rejected = ~form.wall[members] & ~in_seam[members]
            in_seam[members] |= find_seams(place[band], departure[members], rejected, form.noise)
    return in_seam & in_band


def _unroll(local, axis, nominal_radius_m):
    """Yield positions (n, 2) along the arc and upwards, with two origins of the arc.

    A patch that the first origin cuts in two is whole with the second origin.
    """
    offset, _ = distances_from_axis(local, axis)
    turn = np.arctan2(offset[:, 0], offset[:, 1])
    for start in (0.0, np.pi):
        arc = nominal_radius_m * ((turn + start) % (2 * np.pi))
        yield np.column_stack([arc, local[:, 2]])


def _relative_heights(z_m, course, joints_m):
    """Return heights (n,) within the course, -1 at its bottom to +1 at its top."""
    bottom, top = joints_m[course], joints_m[course + 1]
    return 2 * (z_m - bottom) / (top - bottom) - 1


def _rejection_reasons(xyz_m, joints_m):
    """Return reasons (n,) why a point cannot belong to the wall by its position alone; else ""."""
    reason = np.full(len(xyz_m), "", dtype=object)
    # Mark points with exactly the coordinates of an earlier point.
    first = np.unique(xyz_m, axis=0, return_index=True)[1]
    repeated = np.ones(len(xyz_m), dtype=bool)
    repeated[first] = False
    reason[repeated] = "same_place"
    reason[xyz_m[:, 2] > joints_m[-1] + END_TOLERANCE_M] = "above_shell"
    reason[xyz_m[:, 2] < joints_m[0] - END_TOLERANCE_M] = "below_shell"
    return reason


def _mean_radii(distance, course, courses, otherwise):
    """Return mean distances (courses,) from the axis; `otherwise` for courses without points."""
    return np.array(
        [distance[course == c].mean() if np.any(course == c) else otherwise for c in range(courses)]
    )


def consensus_circle(xy, nominal_radius):
    """Return (x, y, radius) of the three-point circle with the largest support.

    Parameters
    ----------
    xy : ndarray, shape (n, 2)
        Points, m.
    nominal_radius : float
        Circles within 3 % of this radius are tried, m.

    Returns
    -------
    ndarray, shape (3,)

    Raises
    ------
    SolutionError
        For fewer than 5 points, or if no circle passes through half of the points.
    """
    if len(xy) < 5:
        raise SolutionError(
            message(
                "too_few_for_shell",
                "{count} points between bottom and top of the shell: too few",
                count=len(xy),
            )
        )
    rng = np.random.default_rng(20_11)  # fixed seed: results are reproducible
    triples = xy[rng.integers(len(xy), size=(SAMPLES, 3))]
    circles = _circles_through(triples)
    plausible = np.abs(circles[:, 2] / nominal_radius - 1) < WIDE_BAND
    # A sample of 2000 points estimates the support to about one percent.
    sample = xy if len(xy) <= 2000 else xy[rng.choice(len(xy), 2000, replace=False)]
    band = WIDE_BAND * nominal_radius
    support = _shares_near(sample, circles[plausible], band)
    best = np.max(support, initial=0.0)
    if best < LEAST_PART:
        band, share = 100 * WIDE_BAND, 100 * best
        raise SolutionError(
            message(
                "no_circle",
                "no circle within {band:.0f} % of the nominal radius {nominal_m:.3f} m "
                "passes through half of the points (best {share:.0f} %): check "
                "nominal_diameter_m, units and axes",
                band=band,
                nominal_m=nominal_radius,
                share=share,
            )
        )
    return circles[plausible][int(np.argmax(support))]


def _shares_near(xy, circles, band):
    """Return the share (k,) of the points (n, 2) within a band about each of k circles."""
    shares = np.empty(len(circles))
    for start in range(0, len(circles), AT_ONCE):  # blocks that fit the processor cache
        block = slice(start, start + AT_ONCE)
        x, y, r = circles[block].T[:, :, None]
        squared = (xy[:, 0] - x) ** 2 + (xy[:, 1] - y) ** 2
        # Compare squares: no square root for each point and circle.
        in_band = (squared > np.maximum(r - band, 0) ** 2) & (squared < (r + band) ** 2)
        shares[block] = np.count_nonzero(in_band, axis=1)
    return shares / max(len(xy), 1)


def _circles_through(triples):
    """Return centre and radius (k, 3) of the circles through triples of points (k, 3, 2)."""
    a, b, c = (triples[:, i] for i in range(3))
    ab, ac = b - a, c - a
    cross = 2 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    # Twice the area of the triangle vanishes for collinear points: nan excludes their circle.
    cross = np.where(np.abs(cross) < 1e-12, np.nan, cross)
    sab, sac = np.sum(ab**2, axis=1), np.sum(ac**2, axis=1)
    x = (ac[:, 1] * sab - ab[:, 1] * sac) / cross
    y = (ab[:, 0] * sac - ac[:, 0] * sab) / cross
    return np.column_stack([a[:, 0] + x, a[:, 1] + y, np.hypot(x, y)])


def _fit_leaning_cylinder(local, course, candidates, circle, nominal_radius):
    """Return the mask of the wall and the axis (x, y, dx/dz, dy/dz) of a leaning cylinder.

    The band about the cylinder narrows from 3 % to 1 % of R, but not below LEAST_BAND_M.
    """
    axis = np.array([circle[0], circle[1], 0.0, 0.0])
    distance = distances_from_axis(local, axis)[1]
    least_band = max(WALL_BAND * nominal_radius, LEAST_BAND_M)
    widest = max(WIDE_BAND * nominal_radius, least_band)
    wall = candidates & (np.abs(distance - circle[2]) < widest)
    previous_wall = ~wall
    for band in np.repeat(np.geomspace(widest, least_band, 5), 3):
        if np.any(previous_wall != wall):  # unchanged points would give an unchanged axis
            rough_sd, previous_wall = np.full(wall.sum(), 0.01), wall
            fit = adjust(
                *shell_problem(local[wall], course[wall], axis, rough_sd, None, WIDEST_SLOPE)
            )
            axis = fit.unknowns[:4]
            distance = distances_from_axis(local, axis)[1]
            names, row_of = np.unique(course[wall], return_inverse=True)
            radii = np.array([np.median(distance[wall][row_of == i]) for i in range(len(names))])
        # The radius of the nearest course applies to a course without accepted points.
        nearest = np.abs(names[None, :] - course[:, None]).argmin(axis=1)
        wall = candidates & (np.abs(distance - radii[nearest]) < band)
        if wall.sum() < 5 + len(names):
            raise SolutionError(
                message(
                    "no_cylinder",
                    "only {count} points lie on a cylinder: no wall was found",
                    count=wall.sum(),
                )
            )
    return wall, axis
