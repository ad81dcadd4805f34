"""The part of the record that says what was measured: wall, points, sections, courses."""

from dataclasses import fields, replace
from functools import partial

import numpy as np

from tankcal.geometry.outlines import FULL_TURN
from tankcal.pipeline.section_homogeneity import homogeneity_of
from tankcal.pipeline.tanks import body_of
from tankcal.pipeline.wall_straps import mean_radii
from tankcal.record.columns import ArrayColumns, ArrayRows, plain_if_short
from tankcal.record.schema import Finite, Saved, filled_from, key

EVEN = 720  # azimuths; they resolve products of an outline with the highest mode of the form


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
    accepted: int = key("taken for the wall")
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

    cov_m2: list | None = key("3 x 3; of points that were handed in only where they were used")
    course: str | None = key("that it is on")
    section: str | None = key("that it is in")
    generatrix: str | None = key("as given")
    residual_m: float | None = key("distance to the circle of its section, outwards positive")
    used: bool = key("whether the wall was taken from it")


class RejectedPoint(Place):
    """A point that is not on the wall."""

    residual_m: float = key("to the wall as the others show it, or to the leaning cylinder")
    w: float | None = key("over its sd; null far from the wall")
    reason: str = key("a code, see below")
    row: int | None = key("of the file")


class SectionOutline(Saved):
    """The irregular section r(theta) about the circle's centre."""

    azimuth_deg: list[Finite] = key("each degree")
    radius_m: list[Finite] = key("there")


class FormMode(Saved):
    """A harmonic of the section's form."""

    k: int = key("waves around")
    amplitude_m: float = key("of the wave")
    azimuth_deg: float = key("of its first crest")


class SectionCircle(Saved):
    """A horizontal section of the surface as surveyed (outside for an outside survey)."""

    section: str = key("name", of="group.name")
    course: str = key("that it is in")
    height_m: Finite = key("above the bottom", of="group.height_m")
    n: int = key("points")
    x_m: Finite = key("centre of the circle", of="circle.x_m")
    y_m: Finite = key("centre of the circle", of="circle.y_m")
    x_sd_m: float = key("its sd")
    y_sd_m: float = key("its sd")
    radius_m: Finite = key("of the circle", of="circle.radius_m")
    radius_sd_m: float = key("its sd")
    variance_factor: float = key("v'Pv/(n-3): how far from a circle", of="circle.variance_factor")
    shape: str = key('"smoothed"; "interpolated" in sections of former versions')
    points: list[str] = key("names")
    azimuth_deg: list[Finite] = key("of the points")
    residual_m: list[Finite] = key("of the points from the circle", of="circle.residuals_m")
    area_m2: float = key("of the irregular section")
    area_sd_m2: float = key("its sd")
    outline: SectionOutline = key("the irregular section")
    modes: list[FormMode] = key("of its form, from k = 2 on")


class CourseOfShell(Saved):
    """A course: those of the shell, without head, bottom, deadwood or roof."""

    course: str = key("name", of="name")
    bottom_m: Finite = key("above the bottom of the tank")
    top_m: Finite = key("above the bottom of the tank")
    height_m: float = key("of the plates")
    thickness_m: float = key("of the plates")
    paint_m: float = key("thickness")
    sections: list[str] = key("names")
    points: int = key("that were used")
    rejected: int = key("near the wall")
    radius_m: float = key("mean, as surveyed")
    radius_sd_m: float = key("its sd")
    inside_radius_m: float = key("of equal area, after plate, paint and temperature")
    area_m2: float = key("inside, mean over the course")
    area_sd_m2: float = key("its sd")
    volume_m3: float = key("of the course")
    u_m3: float = key("its standard uncertainty")


def shell_of(result):
    """The `Wall` of a tank; None for a tank without courses."""
    if result.wall is None:
        return None
    shell, sections = result.wall.shell, result.wall.sections
    residuals = np.concatenate([section.circle.residuals_m for section in sections])
    return filled_from(
        Wall,
        shell,
        x_m=shell.axis_m[0],
        y_m=shell.axis_m[1],
        slope_x=shell.slope[0],
        slope_y=shell.slope[1],
        tilt_azimuth_deg=np.degrees(shell.tilt_azimuth_rad),
        residual_sd_m=np.sqrt(np.sum(residuals**2) / (len(residuals) - 3 * len(sections))),
        points=len(shell.reason),
        accepted=len(result.wall.accepted),
        height_m=result.body.shell.volume.height_m,
    )


