"""The empty job of a plan: all known input, and blank cells for the measurements."""

import hashlib
from math import degrees, isfinite

from tankcal.errors import InputError, Problem
from tankcal.geometry.rotations import angles_of
from tankcal.job.contract import COLUMNS
from tankcal.job.contract.registers import SHORT_KEYS
from tankcal.job.starter import FilledForm, write_form
from tankcal.messages import message
from tankcal.planning.measurements import targets_of
from tankcal.planning.model import TAPED
from tankcal.planning.wall.reading import tables_of
from tankcal.record.plan import PLAN, WALL_PLAN
from tankcal.text.delimited import read_json
from tankcal.text.shipped import DEFAULT
from tankcal.units import ARCSEC_PER_DEG

MEASURED = (
    *("survey.date", "survey.shell_temperature_c", "survey.liquid_level_m"),
    *("survey.liquid_density_kg_m3", "datum.bottom_z_m", "datum.dip_plate_z_m", "datum.dip_x_m"),
    *("datum.dip_y_m", "datum.reference_height_m"),
)  # settings known only on the day of the survey
COPIED = ("courses", "welds", "bottom", "deadwood", "uncertainty", "correlations", "stated")
COPIED_OF_WALL = (*COPIED, "obstructions", "thickness", "tape_checks")
SIGHTS = ("directions", "zenith_angles", "slope_distances")
READINGS = (  # columns left blank in the tables of a bare wall
    *("reading_m", "offset_mm", "direction_deg", "zenith_deg", "distance_m", "angle_deg", "time"),
)
BATCHES = (  # columns left blank in liquid.csv
    *("volume_m3", "dip_m", "meter_temperature_c", "tank_temperature_c"),
    "shell_temperature_c",
)


def write(prediction, directory, workbook=False):
    """Write the empty job of a plan of targets.

    Parameters
    ----------
    prediction : Prediction
    directory : path
        New folder.
    workbook : bool, optional
        Write job.xlsx instead of text files.
    """
    write_form(directory, form_of(prediction), workbook)


def write_wall(prediction, directory, workbook=False):
    """Write the empty job of a plan of the bare wall.

    Parameters are those of `write`, with a WallPrediction.
    """
    write_form(directory, form_of_wall(prediction.plan), workbook)


