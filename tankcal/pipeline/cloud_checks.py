"""Warnings of clouds: scans that do not meet, walls that are hidden, and what nobody declared."""

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.pipeline.cloud_bottom import check_inside
from tankcal.pipeline.cloud_overlaps import overlap_test, overlaps_of, scans_apart
from tankcal.pipeline.cloud_wall import FILE, TARGETS
from tankcal.pipeline.hit_checks import causes_unlike_certificates

HIDDEN = 0.25  # of the cells of a course: what lies behind is a guess of the form alone
LEAST_OF_WALL = 0.01  # of the points of a scan


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


def _of_overlaps(job, clouded):
    apart = [one for one in overlaps_of(job, clouded.cells, clouded.registration) if one.is_apart]
    for one in apart:
        yield Problem(FILE, scans_apart(job, one))
    if not apart:
        yield from _of_registration(job, clouded)


def _of_registration(job, clouded):
    """A registration that all overlaps together show to be worse than declared."""
    found = overlap_test(job, clouded.cells, clouded.registration)
    if found is not None and found.chi2 > found.limit:
        text = message(
            "registration_beyond",
            "where scans overlap they differ {factor:.1f} times as much as the declared"
            " registration allows (chi2 = {chi2:.1f}, expected at most {limit:.1f} with {dof}"
            " degrees of freedom): U may be too small by this factor; check poses,"
            " s_translation_mm, s_rotation_arcsec and targets",
            factor=found.factor,
            chi2=found.chi2,
            limit=found.limit,
            dof=found.dof,
        )
        yield Problem(FILE, text)


def _of_targets(registration):
    for one in registration.residuals:
        if one.removed:
            text = message(
                "target_removed",
                "target {target!r} of scan {scan!r} is {off_mm:.1f} mm off where the others have it"
                " (|w| = {w:.1f}): rejected",
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