def points_of(result):
    """Every `SurveyedPoint`, used or not; of an adjusted survey every adjusted point first."""
    rows = _points_of_tank(result)
    if result.adjustment is None:
        return rows
    of_tank = {row.point: row for row in rows}
    adjusted = list(points_of_adjustment(result.adjustment))
    names = {row["point"] for row in adjusted}
    of_target = ("x_m", "y_m", "z_m", "cov_m2")  # not of the wall behind it
    return [
        replace(of_tank[row["point"]], **{key: row[key] for key in of_target})
        if row["point"] in of_tank
        else SurveyedPoint(**row)
        for row in adjusted
    ] + [row for row in rows if row.point not in names]


def points_of_adjustment(adjustment):
    """Every adjusted point with its covariance, in their order; nothing of a tank."""
    xyz, count = np.asarray(adjustment.xyz_m), len(adjustment.names)
    columns = {key.name: [None] * count for key in fields(SurveyedPoint)}
    columns |= {"point": list(adjustment.names), "used": np.zeros(count, dtype=bool)}
    columns |= {f"{axis}_m": xyz[:, i] for i, axis in enumerate("xyz")}
    columns["cov_m2"] = np.asarray(adjustment.covariance_m2)
    return plain_if_short(ArrayRows(ArrayColumns(columns)))


def _surveyed(name, xyz, **more):
    nothing = dict.fromkeys(("cov_m2", "course", "section", "generatrix", "residual_m"))
    return SurveyedPoint(name, *xyz, **(nothing | {"used": False} | more))


def _points_of_tank(result):
    if result.wall is None:
        return _points_of_scan(result) if result.scan is not None else []
    job, shell = result.job, result.wall.shell
    place, covariances = {}, result.wall.point_covariances_m2()
    for section in result.wall.sections:
        for member, residual in zip(section.group.members, section.circle.residuals_m, strict=True):
            place[result.wall.accepted[member]] = {
                "cov_m2": covariances[member],
                "course": job.courses[section.group.course].name,
                "section": section.group.name,
                "residual_m": residual,
            }
    used = shell.on_wall.tolist()
    return [
        _surveyed(name, job.points.xyz_m[index], **place.get(index, {}),
                  generatrix=job.points.generatrix[index], used=used[index])
        for index, name in enumerate(job.points.names)
    ]  # fmt: skip


def _points_of_scan(result):
    points, scan = result.job.points, result.scan
    used = set(scan.accepted.tolist())
    return [
        _surveyed(name, points.xyz_m[index], generatrix=points.generatrix[index],
                  residual_m=scan.residuals_m[index] if index in used else None, used=index in used)
        for index, name in enumerate(points.names)
    ]  # fmt: skip


def rejected_of(result):
    """Every `RejectedPoint`, with the reason."""
    points = result.job.points
    if result.wall is not None:
        shell = result.wall.shell
        found = np.flatnonzero(shell.reason != "")
        residual_m, w, reason = shell.residual_m, shell.w, shell.reason
    elif result.scan is not None:
        residual_m = result.scan.residuals_m
        found = np.setdiff1d(np.arange(len(points.names)), result.scan.accepted)
        w, reason = residual_m / result.scan.noise_m, ["far_off"] * len(points.names)
    else:
        return []
    of_targets = _rows_of_targets(result.job)
    return [
        RejectedPoint(
            points.names[i], *points.xyz_m[i], residual_m[i], w[i], reason[i],
            of_targets.get(points.names[i]) if points.rows[i] is None else points.rows[i],
        )
        for i in found
    ]  # fmt: skip


def _rows_of_targets(job):
    """{target: row of targets.csv}; beside hits their rows are none of the hits' file."""
    given = None if job.measurements is None else job.measurements.targets
    return {} if given is None else dict(zip(given.point, given.rows, strict=False))


def sections_of(result):
    """`SectionCircle` of each section, as surveyed, from the bottom up."""
    if result.wall is None:
        return []
    return [_section_of(result, section) for section in result.wall.sections]


