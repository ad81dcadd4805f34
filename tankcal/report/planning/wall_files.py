"""The files of a plan of the bare wall for programs, and its empty job."""

from tankcal.job.starter import FilledForm, write_form
from tankcal.planning.wall.reading import datum_of, tables_of
from tankcal.record import save
from tankcal.record.plan import plain_of_wall
from tankcal.report.planning.empty_job import AS_GIVEN, MEASURED, as_given, entries, short, text
from tankcal.report.planning.files import write_capacity, write_effects
from tankcal.text.languages import DEFAULT

GIVEN = (*AS_GIVEN, "obstructions", "thickness", "tape_checks")
OF_BATCHES = (
    *("volume_m3", "dip_m", "meter_temperature_c", "tank_temperature_c"),
    "shell_temperature_c",
)
READ = (  # left blank
    *("reading_m", "offset_mm", "direction_deg", "zenith_deg", "distance_m", "angle_deg", "time"),
)


def write_wall(paper, folder, fingerprints):
    """Write plan.json and the CSV files; fingerprints: [{file, sha256}] of the empty job."""
    found = plain_of_wall(paper.prediction, paper.simulated, fingerprints)
    save(found, folder / "plan.json")
    write_capacity(found, folder)
    write_effects(paper, folder)


def write_empty_job(prediction, directory, workbook=False):
    """Write the empty job of a WallPrediction into a new folder, as text files or as job.xlsx."""
    write_form(directory, form_of_wall(prediction.plan), workbook)


def form_of_wall(plan):
    """The FilledForm of a WallPlan: a row for each reading, without its value."""
    raw, design = plan.given, plan.design
    settings = {
        f"{section}.{key}": text(one.raw)
        for section, given in raw.settings.items()
        for key, one in given.items()
    }
    datum = datum_of(design)
    if datum is not None:
        settings.setdefault("adjustment.datum", datum)
    foreseen = {name: _without_values(table) for name, table in tables_of(plan).items()}
    if design.runs:
        foreseen["liquid"] = _runs(plan)
    return FilledForm(
        kind=plan.job.tank.kind,
        survey=_survey_of(design),
        language=plan.job.table.language or DEFAULT,
        settings={key: one for key, one in settings.items() if key not in MEASURED},
        given={name: as_given(raw.tables[name]) for name in GIVEN if name in raw.tables} | foreseen,
        registered={name: entries(name, found) for name, found in raw.registers.items()},
        to_fill=tuple(key for key in settings if key in MEASURED),
        more=tuple(foreseen),
    )


def _survey_of(design):
    """The kind of survey whose form a `Design` has."""
    if design.is_metered_alone:
        return "liquid"
    if design.hits or design.tangents is not None:
        return "wall-hits" if design.hits else "tangents"
    return "strapping" if design.lines is None else "reference-line"


def _runs(plan):
    """Rows of liquid.csv without what will be read; the dip that is planned stands as a note.

    The start of a run from a dip has no volume either: without its dip, it would be the dry tank.
    """
    rows = []
    for row in as_given(tables_of(plan)["liquid"]):
        dip = row.get("dip_m", "")
        kept = {name: _tidy(cell) for name, cell in row.items() if name not in OF_BATCHES}
        volume = {} if dip else {"volume_m3": "0"}
        rows.append(kept | volume | {"note": f"{_tidy(dip)} m" if dip else ""})
    return tuple(rows)


def _without_values(table):
    return tuple(
        {
            name: "" if name in READ else _tidy(cell)
            for name, cell in zip(table.headings, row, strict=True)
        }
        for row in table.rows
    )


def _tidy(cell):
    """A number without a zero after its point."""
    try:
        return short(float(cell), 6)
    except ValueError:
        return cell
