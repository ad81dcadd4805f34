"""`tankcal read-table`: geometry of a tank from a former table, and a job for it."""

from pathlib import Path

from tankcal.messages import message
from tankcal.terminal import (
    add_language,
    language_of_run,
    marks,
    parse_positive,
    print_paths,
    say,
    speak_of_record,
    warn,
)
from tankcal.text.digits import fixed, format_with_u

MOST_SHOWN = 30  # courses


def add(commands):
    """Add the parser of `tankcal read-table`."""
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
        "--e-gpa", metavar="GPA", type=parse_positive, default=206.0,
        help="Young's modulus of the shell (default 206)",
    )  # fmt: skip
    parser.add_argument(
        "--bottom", metavar="M", type=parse_positive,
        help="dip of the highest point of the bottom, m (default: estimated)",
    )  # fmt: skip
    add_language(parser)
    parser.set_defaults(command=_read_table)


def _read_table(options):
    speak_of_record(options.language, options.file)
    from tankcal.products.recalibration.read_table import read_table
    from tankcal.products.recalibration.table_job import refuse_foreign_job, write_job

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
    geometry = read.geometry
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
        radius, u = _format_with_u(geometry.radii_m[k], geometry.u_m[k])
        yield message(
            "read_radius",
            "course {name}: radius {radius} m, u {u} m",
            name=name,
            radius=radius,
            u=u,
        )
    if hasattr(geometry, "head"):
        yield from _describe_shell(geometry)
    elif not read.names:
        yield from _describe_solid(geometry)


def _describe_solid(geometry):
    """Yield the dimensions of a horizontal tank or a sphere."""
    fit = getattr(geometry, "best", geometry)
    values = dict(zip(fit.names, zip(fit.values, fit.u, strict=True), strict=True))
    yield _size(message("read_diameter", "diameter"), values["diameter"])
    if "length" in values:
        yield _size(message("read_length", "length of the cylinder"), values["length"])
        yield _ends(geometry, fit)
    if "end_depth" in values:
        yield _size(message("read_depth", "depth of the ends"), values["end_depth"])
    yield _size(message("read_zero_of_solid", "depth minus dip"), values["zero"])
    if hasattr(geometry, "tilted"):
        yield from _tilt(geometry)
    yield message(
        "read_left_solid", "residuals: {rms} L (rms)", rms=fixed(1000 * fit.rms_m3, 2, marks())
    )


def _ends(geometry, fit):
    from tankcal.products.recalibration.solid_geometry import EXCLUDING_CHI2

    ends = fit.ends.replace("_", " ")
    others = [
        form for form in geometry.chi2_excess if form not in (fit.ends, *geometry.equally_good_ends)
    ]
    if not others:
        return message("read_ends", "ends: {ends}", ends=ends)
    return message(
        "read_ends_best",
        "ends: {ends}; the next best form, {other}, raises chi2 by {by} (significant from {limit})",
        ends=ends,
        other=others[0].replace("_", " "),
        by=fixed(geometry.chi2_excess[others[0]], 0, marks()),
        limit=fixed(EXCLUDING_CHI2, 0, marks()),
    )


def _tilt(geometry):
    least, largest = (1000 * tilt_m_m for tilt_m_m in geometry.tilt_size)
    if geometry.tilted is None:
        yield message(
            "read_no_tilt",
            "tilt as additional unknown: no tilt improves the fit; up to {largest} mm/m in "
            "either direction fits as well",
            largest=fixed(largest, 1, marks()),
        )
        return
    tilt, u = (1000 * value for value in geometry.tilted["tilt"])
    if geometry.tilted is not geometry.best:
        yield message(
            "read_tilt",
            "tilt as additional unknown: {tilt} mm/m, u {u} mm/m; it lowers chi2 by {gain}; "
            "{least} to {largest} mm/m in either direction would fit",
            tilt=fixed(tilt, 2, marks()),
            u=fixed(u, 2, marks()),
            gain=fixed(geometry.tilt_gain, 1, marks()),
            least=fixed(least, 1, marks()),
            largest=fixed(largest, 1, marks()),
        )
        return
    other, zero = geometry.tilted.mirror_image
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
    value, u = _format_with_u(*map(float, size))
    return message("read_size", "{name}: {value} m, u {u} m", name=name, value=value, u=u)