def _section_of(result, section):
    circle, outline, group = section.circle, section.outline, section.group
    sd = np.sqrt(np.diag(circle.cofactor_m2))
    members = result.wall.accepted[group.members]
    xyz = result.job.points.xyz_m[members]
    height = xyz[:, 2] - result.job.datum.bottom_z_m - group.height_m
    offset = xyz[:, :2] - np.outer(height, result.wall.shell.slope) - (circle.x_m, circle.y_m)
    modes, even = outline.modes_m(), np.arange(360.0)
    return filled_from(
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
        area_sd_m2=_area_sd(result, section),
        outline=SectionOutline(even, outline.radius_m(np.radians(even))),
        modes=[
            FormMode(
                k=k,
                amplitude_m=np.hypot(*modes[k]),
                azimuth_deg=np.degrees(np.arctan2(modes[k, 1], modes[k, 0])) / k % (360 / k),
            )
            for k in range(2, len(modes))
        ],
    )


def _area_sd(result, section):
    outline = section.outline
    azimuth, weight = outline.nodes()
    gradient = (outline.radius_m(azimuth) * weight) @ outline.basis(azimuth)
    by_points = (gradient @ outline.from_radii) @ section.radii_by_points
    own = result.wall.spread_of(by_points[None], section.group.members)[0, 0]
    even = np.arange(EVEN) * FULL_TURN / EVEN
    form = outline.radius_m(even) @ outline.unseen_form_m(even) * FULL_TURN / EVEN
    return np.sqrt(own + form @ form)