def fingerprints(folder):
    """Return [{file, sha256}] of an empty job, which distinguish it from a completed job."""
    return [
        {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        for path in sorted(folder.iterdir())
    ]


def refuse_filled(folder, plan_file):
    """Raise InputError if the job in a folder differs from the empty job listed in plan.json.

    The error is also raised if plan.json cannot be read, as the job may then be completed.
    """
    if not folder.exists():
        return
    try:
        plan = read_json(plan_file)
    except (OSError, ValueError, RecursionError):
        expected = None
    else:
        is_wall = WALL_PLAN.version_of(plan) is not None
        expected = (WALL_PLAN if is_wall else PLAN).migrated(plan, plan_file.name)["job"]
    if not folder.is_dir() or fingerprints(folder) != expected:
        raise InputError(
            Problem(
                folder.name,
                message(
                    "plan_job_filled",
                    "is no longer the empty job that tankcal wrote; it will not be replaced: "
                    "move it away or choose another --out",
                ),
            )
        )


# ---- plans of targets


def form_of(prediction):
    """Return the FilledForm of a Prediction whose plan was read from files."""
    plan = prediction.plan
    tables = _tables(prediction)
    filled = [name for name, rows in tables.items() if rows]
    return _form(
        plan,
        kind="vertical",
        survey=_kind_of_survey(plan),
        settings=_settings_of(plan.raw),
        copied=COPIED,
        tables=tables,
        more=tuple(name for name in COLUMNS if name in filled),
    )


def _form(plan, *, kind, survey, settings, copied, tables, more):
    """Return the FilledForm of a Plan or WallPlan with its settings, tables and registers."""
    raw = plan.raw
    given = {name: rows_of_table(raw.tables[name]) for name in copied if name in raw.tables}
    return FilledForm(
        kind=kind,
        survey=survey,
        language=plan.job.table.language or DEFAULT,
        settings={key: value for key, value in settings.items() if key not in MEASURED},
        given=given | tables,
        registered={
            name: _entries_of_register(name, register) for name, register in raw.registers.items()
        },
        to_fill=tuple(key for key in settings if key in MEASURED),
        more=more,
    )


def _settings_of(raw):
    """Return {"section.key": text} of the settings of a RawJob."""
    return {
        f"{section}.{key}": _text_of(value.raw)
        for section, entries in raw.settings.items()
        for key, value in entries.items()
    }


def _kind_of_survey(plan):
    """Kind of the survey, as in `tankcal new`."""
    if plan.photos:
        return "photos"
    return "triangulation" if plan.bases else "total-station"


def _tables(prediction):
    """Return {table: rows} of the readings of the survey, without values."""
    plan = prediction.plan
    return {
        "targets": _targets(plan),
        "photos": tuple(_photo(plan, photo) for photo in plan.photos),
        "control": tuple(_control(known) for known in plan.known),
        "setups": tuple(
            {"setup": setup.name, "station": setup.name, "instrument": setup.instrument}
            for setup in plan.setups
        ),
        **{table: _ties(plan, table) for table in TAPED},
        "stadia": _bases(plan),
        **_sights(prediction),
    }


def _targets(plan):
    targets = targets_of(plan)
    columns = (targets.point, targets.section, targets.generatrix, targets.z_m, targets.offset_m)
    return tuple(
        {
            "point": point,
            "section": section,
            "generatrix": line,
            "z_m": _shorten(z, 4),
            "offset_mm": _shorten(1000 * offset, 3),
        }
        for point, section, line, z, offset in zip(*columns, strict=True)
    )


def _photo(plan, photo):
    """Row of photos.csv; if control defines the frame, the orientation is estimated from it."""
    row = {"photo": photo.name, "camera": photo.camera}
    if plan.job.measurements.settings.datum == "control":
        return row
    position = {f"{axis}_m": _shorten(x, 3) for axis, x in zip("xyz", photo.xyz_m, strict=True)}
    angles = {
        f"{name}_deg": _shorten(degrees(angle), 2)
        for name, angle in zip(("omega", "phi", "kappa"), angles_of(photo.rotation), strict=True)
    }
    return row | position | angles


def _control(known):
    """Row of control.csv: the planned sds, without coordinates."""
    sds = zip("xyz", known.sd_m, strict=True)
    return {"point": known.name} | {f"s{axis}_mm": _mm(sd) for axis, sd in sds if isfinite(sd)}


def _ties(plan, table):
    rows = []
    for tie in plan.ties:
        if tie.table != table:
            continue
        row = {"from": tie.start, "to": tie.end, "s_mm": _mm(tie.sd_m)}
        if table == "distances":
            row |= {"kind": tie.kind, "instrument": tie.instrument or ""}
        rows += [row] * tie.readings
    return tuple(rows)


def _bases(plan):
    """Rows of stadia.csv, one for each reading."""
    rows = []
    for base in plan.bases:
        row = {"setup": base.setup, "to": base.to, "bar": base.bar}
        row |= {"s_arcsec": _arcsec(base.angle_sd_rad)}
        rows += [row] * base.readings
    return tuple(rows)


def _sights(prediction):
    """Return {table: rows} of the sights from each set-up, set by set."""
    setups = {setup.name: setup for setup in prediction.plan.setups}
    rows = {table: [] for table in SIGHTS}
    for readings in prediction.measurements.readings:
        table = readings.table
        if table not in SIGHTS:
            continue
        ends_of = {}
        for name, end in zip(readings.setup, readings.end, strict=True):
            ends_of.setdefault(name, []).append(end)
        for name, ends in ends_of.items():
            sd = _sd_of_sight(table, setups[name])
            for number in range(1, setups[name].sets + 1):
                set_number = {"set": str(number)} if table == "directions" else {}
                rows[table] += [{"setup": name, "to": end} | sd | set_number for end in ends]
    return {table: tuple(of_table) for table, of_table in rows.items()}


def _sd_of_sight(table, setup):
    if table == "slope_distances":
        return {"s_mm": _mm(setup.distance_sd_m)}
    return {
        "s_arcsec": _arcsec(
            setup.direction_sd_rad if table == "directions" else setup.zenith_sd_rad
        )
    }


# ---- plans of the bare wall


def form_of_wall(plan):
    """Return the FilledForm of a WallPlan: a row for each reading, without its value."""
    design, settings = plan.design, _settings_of(plan.raw)
    if design.datum is not None:
        settings.setdefault("adjustment.datum", design.datum)
    tables = {
        name: tuple(
            {
                name: "" if name in READINGS else _shorten_cell(cell)
                for name, cell in zip(table.headings, row, strict=True)
            }
            for row in table.rows
        )
        for name, table in tables_of(plan).items()
    }
    if design.runs:
        tables["liquid"] = _runs(plan)
    return _form(
        plan,
        kind=plan.job.tank.kind,
        survey=design.parts[0].survey,
        settings=settings,
        copied=COPIED_OF_WALL,
        tables=tables,
        more=tuple(tables),
    )


def _runs(plan):
    """Rows of liquid.csv without readings; the planned dip is a note.

    The start of a run from a dip has the volume 0. Without dip and volume, it would mean the dry
    tank.
    """
    rows = []
    for row in rows_of_table(tables_of(plan)["liquid"]):
        dip = row.get("dip_m", "")
        kept = {name: _shorten_cell(cell) for name, cell in row.items() if name not in BATCHES}
        volume = {} if dip else {"volume_m3": "0"}
        rows.append(kept | volume | {"note": f"{_shorten_cell(dip)} m" if dip else ""})
    return tuple(rows)


# ---- texts


def rows_of_table(table):
    """Return the rows of a Table, {column: text} each."""
    return tuple(
        {name: _text_of(cell) for name, cell in zip(table.headings, row, strict=True)}
        for row in table.rows
    )


def _entries_of_register(name, register):
    """Return {entry: {key: text}} of a register, with the keys of a starter job."""
    long_keys = {short: long for long, short in SHORT_KEYS[name].items()}
    return {
        entry: {long_keys.get(key, key): _text_of(value.raw) for key, value in values.items()}
        for entry, values in register.entries.items()
    }


def _text_of(raw):
    """Text of a value of TOML or CSV, with the same meaning in a job."""
    if raw is None:
        return ""
    if isinstance(raw, bool):
        return "true" if raw else "false"
    if isinstance(raw, list):
        items = ["-".join(map(str, item)) if isinstance(item, list) else str(item) for item in raw]
        return "; ".join(items)
    return str(raw)


def _mm(metres):
    return _shorten(1000 * metres, 6)


def _arcsec(angle_rad):
    return _shorten(ARCSEC_PER_DEG * degrees(angle_rad), 6)


def _shorten(value, decimals):
    """Text of a number without final zeros."""
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def _shorten_cell(cell):
    """Return a cell; a number is returned without final zeros."""
    try:
        return _shorten(float(cell), 6)
    except ValueError:
        return cell
