"""instruments.toml, setups.csv, and who uses them."""

import numpy as np

from tankcal.job.checking import has_rows, refuse_repeated, temperature_missing
from tankcal.job.checks.survey.files import refuse_undefined
from tankcal.messages import message

DOUBTFUL_CORRECTION = 5e-4  # no sound instrument is off by more
TAKEN_FROM_SETUPS = ("slope_distances", "directions", "zenith_angles")


def check_instruments(files):
    """Instruments complete and used; set-ups named once, and those that are named defined."""
    for name, given in files.registers["instruments"].items():
        _check_instrument(files, name, given)
    setups, instruments = files.tables["setups"], files.registers["instruments"]
    if setups is not None:
        refuse_repeated(setups, "setup", files.log)
        refuse_undefined(files, setups, "instrument", instruments, "instruments")
    defined = () if setups is None else dict.fromkeys(setups.of("setup"))
    for table in TAKEN_FROM_SETUPS:
        if has_rows(files.tables[table]):
            refuse_undefined(files, files.tables[table], "setup", defined, "setups")
    distances = files.tables["distances"]
    if has_rows(distances):
        refuse_undefined(files, distances, "instrument", instruments, "instruments")
        _check_temperatures(files, distances, instruments)


def check_correction(files, name, given):
    """Warn of a scale that no instrument has: a percentage, or a millimetre for a metre."""
    correction = given["correction"]
    if correction is not None and abs(correction) > DOUBTFUL_CORRECTION:
        expected = message(
            "large_correction",
            "found {correction:g}, {ppm:.0f} ppm; expected a small ratio, such as 0.0001",
            correction=correction,
            ppm=1e6 * correction,
        )
        files.tell_key(files.log.warning, "instruments", name, "correction", expected)


def _check_instrument(files, name, given):
    check_correction(files, name, given)
    if given["expansion_per_k"] and not files.is_given(
        "instruments", name, "certified_temperature_c"
    ):
        key = "certified_temperature_c"
        files.tell_key(files.log.problem, "instruments", name, key, temperature_missing())


def _check_temperatures(files, distances, instruments):
    """Every reading of a tape that expands has a temperature, and no other one."""
    temperature = distances.numbers("temperature_c")
    expands = np.array(
        [
            bool((instruments.get(name) or {}).get("expansion_per_k"))
            for name in distances.of("instrument")
        ],
        dtype=bool,
    )
    without = expands & np.isnan(temperature)
    idle = ~expands & ~np.isnan(temperature) & files.sound(distances)
    for told, expected in (
        (
            without,
            message(
                "tape_without_temperature",
                "blank in {rows} rows of a tape with expansion_per_k; they are not corrected",
                rows=int(without.sum()),
            ),
        ),
        (
            idle,
            message(
                "temperature_idle",
                "without effect in {rows} rows: the instrument has no expansion_per_k",
                rows=int(idle.sum()),
            ),
        ),
    ):
        if told.any():
            row = distances.rows[int(np.argmax(told))]
            files.log.warning(distances.file, expected, row, "temperature_c")
