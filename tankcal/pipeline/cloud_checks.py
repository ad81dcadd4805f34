"""Warnings of clouds: scans that do not meet, walls that are hidden, and what nobody declared."""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, chdtri

from tankcal.adjust import ALPHA
from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.pipeline.cloud_bottom import check_inside
from tankcal.pipeline.cloud_wall import FILE, TARGETS, normals_of
from tankcal.pipeline.hit_checks import causes_unlike_certificates
from tankcal.survey.beams import points_of_beams

HIDDEN = 0.25  # of the cells of a course: what lies behind is a guess of the form alone
LEAST_OF_WALL = 0.01  # of the points of a scan
FEWEST_CELLS = 20  # in common, before two scans are compared
MOST_CELLS = 150  # of an overlap that are compared
LEAST_M = 2e-4  # cells of two scans may differ so much without a reason that a scan knows
STEEP_DEG = 60.0  # of incidence, beyond which cells are not compared
RANK = 0.05  # of the largest direction: a smaller one the overlap does not tell


@dataclass(frozen=True)
class Overlap:
    """Two scans where both show the wall.

    Attributes
    ----------
    scans : tuple of int
    cells : int
    mean_m : float
        By how much the second has the wall further out.
    apart_m : float
        Root mean square of what a shift between them explains of their differences.
    w : float
        Of that against registration, offset and incidence: as |w| of one reading.
    is_apart : bool
        Whether the registration does not explain it.
    """

    scans: tuple
    cells: int
    mean_m: float
    apart_m: float
    w: float
    is_apart: bool


def check_clouds(job, survey, clouded):
    """`Problem`s of the clouds of a wall.

    Parameters
    ----------
    job : Job
    survey : Wall or Scan
    clouded : Clouded
    """
    return (
        *_of_targets(clouded.registration),
        *_of_overlaps(job, clouded),
        *_of_idle_scans(job, clouded),
        *_of_hidden(job, clouded),
        *_of_assumed(job, clouded),
        *check_inside(job, clouded.inside),
        *causes_unlike_certificates(survey, clouded.told, FILE, taken_off_m=clouded.beamed.told_m),
    )