def courses_of(result):
    """The `CourseOfShell` of each course."""
    job, rows = result.job, []
    if job.tank.kind != "vertical":
        return []
    measured = _of_straps if result.strapped is not None else _of_drawing
    if result.wall is not None:
        measured = partial(_of_sections, _rejected_z_m(result))
    elif result.radii is not None:
        measured = _of_radii
    surveyed = surveyed_shell(result)
    for index, (course, shape) in enumerate(
        zip(job.courses, result.body.shell.volume.courses, strict=True)
    ):
        is_last = index == len(job.courses) - 1
        goes_on = result.body.highest_m > shape.top_m  # into a head on top
        top_m = shape.top_m
        if is_last and not goes_on:
            top_m = result.zero_m + result.table.height_m[-1]
        height = top_m - shape.bottom_m
        volume, u = _partial(result, shape.bottom_m, top_m)
        rows.append(
            filled_from(
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


def _rejected_z_m(result):
    """(k,) heights of the points near the wall that were rejected, in the survey's frame."""
    rejected = np.isin(result.wall.shell.reason, ("consensus", "snooping"))
    return result.job.points.xyz_m[rejected, 2]


def _of_sections(rejected_z_m, result, index, shape):
    """What the sections of a course give."""
    bottom = result.job.datum.bottom_z_m
    own = [section for section in result.wall.sections if section.group.course == index]
    above = bottom + shape.bottom_m <= rejected_z_m
    in_course = above & (rejected_z_m < bottom + shape.top_m)
    return {
        "sections": [section.group.name for section in own],
        "points": sum(len(section.group.members) for section in own),
        "rejected": np.count_nonzero(in_course),
        "radius_m": np.mean([section.circle.radius_m for section in own])
        if own
        else mean_radii(result.wall.field)[index],  # by straps or lines alone
    }


def _of_straps(result, index, shape):
    """What the straps of a course give: circumferences in place of sections and points."""
    wall, name = result.strapped, result.job.courses[index].name
    straps = wall.straps
    own = [straps.reduced[i].strap.name for i in straps.adjusted
           if straps.reduced[i].strap.course == name]  # fmt: skip
    return {
        "sections": list(dict.fromkeys(own)),
        "points": len(own),
        "rejected": 0,
        "radius_m": wall.radius_m[index],
    }


def _of_drawing(result, index, shape):
    """Of a course that only liquid measured."""
    return {
        "sections": [],
        "points": 0,
        "rejected": 0,
        "radius_m": result.nominal.radius_m[index],
    }


def _of_radii(result, index, shape):
    """Of a course whose radius was declared."""
    return {
        "sections": [],
        "points": 0,
        "rejected": 0,
        "radius_m": result.radii.radius_m[index],
    }


def surveyed_shell(result):
    """The shell as the survey alone has it, beside the radii that it found."""
    liquid, survey = result.liquid, result.wall or result.strapped
    if liquid is None or liquid.certified != "liquid" or survey is None:
        return result.body.shell
    return body_of(result.job, survey).shell


def radius_sd(shell, shape):
    """Of the mean radius of a course, from points and form: their part of sd(V) / (2 pi r h)."""
    sources = shell.sources([shape.bottom_m, shape.top_m])
    variance = sum(np.sum(np.diff(source.columns_m3, axis=0) ** 2) for source in sources)
    return np.sqrt(variance) / np.diff(shell.volume.inset_m2([shape.bottom_m, shape.top_m]))[0]


def _partial(result, low_m, high_m):
    """Volume between two heights above the bottom and its standard uncertainty, exactly."""
    shell = result.body.only_shell()
    volume = shell.volume_m3([low_m, high_m])
    sources = shell.sources([low_m, high_m])
    of_shell = [source for source in sources if source.kind != "datum"]  # joints know no zero
    variance = sum(np.sum(np.diff(source.columns_m3, axis=0) ** 2) for source in of_shell)
    return volume[1] - volume[0], np.sqrt(variance)


# ---- noise of the sections


class SectionTestRecord(Saved):
    """Tests of the noise of a section."""

    section: str = key("name")
    noise_factor: float = key(
        "variance of the noise apart from the form of the wall, over the stated one", of="factor"
    )
    noise_dof: float = key("its degrees of freedom", of="dof")
    noise_share: float = key("part of the redundancy of the circle that is noise", of="share")
    chi2: float = key("v'Pv about the circle")
    chi2_dof: int = key("n - 3")
    p: float | None = key("of the stated covariance, two-sided; null: it was estimated")
    compared: bool = key("whether it takes part in Bartlett's test", of="is_compared")
    differs: bool = key("whether it disagrees with the stated covariance")


class HomogeneityRecord(Saved):
    """Whether the sections have one variance of noise."""

    statistic: float | None = key("of Bartlett's test; null: fewer than two sections take part")
    dof: int | None = key("its degrees of freedom")
    p: float | None = key("probability of a larger statistic")
    sections: list[SectionTestRecord] = key("from the bottom up")


def homogeneity_record(job, wall):
    """`HomogeneityRecord` of a wall; None where its sections have no noise of their own."""
    found = None if wall is None else homogeneity_of(job, wall)
    if found is None:
        return None
    sections = [filled_from(SectionTestRecord, one) for one in found.sections]
    return filled_from(HomogeneityRecord, found, sections=sections)


# ---- decisions against the search for blunders


class OverrulingRecord(Saved):
    """A point or a reading that was decided by hand."""

    what: str = key("its name: a point, or table and row of a reading")
    kind: str = key('"point" or "reading"')
    decision: str = key('"keep" or "leave_out"')
    reason: str = key("as given")
    by: str = key('who decided; "": not given')
    date: str = key('when; "": not given')
    searched: str | None = key(
        'what the search alone does with it: "" it uses it, "removed" a reading, "no_solution", or'
        " the reason of a rejected point; null: not computed"
    )
    off_m: float | None = key("from the wall as the search alone has it, outwards; null: a reading")
    w: float | None = key("its normalised residual there; null: none was computed")
    moved_m3: float | None = key(
        "volume of the top row less that without this decision; null: not computed"
    )
    is_outrageous: bool = key("kept, and so far off that it is told as a warning")
    row: int | None = key("of the file")


class OverrulingsRecord(Saved):
    """All decisions, and what they change together."""

    each: list[OverrulingRecord] = key("in the order of the file")
    moved_m3: float | None = key(
        "volume of the top row less that of the search alone; null: not computed, or that has no"
        " sound solution"
    )
    others: list[str] = key("points and readings without decision that changed sides")


def overrulings_of(result):
    """`OverrulingsRecord` of a result; None where nothing was decided."""
    found = result.overrulings
    if found is None:
        return None
    return filled_from(
        OverrulingsRecord,
        found,
        each=[
            _saved(
                one.decision,
                searched=one.searched,
                off_m=one.off_m,
                w=one.w,
                moved_m3=one.moved_m3,
                is_outrageous=one.is_outrageous,
            )
            for one in found.each
        ],
    )


def overrulings_of_adjustment(job):
    """The same of a survey that was only adjusted: its readings, without what that changed."""
    decided = [one for one in getattr(job, "overrulings", ()) if one.table is not None]
    if not decided:
        return None
    nothing = dict.fromkeys(("searched", "off_m", "w", "moved_m3"))
    each = [_saved(one, is_outrageous=False, **nothing) for one in decided]
    return OverrulingsRecord(each=each, moved_m3=None, others=[])


def _saved(decision, **found):
    return OverrulingRecord(
        what=decision.what,
        kind="point" if decision.table is None else "reading",
        decision=decision.decision,
        reason=decision.reason,
        by=decision.by,
        date=decision.date,
        row=decision.row,
        **found,
    )
