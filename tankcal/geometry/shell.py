"""The shell as one body: its wall told apart from clutter, its axis and its tilt.

A survey hits stairs, pipes and the roof too. A consensus of circles finds the wall, a leaning
cylinder with one radius a course refines it, and data snooping about the shell's smooth form
rejects what stands clearly before it, the worst points first. Then the field of the wall tests each
point by all others: what they agree on is wall, not a blunder.
"""

from dataclasses import dataclass

import numpy as np

from tankcal.adjust import adjust
from tankcal.errors import SolutionError
from tankcal.geometry.buckles import find_buckles
from tankcal.geometry.clutter import (
    LEAST_NOISE_M,
    distances_from_axis,
    find_form,
    find_rings,
    shell_problem,
)
from tankcal.geometry.columns import NONE, find_columns
from tankcal.geometry.field.blunders import find_blunders
from tankcal.geometry.field.sites import Sites, spans_of
from tankcal.geometry.field.uprights import find_uprights
from tankcal.geometry.seams import find_seams
from tankcal.messages import message

WIDE_BAND, WALL_BAND = 0.03, 0.01  # of the nominal radius: start, and largest believed deviation
LEAST_BAND_M = 0.08  # that deviation at least: buckles and ovalities of small tanks are as deep
END_TOLERANCE_M = 0.020  # a point this far above or below the shell still belongs to its edge
SAMPLES = 1000  # three-point circles tried; with half the points clutter one in eight is sound
BELIEVED_M = 0.013  # from the smooth form: what departs less is left to the field to judge
AT_ONCE = 16  # circles
LEAST_PART = 0.5  # of the points between bottom and top that the wall must hold
WIDEST_SLOPE = 0.05  # sd of the slope before anything is measured: tanks hardly lean by more
NEAR_M = 0.3  # from the wall: what stands there may be told by its side alone
VAGUE_TILT = 2e-3  # sd above which the tilt counts as not determined by the points
UNDECIDED = "undecided"  # reason of a point that may be of the wall or of a fitting before it
OVERRULED = "overruled"  # reason of a point that somebody took out before the search


