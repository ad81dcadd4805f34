"""`tankcal read-table`: the geometry of a tank out of a former table, and a job made of it."""

from pathlib import Path

from tankcal.cli.arguments import add_language, positive
from tankcal.cli.showing import (
    language_of_run,
    marks,
    prepare_for_small_work,
    print_paths,
    say,
    speak_of_record,
    warn,
)
from tankcal.messages import message
from tankcal.text.digits import fixed, format_with_u

MOST_SHOWN = 30  # courses


def add(commands):
    """The parser of `tankcal read-table`."""
    parser = commands.add_parser(
        "read-table",
        help="determine radii, head and zero from a former capacity table",
        description="Determine the geometry of a tank from a capacity table of any origin. For a "
        "vertical tank: radii of the courses, density of the head, zero, seams and deadwood. "
        "For a horizontal tank or a sphere: its dimensions. Each result has the uncertainty "
        "due to rounding. With --out, write a job that reproduces the table, also for "
        "another density or temperature. docs/read-table.md describes the method.",
        epilog="exit status: 0 done; 2 the table or the courses must be corrected (one line per "
        "problem); 3 the table does not determine the tank.",
    )
    parser.add_argument(
        "file",
        metavar="OLD",
        help="the table: CSV, Excel workbook, PDF with text, record.json, or a former.toml that "
        "names it",
    )
    parser.add_argument(
        "--courses",
        metavar="FILE",
        help="courses.csv: course, height_m (blank: seams are estimated), thickness_mm, from the "
        "bottom up",
    )
    parser.add_argument(
        "--kind",
        choices=("vertical", "horizontal", "sphere"),
        help="kind of tank (default: kind in former.toml, else vertical)",
    )
    parser.add_argument(
        "--former", metavar="FILE", help="former.toml: further facts about the former table"
    )
    parser.add_argument("--out", metavar="DIR", help="write a job to this folder, all or nothing")
    parser.add_argument(
        "--e-gpa", metavar="GPA", type=positive, default=206.0,
        help="Young's modulus of the shell (default 206)",
    )  # fmt: skip
    parser.add_argument(
        "--bottom", metavar="M", type=positive,
        help="dip of the highest point of the bottom, m (default: estimated)",
    )  # fmt: skip
    add_language(parser)
    parser.set_defaults(command=_read_table)


def _read_table(options):
    prepare_for_small_work()
    speak_of_record(options.language, options.file)
    from tankcal.recalibration.read_table import read_table
    from tankcal.report.table_job import refuse_foreign_job, write_job

    if options.out is not None:
        refuse_foreign_job(options.out)
    read = read_table(
        options.file,
        options.courses,
        options.former,
        kind=options.kind,
        e_pa=1e9 * options.e_gpa,
        bottom_m=options.bottom,
    )
    warn(read.warnings)
    for line in _summary(read):
        say(line)
    if options.out is not None:
        written = write_job(read.job, options.out, language_of_run())
        print_paths(Path(options.out), written)
        say(message("read_run", "  tankcal run {folder}", folder=str(options.out)))


def _summary(read):
    found = read.geometry
    former = read.former
    yield message(
        "read_rows",
        "{name}: {count} rows, {low} to {high} m",
        name=str(former.name),
        count=len(former.height_m),
        low=fixed(former.height_m[0], 3, marks()),
        high=fixed(former.height_m[-1], 3, marks()),
    )
    for k, name in enumerate(read.names[:MOST_SHOWN]):
        radius, u = _with_u(found.radii_m[k], found.u_m[k])
        yield message(
            "read_radius",
            "course {name}: radius {radius} m, u {u} m",
            name=name,
            radius=radius,
            u=u,
        )
    if hasattr(found, "head"):
        yield from _of_table(found)
    elif not read.names:
        yield from _of_solid(found)


def _of_solid(found):
    """Sizes of a lying tank or a sphere."""
    fit = getattr(found, "best", found)
    values = dict(zip(fit.names, zip(fit.values, fit.u, strict=True), strict=True))
    yield _size(message("read_diameter", "diameter"), values["diameter"])
    if "length" in values:
        yield _size(message("read_length", "length of the cylinder"), values["length"])
        yield _ends(found, fit)
    if "end_depth" in values:
        yield _size(message("read_depth", "depth of the ends"), values["end_depth"])
    yield _size(message("read_zero_of_solid", "depth minus dip"), values["zero"])
    if hasattr(found, "tilted"):
        yield from _tilt(found)
    yield message(
        "read_left_solid", "residuals: {rms} L (rms)", rms=fixed(1000 * fit.rms_m3, 2, marks())
    )


def _ends(found, fit):
    from tankcal.recalibration.solid_geometry import TOLD_APART

    ends = fit.ends.replace("_", " ")
    others = [one for one in found.worse_by if one not in (fit.ends, *found.not_told_apart)]
    if not others:
        return message("read_ends", "ends: {ends}", ends=ends)
    return message(
        "read_ends_best",
        "ends: {ends}; the next best form, {other}, raises chi2 by {by} (significant from {limit})",
        ends=ends,
        other=others[0].replace("_", " "),
        by=fixed(found.worse_by[others[0]], 0, marks()),
        limit=fixed(TOLD_APART, 0, marks()),
    )


