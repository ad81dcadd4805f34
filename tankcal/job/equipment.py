"""Measuring equipment of a survey, from the register of the laboratory (equipment.toml).

The register is a file beside the job, or a file that several jobs share, named by
survey.equipment_register. The certificate states the equipment used with its calibration. No value
of the register enters a calculation.
"""

from dataclasses import replace
from pathlib import Path

from tankcal.job.fields import is_blank
from tankcal.job.folder import MAX_SETTINGS_BYTES
from tankcal.job.folder import read_register as parse_register
from tankcal.job.model.settings import Equipment
from tankcal.job.tables import fingerprint, nearest, read_beside
from tankcal.messages import message

EQUIPMENT, ENDING = "equipment", ".toml"
REGISTER_KEY = f"{EQUIPMENT}_register"


def add_shared_register(raw, log):
    """Return the RawJob with the register that `survey.equipment_register` names, if any."""
    key = (raw.settings or {}).get("survey", {}).get(REGISTER_KEY)
    if key is None or is_blank(key.raw):
        return raw
    place, name = (raw.settings_file, key.row, f"survey.{REGISTER_KEY}"), str(key.raw)
    if EQUIPMENT in raw.registers:
        expected = message(
            "two_equipment_registers",
            "found {name} and {local}; expected one register of equipment",
            name=name,
            local=raw.file_of(EQUIPMENT),
        )
        log.problem(place[0], expected, *place[1:])
        return raw
    # A job may come from somebody else: only TOML files at a relative place are read.
    if (
        not name.lower().endswith(ENDING)
        or Path(name).is_absolute()
        or not (raw.folder / name).is_file()
    ):
        expected = message(
            "no_equipment_register",
            "found {name}; expected a TOML file at a place relative to the job, such as "
            "../equipment.toml",
            name=name,
        )
        log.problem(place[0], expected, *place[1:])
        return raw
    name = Path(name).as_posix()  # `tankcal verify` finds the file by this place
    data, register, files = read_beside(raw.folder, name, log, MAX_SETTINGS_BYTES), None, raw.files
    if data is not None:
        register = parse_register(name, data, log, EQUIPMENT)
        files = (*files, fingerprint(name, data))
    return replace(raw, registers=raw.registers | {EQUIPMENT: register}, files=files)


def equipment_used(survey, entries, raw, log):
    """Return the `Equipment` of a survey; warn of calibrations that do not cover its date.

    Parameters
    ----------
    survey : dict
        Values of [survey].
    entries : dict
        {name: {key: value}} of the register.
    raw : RawJob
    log : Log

    Returns
    -------
    tuple of Equipment
        Those of `equipment_used`, otherwise all of the register.
    """
    register = raw.registers.get(EQUIPMENT)
    if register is None and survey[REGISTER_KEY]:  # it could not be read: reported already
        return ()
    names = survey["equipment_used"] or tuple(entries)
    unknown = [name for name in names if name not in entries]
    for name in unknown:
        expected = message(
            "unknown_equipment",
            "found {name!r}; expected a name of the register of equipment{hint}",
            name=name,
            hint=nearest(name, entries),
        )
        row = raw.settings["survey"]["equipment_used"].row
        log.problem(raw.settings_file, expected, row, "survey.equipment_used")
    used = tuple(
        Equipment(name, **{key: str(value or "") for key, value in entries[name].items()})
        for name in names
        if name not in unknown
    )
    for item in used:
        _check_dates(item, survey["date"], register, log)
    return used


def _check_dates(item, survey_date, register, log):
    """Warn of a calibration that was due before the survey, or made after it."""
    day = str(survey_date or "")
    if not day:
        return
    entry = register.entries[item.name]
    if item.due and item.due < day:
        text = message(
            "equipment_overdue",
            "its calibration was due on {due}, before the survey of {day}",
            due=item.due,
            day=day,
        )
        log.warning(register.file, text, entry["due"].row, f"{item.name}.due")
    if item.date and item.date > day:
        text = message(
            "equipment_calibrated_later",
            "calibrated on {date}, after the survey of {day}",
            date=item.date,
            day=day,
        )
        log.warning(register.file, text, entry["date"].row, f"{item.name}.date")
