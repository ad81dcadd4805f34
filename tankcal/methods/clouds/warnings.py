"""Warnings of point clouds: scans that do not agree, hidden walls, and undeclared uncertainties."""

import numpy as np

from tankcal.errors import Problem
from tankcal.messages import message
from tankcal.methods.clouds.bottom import check_inside
from tankcal.methods.clouds.overlaps import overlap_test, overlaps_of, scans_apart
from tankcal.methods.clouds.wall import FILE, TARGETS
from tankcal.pipeline.checks.survey import causes_unlike_certificates

HIDDEN = 0.25  # largest share of hidden cells of a course: their form is only interpolated
LEAST_OF_WALL = 0.01  # smallest share of wall points in a scan


def check_clouds(job, survey, clouded):
    """Return the warnings of the clouds of a wall.

    Parameters
    ----------
    job : Job
    survey : Wall or Scan
    clouded : Clouded

    Returns
    -------
    tuple of Problem
    """
    return (
        *_check_targets(clouded.registration),
        *_check_overlaps(job, clouded),
        *_check_idle_scans(job, clouded),
        *_check_hidden_courses(job, clouded),
        *_check_assumed_uncertainties(job, clouded),
        *check_inside(job, clouded.inside),
        *causes_unlike_certificates(survey, clouded.told, FILE, taken_off_m=clouded.beamed.told_m),
    )


def _check_overlaps(job, clouded):
    """Warn of pairs of scans that disagree; if there are none, test all overlaps together."""
    apart = [
        overlap
        for overlap in overlaps_of(job, clouded.cells, clouded.registration)
        if overlap.is_apart
    ]
    for overlap in apart:
        yield Problem(FILE, scans_apart(job, overlap))
    if not apart:
        yield from _check_registration(job, clouded)


def _check_registration(job, clouded):
    """Warn of a registration worse than declared, according to all overlaps together."""
    test = overlap_test(job, clouded.cells, clouded.registration)
    if test is not None and test.chi2 > test.limit:
        text = message(
            "registration_beyond",
            "where scans overlap they differ {factor:.1f} times as much as the declared"
            " registration allows (chi2 = {chi2:.1f}, expected at most {limit:.1f} with {dof}"
            " degrees of freedom): U may be too small by this factor; check poses,"
            " s_translation_mm, s_rotation_arcsec and targets",
            factor=test.factor,
            chi2=test.chi2,
            limit=test.limit,
            dof=test.dof,
        )
        yield Problem(FILE, text)


def _check_targets(registration):
    """Warn of rejected targets."""
    for residual in registration.residuals:
        if residual.removed:
            text = message(
                "target_removed",
                "target {target!r} of scan {scan!r} is {off_mm:.1f} mm off where the others have it"
                " (|w| = {w:.1f}): rejected",
                target=residual.target,
                scan=residual.scan,
                off_mm=1000 * float(np.linalg.norm(residual.residual_m)),
                w=residual.w,
            )
            yield Problem(TARGETS, text, residual.row)


def _check_idle_scans(job, clouded):
    """Warn of scans with hardly any point of the wall."""
    cells = clouded.cells
    for number, scan in enumerate(job.clouds.scans):
        share = cells.of_wall[number] / max(cells.delivered[number], 1)
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


def _check_hidden_courses(job, clouded):
    """Warn of courses that are largely hidden from all scans."""
    for number, share in enumerate(clouded.cells.masked_share):
        if share > HIDDEN:
            name = job.courses[number].name if number < len(job.courses) else str(number + 1)
            text = message(
                "course_hidden",
                "{percent:.0f} % of course {course!r} are hidden from all scans; expected at most"
                " {most:.0f} %: what lies there is told by the form of the rest alone",
                percent=100 * share,
                course=name,
                most=100 * HIDDEN,
            )
            yield Problem(FILE, text)


def _check_assumed_uncertainties(job, clouded):
    """Warn of assumed standard uncertainties of scanners and of the registration."""
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
    # The network determines the registration of tied scans, so nothing is assumed for them.
    assumed = [i for i, scan in enumerate(scans) if scan.is_assumed and ties[i] != "network"]
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
