"""The part of the record on the surveyed wall: points, sections, courses, and decisions."""

from dataclasses import fields, replace
from functools import partial

import numpy as np

from tankcal.pipeline.checks.wall import homogeneity_of
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall_straps import mean_radii
from tankcal.record.columns import ArrayColumns, ArrayRows, plain_if_short
from tankcal.record.schema import Finite, Saved, fill_from, key
from tankcal.units import FULL_TURN

# Number of azimuths of an integral: resolves products of an outline with the highest mode.
EVEN = 720


class Wall(Saved):
    """The wall as one body."""

    x_m: Finite = key("a point of the axis, at half height")
    y_m: Finite = key("its y")
    z_m: Finite = key("its z")
    slope_x: Finite = key("of the axis, m/m")
    slope_y: Finite = key("of the axis, m/m")
    tilt: float = key("length of the slope, m/m")
    tilt_sd: float = key("its sd")
    tilt_azimuth_deg: float = key("towards which the top leans, clockwise from +y")
    residual_sd_m: float = key("of the accepted points about the circles of their sections")
    points: int = key("surveyed")
    accepted: int = key("points of the wall")
    noise_sd_m: float = key("of a point about the smooth form, used or not", of="noise_m")
    noise_dof: float = key("its degrees of freedom")
    height_m: float = key("of the shell, along the vertical")


class Place(Saved):
    """A point and its coordinates."""

    point: str = key("name")
    x_m: Finite = key("in the survey's frame")
    y_m: Finite = key("in the survey's frame")
    z_m: Finite = key("in the survey's frame")


class SurveyedPoint(Place):
    """A surveyed point; of an adjusted survey the target itself, with its covariance."""

    cov_m2: list | None = key("3 x 3; of supplied points only if they were used")
    course: str | None = key("of the point")
    section: str | None = key("of the point")
    generatrix: str | None = key("as given")
    residual_m: float | None = key("distance to the circle of its section, outwards positive")
    used: bool = key("whether it determines the wall")


class RejectedPoint(Place):
    """A point that is not on the wall."""

    residual_m: float = key("to the wall by the other points, or to the leaning cylinder")
    w: float | None = key("residual over its sd; null far from the wall")
    reason: str = key("a code, see below")
    row: int | None = key("of the file")


class SectionOutline(Saved):
    """The irregular section r(theta) about the circle's centre."""

    azimuth_deg: list[Finite] = key("each degree")
    radius_m: list[Finite] = key("at each azimuth")


class FormMode(Saved):
    """A harmonic of the section's form."""

    k: int = key("waves around")
    amplitude_m: float = key("of the wave")
    azimuth_deg: float = key("of its first crest")


class SectionCircle(Saved):
    """A horizontal section of the surface as surveyed (outside for an outside survey)."""

    section: str = key("name", of="group.name")
    course: str = key("of the section")
    height_m: Finite = key("above the bottom", of="group.height_m")
    n: int = key("points")
    x_m: Finite = key("centre of the circle", of="circle.x_m")
    y_m: Finite = key("centre of the circle", of="circle.y_m")
    x_sd_m: float = key("its sd")
    y_sd_m: float = key("its sd")
    radius_m: Finite = key("of the circle", of="circle.radius_m")
    radius_sd_m: float = key("its sd")
    variance_factor: float = key("v'Pv/(n-3): deviation from a circle", of="circle.variance_factor")
    shape: str = key('"smoothed"; "interpolated" in sections of former versions')
    points: list[str] = key("names")
    azimuth_deg: list[Finite] = key("of the points")
    residual_m: list[Finite] = key("of the points from the circle", of="circle.residuals_m")
    area_m2: float = key("of the irregular section")
    area_sd_m2: float = key("its sd")
    outline: SectionOutline = key("the irregular section")
    modes: list[FormMode] = key("of its form, from k = 2 on")