@dataclass(frozen=True)
class Shell:
    """Axis, form and accepted points of a shell; n points in the order given.

    Attributes
    ----------
    axis_m : tuple of float
        (x, y) of the axis at height z_m, m.
    z_m : float
        This height, m.
    slope : tuple of float
        (dx/dz, dy/dz) of the axis.
    slope_cofactor : ndarray, shape (2, 2)
        Covariance of the slope.
    reason : ndarray of str, shape (n,)
        "" for points of the wall, "undecided" for those that may be of a fitting as well, else why
        the point was rejected.
    residual_m : ndarray, shape (n,)
        Distance outwards from the wall as all other points show it; of points far from the wall,
        from the leaning cylinder of their course, m.
    w : ndarray, shape (n,)
        Normalised residual of the snooping test, nan where none was made.
    noise_m : float
        Standard deviation of a point about the smooth form common to all courses; of a point of
        median standard deviation where those are given, m.
    noise_dof : float
        Its degrees of freedom.
    tilt_known : bool
        False: the points do not determine a tilt, and the shell is taken as upright.
    column : ndarray of int, shape (n,)
        Number of the column that an undecided point is of; -1 of all others.
    sizes_m2 : ndarray, shape (components + 1,), optional
        About the variances of the wall's components, and that of a point as `noise_m` has it.
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
        """(n,) points of the wall, and those that may be."""
        return (self.reason == "") | (self.reason == UNDECIDED)

    @property
    def tilt(self):
        """Length of the slope, m/m: the tangent of the angle to the vertical."""
        return float(np.hypot(*self.slope))

    @property
    def tilt_sd(self):
        """Standard deviation of the tilt, m/m."""
        direction = np.array(self.slope) / self.tilt if self.tilt > 0 else np.array([1.0, 0.0])
        return float(np.sqrt(direction @ self.slope_cofactor @ direction))

    @property
    def tilt_azimuth_rad(self):
        """Direction towards which the top leans, clockwise from +y, 0 to 2 pi."""
        return float(np.arctan2(self.slope[0], self.slope[1]) % (2 * np.pi))


def course_of(z_m, joints_m):
    """Index of the course of each height; the ends belong to the first and the last course.

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
    """Tell the wall from the clutter and find the axis of the shell.

    Parameters
    ----------
    xyz_m : array_like, shape (n, 3)
        Points, m.
    joints_m : array_like, shape (courses + 1,)
        Heights of the course joints in the same frame, m.
    nominal_radius_m : float
        Radius near which the wall is looked for, m.
    sd_m : array_like, shape (n,), optional
        Standard deviations of the radii, m, which are believed in relation to each other.
    snooping : bool, optional
        Whether points are tested by data snooping.
    welds_rad : sequence of array_like, optional
        Azimuths of the vertical welds of each course; (): not known.
    decided : ndarray of int, shape (n,), optional
        1 of points that somebody knows to be of the wall: none of the tests takes one out, but what
        it shows counts as that of any other, also for how rough the wall is. -1 of points that take
        no part; None: all are left to the search.

    Returns
    -------
    Shell

    Raises
    ------
    SolutionError
        When no cylinder near the nominal radius holds half of the points between the bottom and
        the top.
    """
    xyz_m = np.asarray(xyz_m, dtype=float)
    decided = np.zeros(len(xyz_m), dtype=int) if decided is None else decided
    reason, kept = _reasons(xyz_m, joints_m), decided > 0
    reason[decided < 0] = OVERRULED
    candidates = reason == ""
    course = course_of(xyz_m[:, 2], joints_m)
    origin = np.array([*np.median(xyz_m[:, :2], axis=0), (joints_m[0] + joints_m[-1]) / 2])
    local = xyz_m - origin

    start = consensus_circle(local[candidates, :2], nominal_radius_m)
    wall, axis = _leaning_cylinder(local, course, candidates, start, nominal_radius_m)
    wall |= kept & candidates
    reason[candidates & ~wall] = "consensus"
    believed = np.ones(len(xyz_m)) if sd_m is None else np.maximum(sd_m, LEAST_NOISE_M)
    relative = believed / np.median(believed)
    zeta = _within_course(xyz_m[:, 2], course, np.asarray(joints_m, dtype=float))
    least = BELIEVED_M if snooping else None
    band = (local, course, zeta, wall)
    found = find_form(*band, axis, relative, WIDEST_SLOPE, least, kept)
    tilt_known = np.sqrt(np.diag(found.slope_cofactor).max()) < VAGUE_TILT
    if not tilt_known:
        upright = np.array([*axis[:2], 0.0, 0.0])
        found = find_form(*band, upright, relative, 1e-9, least, kept)
    in_band, axis, column = wall, found.axis, np.full(len(xyz_m), NONE)
    w, residual, wall, sizes = found.w, found.residual.copy(), found.wall, None
    if snooping:
        seams = _seams(local, course, candidates, in_band, found, nominal_radius_m)
        wall = wall | seams | _buckles(local, in_band, axis, residual, wall, nominal_radius_m)
        where = local, course, zeta, joints_m
        of_wall = axis, relative, nominal_radius_m, welds_rad
        sure = seams | (kept & in_band)
        tested, stands = _by_field(*where, in_band, wall, kept, (sure, found.noise), *of_wall)
        wall[in_band], w[in_band], residual[in_band] = tested.accepted, tested.w, tested.departure_m
        wall = wall | seams | _buckles(local, in_band, axis, residual, wall, nominal_radius_m)
        wall[np.flatnonzero(in_band)[stands]] = False
        raw = np.where(wall, found.residual, residual)
        column = _columns(local, in_band, axis, raw, wall, found.noise, nominal_radius_m)
        reason[column != NONE] = UNDECIDED
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