def _tilt(found):
    least, largest = (1000 * one for one in found.tilt_size)
    if found.tilted is None:
        yield message(
            "read_no_tilt",
            "tilt as additional unknown: no tilt improves the fit; up to {largest} mm/m in "
            "either direction fits as well",
            largest=fixed(largest, 1, marks()),
        )
        return
    tilt, u = (1000 * one for one in found.tilted["tilt"])
    if found.tilted is not found.best:
        yield message(
            "read_tilt",
            "tilt as additional unknown: {tilt} mm/m, u {u} mm/m; it lowers chi2 by {gain}; "
            "{least} to {largest} mm/m in either direction would fit",
            tilt=fixed(tilt, 2, marks()),
            u=fixed(u, 2, marks()),
            gain=fixed(found.tilt_gain, 1, marks()),
            least=fixed(least, 1, marks()),
            largest=fixed(largest, 1, marks()),
        )
        return
    other, zero = found.tilted.mirrored
    yield message(
        "read_leaning",
        "tilt: {tilt} mm/m, u {u} mm/m: no level tank explains the rows; {other} mm/m with "
        "dips smaller by {zero} mm gives the same volumes",
        tilt=fixed(tilt, 2, marks()),
        u=fixed(u, 2, marks()),
        other=fixed(1000 * other, 2, marks()),
        zero=fixed(1000 * zero, 1, marks()),
    )


def _size(name, size):
    value, u = _with_u(*map(float, size))
    return message("read_size", "{name}: {value} m, u {u} m", name=name, value=value, u=u)


def _with_u(value, u):
    both = format_with_u(value, u, marks(), least=0)
    return both.value, both.uncertainty


def _of_table(found):
    yield _head(found)
    if found.without_head is not None:
        rms, largest, radii = found.without_head
        yield message(
            "read_head_left_out",
            "  without the head, residuals of {rms} L (rms), at most {largest} L, and radii that "
            "differ by up to {radii} mm",
            rms=fixed(1000 * rms, 2, marks()),
            largest=fixed(1000 * largest, 1, marks()),
            radii=fixed(1000 * abs(radii - found.radii_m).max(), 2, marks()),
        )
    yield _zero(found)
    for number, seam in enumerate(found.seams_m, 1):
        yield _seam(number, seam)
    for one in found.fittings:
        yield _thing(one)
    if not found.fittings:
        yield message("read_no_things", "no deadwood detected")
    if found.roof_m3 is not None:
        volume, u = _with_u(found.roof_m3.value, found.roof_m3.u)
        yield message(
            "read_roof", "floating roof: {volume} m3 above its zone, u {u} m3", volume=volume, u=u
        )
    volume, u = _with_u(found.base_m3.value, found.base_m3.u or found.expected_m3)
    yield message(
        "read_lowest",
        "rows used from {lowest} m upwards; {volume} m3 below, u {u} m3",
        lowest=fixed(found.lowest_m, 3, marks()),
        volume=volume,
        u=u,
    )
    yield message(
        "read_left",
        "residuals: {rms} L (rms), at most {largest} L; rounding alone causes {expected} L (rms)",
        rms=fixed(1000 * found.rms_m3, 2, marks()),
        largest=fixed(1000 * found.largest_m3, 2, marks()),
        expected=fixed(1000 * found.expected_m3, 2, marks()),
    )


def _head(found):
    density, u = _with_u(found.density_kg_m3.value, found.density_kg_m3.u)
    if found.head == "with":
        return message(
            "read_with_head",
            "computed with the head of {density} kg/m3, u {u} (t = {t})",
            density=density,
            u=u,
            t=fixed(found.t, 0, marks()),
        )
    if found.head == "without":
        return message(
            "read_without_head",
            "computed without head: {density} kg/m3, u {u} (t = {t})",
            density=density,
            u=u,
            t=fixed(found.t, 1, marks()),
        )
    return message(
        "read_undecided_head",
        "head not determined by this table (its density has u {u} kg/m3): radii and job are "
        "for {density} kg/m3",
        density=fixed(found.state.density_kg_m3, 0, marks()),
        u=u,
    )


def _zero(found):
    if found.zero_m.u == 0:
        return message("read_zero_held", "zero: the bottom of the first course")
    if not found.zero_m.u <= 0.05:
        return message("read_zero_unknown", "zero: not determined by this table")
    zero, u = _with_u(1000 * found.zero_m.value, 1000 * found.zero_m.u)
    return message(
        "read_zero",
        "zero: the first course begins at the dip {zero} mm, u {u} mm",
        zero=zero,
        u=u,
    )


def _seam(number, seam):
    if not seam.u < 0.04:
        return message("read_no_seam", "seam {number}: not determined", number=number)
    dip, u = _with_u(seam.value, seam.u)
    return message("read_seam", "seam {number}: {dip} m, u {u} m", number=number, dip=dip, u=u)


def _thing(one):
    volume, u = _with_u(1000 * one.volume_m3.value, 1000 * one.volume_m3.u)
    return message(
        "read_thing",
        "deadwood from {bottom} to {top} m: {volume} L, u {u} L",
        bottom=fixed(one.bottom_m.value, 3, marks()),
        top=fixed(one.top_m.value, 3, marks()),
        volume=volume,
        u=u,
    )