class CourseOfShell(Saved):
    """A course; values of the shell, without head, bottom, deadwood or roof."""

    course: str = key("name", of="name")
    bottom_m: Finite = key("above the bottom of the tank")
    top_m: Finite = key("above the bottom of the tank")
    height_m: float = key("of the plates")
    thickness_m: float = key("of the plates")
    paint_m: float = key("thickness")
    sections: list[str] = key("names")
    points: int = key("used")
    rejected: int = key("near the wall")
    radius_m: float = key("mean, as surveyed")
    radius_sd_m: float = key("its sd")
    inside_radius_m: float = key("of equal area, after plate, paint and temperature")
    area_m2: float = key("inside, mean over the course")
    area_sd_m2: float = key("its sd")
    volume_m3: float = key("of the course")
    u_m3: float = key("its standard uncertainty")


def shell_of(result):
    """Return the `Wall` of a tank; None without courses or without surveyed points."""
    if result.wall is None:
        return None
    shell, sections = result.wall.shell, result.wall.sections
    residuals = np.concatenate([section.circle.residuals_m for section in sections])
    return fill_from(
        Wall,
        shell,
        x_m=shell.axis_m[0],
        y_m=shell.axis_m[1],
        slope_x=shell.slope[0],
        slope_y=shell.slope[1],
        tilt_azimuth_deg=np.degrees(shell.tilt_azimuth_rad),
        # Each circle has three unknowns.
        residual_sd_m=np.sqrt(np.sum(residuals**2) / (len(residuals) - 3 * len(sections))),
        points=len(shell.reason),
        accepted=len(result.wall.accepted),
        height_m=result.body.shell.volume.height_m,
    )


# ---- points


def points_of(result):
    """Return the `SurveyedPoint`s, used or not; adjusted points come first."""
    rows = _tank_points(result)
    if result.adjustment is None:
        return rows
    by_name = {row.point: row for row in rows}
    adjusted = list(points_of_adjustment(result.adjustment))
    names = {row["point"] for row in adjusted}
    # Position and covariance of an adjusted point are of its target, not of the wall behind it.
    target_keys = ("x_m", "y_m", "z_m", "cov_m2")
    return [
        replace(by_name[row["point"]], **{name: row[name] for name in target_keys})
        if row["point"] in by_name
        else SurveyedPoint(**row)
        for row in adjusted
    ] + [row for row in rows if row.point not in names]


def points_of_adjustment(adjustment):
    """Return the adjusted points as rows with the keys of `SurveyedPoint`, without a tank."""
    xyz, count = np.asarray(adjustment.xyz_m), len(adjustment.names)
    columns = {declared.name: [None] * count for declared in fields(SurveyedPoint)}
    columns |= {"point": list(adjustment.names), "used": np.zeros(count, dtype=bool)}
    columns |= {f"{axis}_m": xyz[:, i] for i, axis in enumerate("xyz")}
    columns["cov_m2"] = np.asarray(adjustment.covariance_m2)
    return plain_if_short(ArrayRows(ArrayColumns(columns)))


def _make_point(points, index, **values):
    """Return the `SurveyedPoint` of a point of the job; missing values are None."""
    defaults = dict.fromkeys(("cov_m2", "course", "section", "residual_m"))
    values = {"generatrix": points.generatrix[index], **defaults, **values}
    return SurveyedPoint(points.names[index], *points.xyz_m[index], **values)


def _tank_points(result):
    if result.wall is None:
        return _scan_points(result) if result.scan is not None else []
    job = result.job
    on_sections, covariances = {}, result.wall.point_covariances_m2()
    for section in result.wall.sections:
        for member, residual in zip(section.group.members, section.circle.residuals_m, strict=True):
            on_sections[result.wall.accepted[member]] = {
                "cov_m2": covariances[member],
                "course": job.courses[section.group.course].name,
                "section": section.group.name,
                "residual_m": residual,
            }
    return [
        _make_point(job.points, index, **on_sections.get(index, {}), used=used)
        for index, used in enumerate(result.wall.shell.on_wall.tolist())
    ]