def _by_field(
    local, course, zeta, joints_m, in_band, wall, kept, shown, axis, relative, nominal_m, welds_rad
):
    """`Tested` of the points near the wall: each by the field that the accepted others show; and
    which of them are columns that no wall is likely to have.

    kept   (n,) points that stay, whatever the others say
    shown  (n,) points of seams, which the smooth form showed, and kept ones; the scatter about it
    """
    index = np.flatnonzero(in_band)
    offset, distance = distances_from_axis(local[index], axis)
    azimuth = np.arctan2(offset[:, 0], offset[:, 1])
    seen, courses = np.unique(course[index], return_inverse=True)
    welds = tuple(np.asarray(welds_rad[one]) for one in seen) if welds_rad else ()
    ring, leans = find_rings(courses, zeta[index], azimuth)
    spans = spans_of(np.asarray(joints_m, dtype=float))[seen]
    sites = Sites(courses, ring, zeta[index], azimuth, leans, welds, spans=spans)
    given = sites, distance, relative[index] ** 2, nominal_m
    may_go = ~kept[index]
    tested = find_blunders(*given, wall[index], may_go=may_go)
    stands = find_uprights(*given, tested, shown[0][index], shown[1])
    if stands.any():
        tested = find_blunders(*given, tested.accepted, stands, may_go)
    return tested, stands


def _buckles(local, in_band, axis, departure_m, wall, nominal_radius_m):
    """(n,) points that were rejected, but belong to a buckle of the wall."""
    tested, back = np.flatnonzero(in_band), np.zeros(len(local), dtype=bool)
    for place in _unrolled(local[tested], axis, nominal_radius_m):
        back[tested] |= find_buckles(place, departure_m[tested], ~wall[tested])
    return back


def _columns(local, in_band, axis, departure_m, wall, noise, nominal_radius_m):
    """(n,) number of the column of each rejected point that may be wall or a fitting, else -1."""
    tested, found = np.flatnonzero(in_band), np.full(len(local), NONE)
    place = next(_unrolled(local[tested], axis, nominal_radius_m))
    turn, rejected = 2 * np.pi * nominal_radius_m, ~wall[tested]
    found[tested] = find_columns(place, departure_m[tested], rejected, noise, turn)
    return found


def _seams(local, course, candidates, in_band, form, nominal_radius_m):
    """(n,) points of the wall's band that belong to a seam, up the whole shell or up a course.

    What stands further off is looked at as well: of a pipe the band may hold its sides alone.
    """
    distance, wall = distances_from_axis(local, form.axis)[1], form.wall
    radii = _mean_radii(distance[wall], course[wall], course.max() + 1, nominal_radius_m)
    departure = np.where(in_band, form.residual, distance - radii[course])
    near = np.flatnonzero(candidates & (np.abs(departure) < NEAR_M))
    found = np.zeros(len(local), dtype=bool)
    for place in _unrolled(local[near], form.axis, nominal_radius_m):
        for band in (near >= 0, *np.equal.outer(np.unique(course[near]), course[near])):
            own = near[band]
            rejected = ~form.wall[own] & ~found[own]
            found[own] |= find_seams(place[band], departure[own], rejected, form.noise)
    return found & in_band


def _unrolled(local, axis, nominal_radius_m):
    """(n, 2) places along the arc and upwards, twice: a patch that one cuts in two, the other has
    whole.
    """
    offset, _ = distances_from_axis(local, axis)
    turn = np.arctan2(offset[:, 0], offset[:, 1])
    for start in (0.0, np.pi):
        arc = nominal_radius_m * ((turn + start) % (2 * np.pi))
        yield np.column_stack([arc, local[:, 2]])


def _within_course(z_m, course, joints_m):
    """(n,) height within the course, -1 at its bottom to +1 at its top."""
    low, high = joints_m[course], joints_m[course + 1]
    return 2 * (z_m - low) / (high - low) - 1


def _reasons(xyz_m, joints_m):
    """(n,) why a point cannot be of the wall, by its place alone; else ""."""
    reason = np.full(len(xyz_m), "", dtype=object)
    reason[_repeated(xyz_m)] = "same_place"
    reason[xyz_m[:, 2] > joints_m[-1] + END_TOLERANCE_M] = "above_shell"
    reason[xyz_m[:, 2] < joints_m[0] - END_TOLERANCE_M] = "below_shell"
    return reason


