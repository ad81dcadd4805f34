"""Checks of instruments.toml and setups.csv, and of references to them."""

import numpy as np

from tankcal.job.checking import has_rows, refuse_repeated, temperature_missing
from tankcal.job.checks.survey.files import refuse_undefined
from tankcal.messages import message

DOUBTFUL_CORRECTION = 5e-4  # largest plausible scale correction
TAKEN_FROM_SETUPS = ("slope_distances", "directions", "zenith_angles")


def check_instruments(files):
    """Check instruments, unique set-ups, and references to them."""
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
    """Warn about an implausible scale correction, such as a percentage or millimetres."""
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
    """Warn about missing and ineffective temperatures of tape readings."""
    temperature = distances.numbers("temperature_c")
    expands = np.array(
        [
            bool((instruments.get(name) or {}).get("expansion_per_k"))
            for name in distances.of("instrument")
        ],
        dtype=bool,
    )
    is_missing = expands & np.isnan(temperature)
    is_ineffective = ~expands & ~np.isnan(temperature) & files.sound(distances)
    for is_reported, expected in (
        (
            is_missing,
            message(
                "tape_without_temperature",
                "blank in {rows} rows of a tape with expansion_per_k; they are not corrected",
                rows=int(is_missing.sum()),
            ),
        ),
        (
            is_ineffective,
            message(
                "temperature_idle",
                "without effect in {rows} rows: the instrument has no expansion_per_k",
                rows=int(is_ineffective.sum()),
            ),
        ),
    ):
        if is_reported.any():
            row = distances.rows[int(np.argmax(is_reported))]
            files.log.warning(distances.file, expected, row, "temperature_c")