def _scan_points(result):
    points, scan = result.job.points, result.scan
    accepted = set(scan.accepted.tolist())
    return [
        _make_point(
            points,
            index,
            residual_m=scan.residuals_m[index] if index in accepted else None,
            used=index in accepted,
        )
        for index in range(len(points.names))
    ]


def rejections_of(result):
    """Return the `RejectedPoint`s with their reasons."""
    points = result.job.points
    if result.wall is not None:
        shell = result.wall.shell
        rejected = np.flatnonzero(shell.reason != "")
        residual_m, w, reason = shell.residual_m, shell.w, shell.reason
    elif result.scan is not None:
        residual_m = result.scan.residuals_m
        rejected = np.setdiff1d(np.arange(len(points.names)), result.scan.accepted)
        w, reason = residual_m / result.scan.noise_m, ["far_off"] * len(points.names)
    else:
        return []
    # Row of targets.csv of each target; targets used with hits have no row in the hits' file.
    targets = result.job.has_network and result.job.network.targets
    target_rows = {} if not targets else dict(zip(targets.point, targets.rows, strict=False))
    return [
        RejectedPoint(
            points.names[i], *points.xyz_m[i], residual_m[i], w[i], reason[i],
            target_rows.get(points.names[i]) if points.rows[i] is None else points.rows[i],
        )
        for i in rejected
    ]  # fmt: skip


# ---- sections


def sections_of(result):
    """Return the `SectionCircle` of each section as surveyed, from the bottom up."""
    if result.wall is None:
        return []
    return [_section_circle(result, section) for section in result.wall.sections]


def _section_circle(result, section):
    circle, outline, group = section.circle, section.outline, section.group
    sd = np.sqrt(np.diag(circle.cofactor_m2))
    members = result.wall.accepted[group.members]
    xyz = result.job.points.xyz_m[members]
    # Positions relative to the centre, shifted along the axis to the height of the section.
    height = xyz[:, 2] - result.job.datum.bottom_z_m - group.height_m
    offset = xyz[:, :2] - np.outer(height, result.wall.shell.slope) - (circle.x_m, circle.y_m)
    modes, azimuth_deg = outline.modes_m(), np.arange(360.0)
    return fill_from(
        SectionCircle,
        section,
        course=result.job.courses[group.course].name,
        n=len(group.members),
        x_sd_m=sd[0],
        y_sd_m=sd[1],
        radius_sd_m=sd[2],
        shape="smoothed",
        points=[result.job.points.names[i] for i in members],
        azimuth_deg=np.degrees(np.arctan2(offset[:, 0], offset[:, 1])) % 360,
        area_m2=outline.area_m2(),
        area_sd_m2=_area_sd_m2(result, section),
        outline=SectionOutline(azimuth_deg, outline.radius_m(np.radians(azimuth_deg))),
        modes=[
            FormMode(
                k=k,
                amplitude_m=np.hypot(*modes[k]),
                azimuth_deg=np.degrees(np.arctan2(modes[k, 1], modes[k, 0])) / k % (360 / k),
            )
            for k in range(2, len(modes))
        ],
    )


def _area_sd_m2(result, section):
    """Return the standard deviation of the area of a section, from its points and its form."""
    outline = section.outline
    # A = 1/2 integral of r^2, hence dA = integral of r dr, with r = basis times coefficients.
    azimuth, weight = outline.nodes()
    gradient = (outline.radius_m(azimuth) * weight) @ outline.basis(azimuth)
    by_points = (gradient @ outline.from_radii) @ section.radii_by_points
    point_variance = result.wall.spread_of(by_points[None], section.group.members)[0, 0]
    even = np.arange(EVEN) * FULL_TURN / EVEN
    form = outline.radius_m(even) @ outline.unseen_form_m(even) * FULL_TURN / EVEN
    return np.sqrt(point_variance + form @ form)


# ---- courses