def _format_with_u(value, u):
    both = format_with_u(value, u, marks(), least=0)
    return both.value, both.uncertainty


def _describe_shell(geometry):
    yield _head(geometry)
    if geometry.without_head is not None:
        rms, largest, radii = geometry.without_head
        yield message(
            "read_head_left_out",
            "  without the head, residuals of {rms} L (rms), at most {largest} L, and radii that "
            "differ by up to {radii} mm",
            rms=fixed(1000 * rms, 2, marks()),
            largest=fixed(1000 * largest, 1, marks()),
            radii=fixed(1000 * abs(radii - geometry.radii_m).max(), 2, marks()),
        )
    yield _zero(geometry)
    for number, seam in enumerate(geometry.seams_m, 1):
        yield _seam(number, seam)
    for fitting in geometry.fittings:
        yield _describe_deadwood(fitting)
    if not geometry.fittings:
        yield message("read_no_things", "no deadwood detected")
    if geometry.roof_m3 is not None:
        volume, u = _format_with_u(geometry.roof_m3.value, geometry.roof_m3.u)
        yield message(
            "read_roof", "floating roof: {volume} m3 above its zone, u {u} m3", volume=volume, u=u
        )
    volume, u = _format_with_u(geometry.base_m3.value, geometry.base_m3.u or geometry.expected_m3)
    yield message(
        "read_lowest",
        "rows used from {lowest} m upwards; {volume} m3 below, u {u} m3",
        lowest=fixed(geometry.lowest_m, 3, marks()),
        volume=volume,
        u=u,
    )
    yield message(
        "read_left",
        "residuals: {rms} L (rms), at most {largest} L; rounding alone causes {expected} L (rms)",
        rms=fixed(1000 * geometry.rms_m3, 2, marks()),
        largest=fixed(1000 * geometry.largest_m3, 2, marks()),
        expected=fixed(1000 * geometry.expected_m3, 2, marks()),
    )


def _head(geometry):
    density, u = _format_with_u(geometry.density_kg_m3.value, geometry.density_kg_m3.u)
    if geometry.head == "with":
        return message(
            "read_with_head",
            "computed with the head of {density} kg/m3, u {u} (t = {t})",
            density=density,
            u=u,
            t=fixed(geometry.t, 0, marks()),
        )
    if geometry.head == "without":
        return message(
            "read_without_head",
            "computed without head: {density} kg/m3, u {u} (t = {t})",
            density=density,
            u=u,
            t=fixed(geometry.t, 1, marks()),
        )
    return message(
        "read_undecided_head",
        "head not determined by this table (its density has u {u} kg/m3): radii and job are "
        "for {density} kg/m3",
        density=fixed(geometry.state.density_kg_m3, 0, marks()),
        u=u,
    )


def _zero(geometry):
    if geometry.zero_m.u == 0:
        return message("read_zero_held", "zero: the bottom of the first course")
    if not geometry.zero_m.u <= 0.05:
        return message("read_zero_unknown", "zero: not determined by this table")
    zero, u = _format_with_u(1000 * geometry.zero_m.value, 1000 * geometry.zero_m.u)
    return message(
        "read_zero",
        "zero: the first course begins at the dip {zero} mm, u {u} mm",
        zero=zero,
        u=u,
    )


def _seam(number, seam):
    if not seam.u < 0.04:
        return message("read_no_seam", "seam {number}: not determined", number=number)
    dip, u = _format_with_u(seam.value, seam.u)
    return message("read_seam", "seam {number}: {dip} m, u {u} m", number=number, dip=dip, u=u)


def _describe_deadwood(fitting):
    volume, u = _format_with_u(1000 * fitting.volume_m3.value, 1000 * fitting.volume_m3.u)
    return message(
        "read_thing",
        "deadwood from {bottom} to {top} m: {volume} L, u {u} L",
        bottom=fixed(fitting.bottom_m.value, 3, marks()),
        top=fixed(fitting.top_m.value, 3, marks()),
        volume=volume,
        u=u,
    )