def overlaps_of(job, clouded):
    """`Overlap` of each pair of scans that show enough cells of the same side in common."""
    found, cells = [], clouded.cells
    for a in range(len(cells.sides)):
        for b in range(a + 1, len(cells.sides)):
            if cells.sides[a] == cells.sides[b]:
                common = np.argwhere(cells.is_wall[a] & cells.is_wall[b])
                if len(common) >= FEWEST_CELLS:
                    step = -(-len(common) // MOST_CELLS)
                    one = _overlap(job, clouded, (a, b), common[::step], len(common))
                    if one is not None:
                        found.append(one)
    return tuple(found)


def _overlap(job, clouded, pair, chosen, count):
    """`Overlap` of two scans by the differences of their cells, with all that these share.

    Differences d = e . (shift of the one against the other, and a constant) + noise, e the normal.
    """
    cells, surface = clouded.cells, clouded.cells.surface
    row, column = chosen.T
    places, sds = [], []
    for scan in pair:
        radius = cells.radius_m[scan, row, column]
        at = cells.along_m[pair[0], row, column], cells.turn_rad[pair[0], row, column]
        places.append(surface.points(*at, radius - surface.radius_m))
        sds.append(cells.sd_m[scan, row, column])
    xyz, n = np.vstack(places), len(chosen)
    normal = normals_of(surface, xyz)
    beamed = points_of_beams(
        xyz,
        np.concatenate(sds),
        np.repeat(pair, n),
        normal,
        clouded.registration,
        job.clouds.tools,
    )
    steep = np.degrees(beamed.incidence_rad).reshape(2, n).max(axis=0) > STEEP_DEG
    if np.count_nonzero(~steep) < FEWEST_CELLS:
        return None
    outwards = np.zeros((2 * n, 6 * n))  # distance outwards of each by all coordinates
    for axis in range(3):
        outwards[np.arange(2 * n), 3 * np.arange(2 * n) + axis] = normal[:, axis]
    minus = np.hstack([-np.eye(n), np.eye(n)])[~steep] @ outwards
    apart = (cells.radius_m[pair[1], row, column] - cells.radius_m[pair[0], row, column])[~steep]
    covariance = minus @ beamed.points.covariance_m2 @ minus.T
    design = np.column_stack([normal[:n][~steep], np.ones(n - steep.sum())])
    u, size, _ = np.linalg.svd(design, full_matrices=False)
    told = u[:, size > RANK * size[0]]
    values = told.T @ apart
    spread = told.T @ covariance @ told + len(apart) * LEAST_M**2 * np.eye(told.shape[1])
    test = float(values @ np.linalg.solve(spread, values))
    return Overlap(
        pair,
        count,
        float(apart.mean()),
        float(np.sqrt(values @ values / len(apart))),
        float(np.sqrt(chdtri(1, max(chdtrc(told.shape[1], test), 1e-300)))),
        test > chdtri(told.shape[1], ALPHA),
    )


def _of_overlaps(job, clouded):
    for one in overlaps_of(job, clouded):
        if one.is_apart:
            names = [job.clouds.scans[scan].name for scan in one.scans]
            text = message(
                "scans_apart",
                "scans {one!r} and {other!r} are {apart_mm:.1f} mm apart where both show the wall"
                " (|w| = {w:.1f}), more than their registration and their scanners allow: did one"
                " move, or is a standard deviation too small?",
                one=names[0],
                other=names[1],
                apart_mm=1000 * one.apart_m,
                w=one.w,
            )
            yield Problem(FILE, text)


def _of_targets(registration):
    for one in registration.residuals:
        if one.removed:
            text = message(
                "target_removed",
                "target {target!r} of scan {scan!r} is {off_mm:.1f} mm off where the others have it"
                " (|w| = {w:.1f}): set aside",
                target=one.target,
                scan=one.scan,
                off_mm=1000 * float(np.linalg.norm(one.residual_m)),
                w=one.w,
            )
            yield Problem(TARGETS, text, one.row)


def _of_idle_scans(job, clouded):
    """Scans that show hardly anything of the wall that the others show."""
    cells = clouded.cells
    for place, scan in enumerate(job.clouds.scans):
        share = cells.of_wall[place] / max(cells.delivered[place], 1)
        if share < LEAST_OF_WALL:
            text = message(
                "scan_without_wall",
                "{percent:.1f} % of the points of scan {scan!r} are of the wall; expected"
                " {least:.1f} % or more: are its unit and its pose right, and is it a scan of this"
                " tank?",
                percent=100 * share,
                scan=scan.name,
                least=100 * LEAST_OF_WALL,
            )
            yield Problem(FILE, text)


def _of_hidden(job, clouded):
    for place, share in enumerate(clouded.cells.masked_share):
        if share > HIDDEN:
            name = job.courses[place].name if place < len(job.courses) else str(place + 1)
            text = message(
                "course_hidden",
                "{percent:.0f} % of course {course!r} are hidden from all scans; expected at most"
                " {most:.0f} %: what lies there is told by the form of the rest alone",
                percent=100 * share,
                course=name,
                most=100 * HIDDEN,
            )
            yield Problem(FILE, text)


def _of_assumed(job, clouded):
    for name, (tool, offset, scale) in job.clouds.tools.items():
        if offset or scale:
            text = message(
                "scanner_assumed",
                "of scanner {name!r} an offset of {offset_mm:.1f} mm and a scale of {scale_ppm:.0f}"
                " ppm are taken as standard uncertainties: nobody declared both of them",
                name=name,
                offset_mm=1000 * tool.u_offset_m,
                scale_ppm=1e6 * tool.u_scale,
            )
            yield Problem(FILE, text)
    scans = clouded.registration.scans
    ties = clouded.registration.ties
    assumed = [i for i, one in enumerate(scans) if one.is_assumed and ties[i] != "network"]
    if assumed:
        text = message(
            "registration_assumed",
            "the registration of scans {scans} is assumed: {mm:.1f} mm and {arcsec:.0f}''; expected"
            " targets, or the standard deviations that it has",
            scans=[scans[i].name for i in assumed],
            mm=1000 * scans[assumed[0]].s_translation_m,
            arcsec=np.degrees(scans[assumed[0]].s_rotation_rad) * 3600,
        )
        yield Problem(FILE, text)