def courses_of(result):
    """Return the `CourseOfShell` of each course."""
    job, rows = result.job, []
    if job.tank.kind != "vertical":
        return []
    if result.wall is not None:
        rejected = np.isin(result.wall.shell.reason, ("consensus", "snooping"))
        measured = partial(_surveyed_course, result.job.points.xyz_m[rejected, 2])
    else:
        measured = partial(_course_without_points, next(iter(result.surveys.values())))
    surveyed = shell_by_survey(result)
    for index, (course, shape) in enumerate(
        zip(job.courses, result.body.shell.volume.courses, strict=True)
    ):
        is_last = index == len(job.courses) - 1
        goes_on = result.body.highest_m > shape.top_m  # into a head on top
        top_m = shape.top_m
        if is_last and not goes_on:
            top_m = result.zero_m + result.table.height_m[-1]
        height = top_m - shape.bottom_m
        volume, u = _volume_between(result, shape.bottom_m, top_m)
        rows.append(
            fill_from(
                CourseOfShell,
                course,
                bottom_m=shape.bottom_m,
                top_m=top_m,
                **measured(result, index, shape),
                radius_sd_m=radius_sd(surveyed, shape),
                inside_radius_m=np.sqrt(volume / height / np.pi),
                area_m2=volume / height,
                area_sd_m2=u / height,
                volume_m3=volume,
                u_m3=u,
            )
        )
    return rows


def _surveyed_course(rejected_z_m, result, index, shape):
    """Return the keys of a course that follow from sections."""
    bottom = result.job.datum.bottom_z_m
    sections = [section for section in result.wall.sections if section.group.course == index]
    is_in_course = (bottom + shape.bottom_m <= rejected_z_m) & (rejected_z_m < bottom + shape.top_m)
    return {
        "sections": [section.group.name for section in sections],
        "points": sum(len(section.group.members) for section in sections),
        "rejected": np.count_nonzero(is_in_course),
        "radius_m": np.mean([section.circle.radius_m for section in sections])
        if sections
        else mean_radii(result.wall.field)[index],  # by straps or lines alone
    }


def _course_without_points(survey, result, index, shape):
    """Return the keys of a course of a wall without points: circumferences are its sections."""
    straps, names = survey.straps, []
    if straps is not None:
        adjusted = [straps.reduced[i].strap for i in straps.adjusted]
        course = result.job.courses[index].name
        names = [strap.name for strap in adjusted if strap.course == course]
    return {
        "sections": list(dict.fromkeys(names)),
        "points": len(names),
        "rejected": 0,
        "radius_m": survey.radius_m[index],
    }


def shell_by_survey(result):
    """Return the shell by the survey alone, to which the radii as surveyed refer."""
    liquid, survey = result.liquid, result.wall or result.strapped
    if liquid is None or liquid.certified != "liquid" or survey is None:
        return result.body.shell
    return body_of(result.job, survey).shell


def radius_sd(shell, shape):
    """Return the standard deviation of the mean radius of a course, m, from points and form.

    It is their part of sd(V) / (2 pi r h).
    """
    sources = shell.sources([shape.bottom_m, shape.top_m])
    variance = sum(np.sum(np.diff(source.columns_m3, axis=0) ** 2) for source in sources)
    return np.sqrt(variance) / np.diff(shell.volume.inset_m2([shape.bottom_m, shape.top_m]))[0]


def _volume_between(result, low_m, high_m):
    """Return the volume of the shell between two heights, m3, and its standard uncertainty."""
    shell = result.body.only_shell()
    volume = shell.volume_m3([low_m, high_m])
    sources = shell.sources([low_m, high_m])
    # The heights of joints do not depend on the zero of the table.
    of_shell = [source for source in sources if source.kind != "datum"]
    variance = sum(np.sum(np.diff(source.columns_m3, axis=0) ** 2) for source in of_shell)
    return volume[1] - volume[0], np.sqrt(variance)


# ---- noise of the sections


