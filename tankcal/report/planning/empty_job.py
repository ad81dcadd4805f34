"""The empty job of a plan: all that is known beforehand, with room for what will be measured."""

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
from tankcal.record.plan import PLAN, WALL_PLAN
from tankcal.text.decoding import read_json
from tankcal.text.languages import DEFAULT

ARCSEC = 3600.0
MEASURED = (
    *("survey.date", "survey.shell_temperature_c", "survey.liquid_level_m"),
    *("survey.liquid_density_kg_m3", "datum.bottom_z_m", "datum.dip_plate_z_m", "datum.dip_x_m"),
    *("datum.dip_y_m", "datum.reference_height_m"),
)  # settings that are known on the day of the survey only
AS_GIVEN = ("courses", "welds", "bottom", "deadwood", "uncertainty", "correlations", "stated")
SIGHTS = {"directions": "direction", "zenith_angles": "zenith", "slope_distances": "distance"}


def write(prediction, directory, workbook=False):
    """Write the empty job of a Prediction into a new folder, as text files or as job.xlsx."""
    write_form(directory, form_of(prediction), workbook)


def fingerprints(folder):
    """[{file, sha256}] of an empty job, by which a filled one is told from it."""
    return [
        {"file": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        for path in sorted(folder.iterdir())
    ]


def refuse_filled(folder, plan_file):
    """Raise InputError when the job in `folder` is not the empty one that `plan_file` tells of.

    Nor is it when the file is of a version that cannot be read: then nobody knows.
    """
    if not folder.exists():
        return
    try:
        plan = read_json(plan_file)
    except (OSError, ValueError, RecursionError):
        written = None
    else:
        is_wall = WALL_PLAN.version_of(plan) is not None
        written = (WALL_PLAN if is_wall else PLAN).migrated(plan, plan_file.name)["job"]
    if not folder.is_dir() or fingerprints(folder) != written:
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


def form_of(prediction):
    """The FilledForm of a Prediction whose plan was read from files."""
    plan = prediction.plan
    raw = plan.given
    settings = {
        f"{section}.{key}": text(one.raw)
        for section, entries in raw.settings.items()
        for key, one in entries.items()
    }
    used = [name for name, found in _tables(prediction).items() if found]
    return FilledForm(
        kind="vertical",
        survey=_survey(plan),
        language=plan.job.table.language or DEFAULT,
        settings={key: text for key, text in settings.items() if key not in MEASURED},
        given={name: as_given(raw.tables[name]) for name in AS_GIVEN if name in raw.tables}
        | _tables(prediction),
        registered={name: entries(name, found) for name, found in raw.registers.items()},
        to_fill=tuple(key for key in settings if key in MEASURED),
        more=tuple(name for name in COLUMNS if name in used),
    )


def _survey(plan):
    """The kind of survey, as `tankcal new` calls it."""
    if plan.photos:
        return "photos"
    return "triangulation" if plan.bases else "total-station"


def _tables(prediction):
    """{table: rows} of what the survey will measure, without values."""
    plan = prediction.plan
    return {
        "targets": _targets(plan),
        "photos": tuple(_photo(plan, one) for one in plan.photos),
        "control": tuple(_control(one) for one in plan.known),
        "setups": tuple(
            {"setup": one.name, "station": one.name, "instrument": one.instrument}
            for one in plan.setups
        ),
        **{table: _ties(plan, table) for table in TAPED},
        "stadia": _bases(plan),
        **_sights(prediction),
    }


def _targets(plan):
    found = targets_of(plan)
    columns = (found.point, found.section, found.generatrix, found.z_m, found.offset_m)
    return tuple(
        {
            "point": point,
            "section": section,
            "generatrix": line,
            "z_m": short(z, 4),
            "offset_mm": short(1000 * offset, 3),
        }
        for point, section, line, z, offset in zip(*columns, strict=True)
    )


def _photo(plan, one):
    """A row of photos.csv; where control holds the frame the orientation is found from it."""
    row = {"photo": one.name, "camera": one.camera}
    settings = plan.job.measurements.settings
    if settings.datum == "control":
        return row
    places = {f"{axis}_m": short(x, 3) for axis, x in zip("xyz", one.xyz_m, strict=True)}
    angles = {
        f"{name}_deg": short(degrees(angle), 2)
        for name, angle in zip(("omega", "phi", "kappa"), angles_of(one.rotation), strict=True)
    }
    return row | places | angles


def _control(one):
    """A row of control.csv: with the planned sds, and no coordinate yet."""
    sds = zip("xyz", one.sd_m, strict=True)
    return {"point": one.name} | {f"s{axis}_mm": _mm(sd) for axis, sd in sds if isfinite(sd)}


def _ties(plan, table):
    rows = []
    for one in plan.ties:
        if one.table != table:
            continue
        row = {"from": one.start, "to": one.end, "s_mm": _mm(one.sd_m)}
        if table == "distances":
            row |= {"kind": one.kind, "instrument": one.instrument or ""}
        rows += [row] * one.readings
    return tuple(rows)


def _bases(plan):
    """Rows of stadia.csv, one for each reading."""
    rows = []
    for one in plan.bases:
        row = {"setup": one.setup, "to": one.to, "bar": one.bar}
        row |= {"s_arcsec": short(ARCSEC * degrees(one.angle_sd_rad), 6)}
        rows += [row] * one.readings
    return tuple(rows)


def _sights(prediction):
    """{table: rows} of what is sighted from each set-up, set by set."""
    setups = {one.name: one for one in prediction.plan.setups}
    found = {table: [] for table in SIGHTS}
    for readings in prediction.measurements.readings:
        if readings.table not in SIGHTS:
            continue
        ends = {}
        for name, end in zip(readings.setup, readings.end, strict=True):
            ends.setdefault(name, []).append(end)
        for name, sighted in ends.items():
            sd = _sd(readings.table, setups[name])
            for number in range(1, setups[name].sets + 1):
                numbered = {"set": str(number)} if readings.table == "directions" else {}
                rows = [{"setup": name, "to": end} | sd | numbered for end in sighted]
                found[readings.table] += rows
    return {table: tuple(rows) for table, rows in found.items()}


def _sd(table, setup):
    if table == "slope_distances":
        return {"s_mm": _mm(setup.distance_sd_m)}
    sd = setup.direction_sd_rad if table == "directions" else setup.zenith_sd_rad
    return {"s_arcsec": short(ARCSEC * degrees(sd), 6)}


def as_given(table):
    """The rows of a Table, {column: text} each."""
    return tuple(
        {name: text(cell) for name, cell in zip(table.headings, row, strict=True)}
        for row in table.rows
    )


def entries(register, found):
    """{name: {key: text}} with the spelling of keys that a starter job has."""
    usual = {short: name for name, short in SHORT_KEYS[register].items()}
    return {
        name: {usual.get(key, key): text(one.raw) for key, one in given.items()}
        for name, given in found.entries.items()
    }


def text(raw):
    """A value of TOML or CSV as a text that means the same in a job."""
    if raw is None:
        return ""
    if isinstance(raw, bool):
        return "true" if raw else "false"
    if isinstance(raw, list):
        pairs = ["-".join(map(str, one)) if isinstance(one, list) else str(one) for one in raw]
        return "; ".join(pairs)
    return str(raw)


def _mm(metres):
    return short(1000 * metres, 6)


def short(value, decimals):
    """A number without zeros at its end."""
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text