def _mean_radii(distance, course, courses, otherwise):
    """(courses,) mean distance from the axis in each course; `otherwise` where it has no point."""
    return np.array(
        [distance[course == c].mean() if np.any(course == c) else otherwise for c in range(courses)]
    )


def _repeated(xyz_m):
    """Mask of points on the very place of an earlier one."""
    first = np.unique(xyz_m, axis=0, return_index=True)[1]
    repeated = np.ones(len(xyz_m), dtype=bool)
    repeated[first] = False
    return repeated


def consensus_circle(xy, nominal_radius):
    """(x, y, radius) of the three-point circle near the nominal radius that most points support."""
    if len(xy) < 5:
        raise SolutionError(
            message(
                "too_few_for_shell",
                "{count} points between bottom and top of the shell: too few",
                count=len(xy),
            )
        )
    rng = np.random.default_rng(20_11)
    triples = xy[rng.integers(len(xy), size=(SAMPLES, 3))]
    circles = _circles_through(triples)
    near = np.abs(circles[:, 2] / nominal_radius - 1) < WIDE_BAND
    judges = xy if len(xy) <= 2000 else xy[rng.choice(len(xy), 2000, replace=False)]
    band = WIDE_BAND * nominal_radius
    support = _shares_near(judges, circles[near], band)
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
    return circles[near][int(np.argmax(support))]


def _shares_near(xy, circles, band):
    """(k,) share of the points (n, 2) within a band of each of k circles (x, y, radius)."""
    found = np.empty(len(circles))
    for start in range(0, len(circles), AT_ONCE):  # as many as a processor keeps at hand
        some = slice(start, start + AT_ONCE)
        x, y, r = circles[some].T[:, :, None]
        squared = (xy[:, 0] - x) ** 2 + (xy[:, 1] - y) ** 2
        near = (squared > np.maximum(r - band, 0) ** 2) & (squared < (r + band) ** 2)
        found[some] = np.count_nonzero(near, axis=1)
    return found / max(len(xy), 1)


def _circles_through(triples):
    """(k, 3) centre and radius of the circle through each of k triples of points (k, 3, 2)."""
    a, b, c = (triples[:, i] for i in range(3))
    ab, ac = b - a, c - a
    cross = 2 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    cross = np.where(np.abs(cross) < 1e-12, np.nan, cross)
    sab, sac = np.sum(ab**2, axis=1), np.sum(ac**2, axis=1)
    x = (ac[:, 1] * sab - ab[:, 1] * sac) / cross
    y = (ab[:, 0] * sac - ac[:, 0] * sab) / cross
    return np.column_stack([a[:, 0] + x, a[:, 1] + y, np.hypot(x, y)])


def _leaning_cylinder(local, course, candidates, circle, nominal_radius):
    """Mask of the wall and axis (x, y, dx/dz, dy/dz), the band narrowing from 3 % to 1 % of R or
    LEAST_BAND_M.
    """
    axis = np.array([circle[0], circle[1], 0.0, 0.0])
    distance = distances_from_axis(local, axis)[1]
    least = max(WALL_BAND * nominal_radius, LEAST_BAND_M)
    widest = max(WIDE_BAND * nominal_radius, least)
    wall = candidates & (np.abs(distance - circle[2]) < widest)
    fitted = ~wall
    for band in np.repeat(np.geomspace(widest, least, 5), 3):
        if np.any(fitted != wall):  # else the same points give the same axis, and the same radii
            rough, fitted = np.full(wall.sum(), 0.01), wall
            fit = adjust(*shell_problem(local[wall], course[wall], axis, rough, None, WIDEST_SLOPE))
            axis = fit.unknowns[:4]
            distance = distances_from_axis(local, axis)[1]
            names, first = np.unique(course[wall], return_inverse=True)
            radii = np.array([np.median(distance[wall][first == i]) for i in range(len(names))])
        # a course without a point so far is judged by its nearest neighbour
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