class SectionTestRecord(Saved):
    """Tests of the noise of a section."""

    section: str = key("name")
    noise_factor: float = key(
        "variance of the noise apart from the form of the wall, over the stated variance",
        of="factor",
    )
    noise_dof: float = key("its degrees of freedom", of="dof")
    noise_share: float = key("part of the redundancy of the circle that is noise", of="share")
    chi2: float = key("v'Pv about the circle")
    chi2_dof: int = key("n - 3")
    p: float | None = key("of the stated covariance, two-sided; null: it was estimated")
    compared: bool = key("whether Bartlett's test includes it", of="is_compared")
    differs: bool = key("whether it disagrees with the stated covariance")


class HomogeneityRecord(Saved):
    """Test of equal variances of the noise of the sections."""

    statistic: float | None = key("of Bartlett's test; null: fewer than two sections")
    dof: int | None = key("its degrees of freedom")
    p: float | None = key("probability of a larger statistic")
    sections: list[SectionTestRecord] = key("from the bottom up")


def homogeneity_record(job, wall):
    """Return the `HomogeneityRecord` of a wall; None if its sections have no independent noise."""
    homogeneity = None if wall is None else homogeneity_of(job, wall)
    if homogeneity is None:
        return None
    sections = [fill_from(SectionTestRecord, test) for test in homogeneity.sections]
    return fill_from(HomogeneityRecord, homogeneity, sections=sections)


# ---- decisions against the search for blunders


class OverrulingRecord(Saved):
    """A decision of a person on a point or a reading."""

    what: str = key("its name: a point, or table and row of a reading")
    kind: str = key('"point" or "reading"')
    decision: str = key('"keep" or "leave_out"')
    reason: str = key("as given")
    by: str = key('person; "": not given')
    date: str = key('of the decision; "": not given')
    searched: str | None = key(
        'result of the search alone: "" used, "removed" for a reading, "no_solution", or'
        " the reason of a rejected point; null: not computed"
    )
    off_m: float | None = key("from the wall of the search alone, outwards; null: a reading")
    w: float | None = key("normalised residual of off_m; null: not computed")
    moved_m3: float | None = key(
        "volume of the top row less that without this decision; null: not computed"
    )
    is_outrageous: bool = key("kept, and so far off that a warning names it")
    row: int | None = key("of the file")


class OverrulingsRecord(Saved):
    """All decisions, and their joint effect."""

    each: list[OverrulingRecord] = key("in the order of the file")
    moved_m3: float | None = key(
        "volume of the top row less that of the search alone; null: not computed, or that has no"
        " valid solution"
    )
    others: list[str] = key("points and readings without decision that changed sides")


def overrulings_of(result):
    """Return the `OverrulingsRecord` of a result; None without decisions."""
    overrulings = result.overrulings
    if overrulings is None:
        return None
    each = [
        _overruling(
            effect.decision,
            searched=effect.searched,
            off_m=effect.off_m,
            w=effect.w,
            moved_m3=effect.moved_m3,
            is_outrageous=effect.is_outrageous,
        )
        for effect in overrulings.each
    ]
    return fill_from(OverrulingsRecord, overrulings, each=each)


def overrulings_of_adjustment(job):
    """Return the decisions on readings of a survey that was only adjusted, without effects."""
    decisions = [item for item in getattr(job, "overrulings", ()) if item.table is not None]
    if not decisions:
        return None
    unknown = dict.fromkeys(("searched", "off_m", "w", "moved_m3"))
    each = [_overruling(decision, is_outrageous=False, **unknown) for decision in decisions]
    return OverrulingsRecord(each=each, moved_m3=None, others=[])


def _overruling(decision, **effects):
    return OverrulingRecord(
        what=decision.what,
        kind="point" if decision.table is None else "reading",
        decision=decision.decision,
        reason=decision.reason,
        by=decision.by,
        date=decision.date,
        row=decision.row,
        **effects,
    )
