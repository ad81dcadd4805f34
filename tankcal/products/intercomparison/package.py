"""Packages of simulated surveys with sealed true volumes: write and read.

The true volumes are in a separate file, truth.json. The manifest of the package contains the
SHA-256 of this file (a commitment). With `sha256sum truth.json`, anybody can later verify that the
file was not changed. A nonce of 256 bits in the file prevents a search for the truth by its hash.
The generator is public, so that the seed alone would not be a secret. The draws of a sealed package
therefore also depend on 256 random bits that only the truth contains.
"""

import hashlib
import io
import json
import secrets
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np

from tankcal.job.contract import COLUMNS, KEYS, REGISTER_KEYS
from tankcal.messages import message
from tankcal.products.intercomparison.observers import LAS_STEP_M, METHODS
from tankcal.products.intercomparison.site import Chance, request_table
from tankcal.products.intercomparison.tank import FAMILIES, draw_tank
from tankcal.record.intercomparison import (
    ANSWERS,
    PACKAGE,
    TRUTH,
    AskedJob,
    AskedTank,
    FileHash,
    PackageFile,
    TrueTank,
    TruthFile,
)
from tankcal.record.schema import to_plain
from tankcal.text.delimited import write_guarded
from tankcal.text.shipped import shipped_folder
from tankcal.version import find_version

LICENCE = "CC0-1.0"  # SPDX identifier
COVERAGE = 0.95  # coverage probability of the requested U
DENSITIES_KG_M3 = (0.0, 850.0)  # density of the liquid, alternating between tanks
SCHEMA = "answers.schema.json"  # file name of the JSON schema of answers
SEALED = (
    "The true volumes are **sealed**: nobody but the organiser has them until all answers are in."
)
OPEN = (
    "The true volumes lie beside this package (`truth.json`): it is **for practice**, and for a"
    " look at the formats."
)
HEAD = """# Every key and column

What stands in the files of this package. A name ends with its unit: `_m` metres, `_mm`
millimetres, `_deg` degrees, `_c` degrees Celsius, `_m3` cubic metres, `_ppm` parts per million;
`s_` is a standard deviation, `u_` a standard uncertainty. CSV files have a row of headings, commas
and decimal points. Scans are LAS 1.2, point format 0, metres in steps of {step} m, in the scanner's
own frame: the scanner is at its origin, and it stands a little out of level.
"""


@dataclass(frozen=True)
class Package:
    """Files of a package, {path: bytes}, and the bytes of its truth file."""

    files: dict
    truth: bytes


def make_package(count, seed, methods, *, secret="", nonce=None, is_open=False, progress=None):
    """Draw tanks, simulate surveys by all methods, and seal the true volumes.

    Parameters
    ----------
    count : int
        Number of tanks.
    seed : int
        Seed of the random numbers.
    methods : sequence of str
        Keys of `observers.METHODS`.
    secret : str
        Hexadecimal digits that also determine the random numbers. With "", the seed alone
        determines them, and anybody can repeat the draws.
    nonce : str, optional
        Hexadecimal digits; random by default.
    is_open : bool
        Whether the truth is published with the package, for practice.
    progress : callable, optional
        Function progress(text, done, total).

    Returns
    -------
    Made
        Identical for the same seed, secret and nonce.
    """
    progress = progress or (lambda *_: None)
    step = message("ic_making", "drawing tanks and surveying them")
    files, asked, truth, jobs, used = {}, [], [], [], {}
    total = count * len(methods)
    for number in range(count):
        tank, requested, true = _draw_case(number, seed, secret)
        asked.append(
            AskedTank(tank.name, list(requested.dips_m), requested.reference_temperature_c,
                      requested.density_kg_m3)
        )  # fmt: skip
        truth.append(true)
        for index, method in enumerate(methods):
            progress(step, number * len(methods) + index, total)
            rng = _stream(seed, secret, number, 1 + list(METHODS).index(method))
            parts = METHODS[method](tank, Chance(rng), requested)
            _note_names(parts, used)
            folder = f"{tank.name}/{method}"
            jobs.append(AskedJob(tank.name, method, folder))
            files |= {f"{folder}/{name}": data for name, data in job_files(parts).items()}
    progress(step, total, total)
    nonce = secrets.token_hex(32) if nonce is None else nonce
    sealed = TruthFile(find_version(), nonce, secret, seed, list(methods), truth)
    truth_bytes = json_bytes(to_plain(sealed))
    files |= _documentation(used, is_open)
    manifest = PackageFile(
        tankcal=find_version(),
        open=is_open,
        licence=LICENCE,
        coverage_probability=COVERAGE,
        truth_sha256=digest(truth_bytes),
        tanks=asked,
        jobs=jobs,
        files=[FileHash(name, digest(files[name])) for name in sorted(files)],
    )
    files[PACKAGE.file] = json_bytes(to_plain(manifest))
    return Package(files, truth_bytes)


def _draw_case(number, seed, secret):
    """Tank, the requested heights and conditions, and the assigned values."""
    family = FAMILIES[number % len(FAMILIES)]
    name = f"T{number + 1:02d}"
    tank = draw_tank(_stream(seed, secret, number, 0), name, family)
    requested = request_table(tank, DENSITIES_KG_M3[number % len(DENSITIES_KG_M3)])
    volumes = tank.volumes_m3(requested.dips_m, requested.density_kg_m3)
    error = tank.volume_error_m3(requested.dips_m, requested.density_kg_m3)
    true = TrueTank(name, family, list(requested.dips_m), volumes.tolist(), error, tank.plain())
    return tank, requested, true


def _stream(seed, secret, *places):
    """Random generator of a tank and method, independent of the choice of other methods."""
    text = f"tankcal intercomparison {seed} {secret} {' '.join(map(str, places))}"
    return np.random.default_rng(list(hashlib.sha256(text.encode()).digest()))


def _note_names(parts, used):
    """Add the keys and columns of a job to `used`, {file: names}."""
    for path in parts.settings:
        used.setdefault("job.toml", {})[path] = None
    for name, rows in parts.tables.items():
        used.setdefault(f"{name}.csv", {}).update(dict.fromkeys(rows[0]))
    for name, entries in parts.registers.items():
        for entry in entries.values():
            used.setdefault(f"{name}.toml", {}).update(dict.fromkeys(entry))


def json_bytes(plain):
    """Bytes of a JSON file with plain data."""
    return (json.dumps(plain, ensure_ascii=False, indent=1, allow_nan=False) + "\n").encode()


def digest(data):
    """SHA-256 of bytes in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def write_files(folder, files):
    """Write {path: bytes} into a folder."""
    for name, data in files.items():
        path = Path(folder) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


# ---- documentation in a package


def _documentation(used, is_open):
    """Documentation of a package: README, columns, schema of the answers, licence."""
    folder = shipped_folder("report_templates") / "intercomparison"
    readme = (folder / "readme.md").read_text(encoding="utf-8")
    readme = readme.replace("{state}", OPEN if is_open else SEALED).replace(
        "{version}", find_version()
    )
    texts = {
        "README.md": readme,
        "COLUMNS.md": _columns_text(used),
        "LICENSE.txt": (folder / "licence.txt").read_text(encoding="utf-8"),
        SCHEMA: json.dumps(ANSWERS.schema(), ensure_ascii=False, indent=1) + "\n",
    }
    return {name: text.encode() for name, text in texts.items()}


def _columns_text(used):
    """Text of COLUMNS.md: notes of the job contract on all names that a package uses.

    The names are given as {file: names}.
    """
    parts = [HEAD.format(step=LAS_STEP_M)]
    for file in sorted(used):
        rows = [f"| `{name}` | {_note(file, name)} |" for name in used[file]]
        head = "key" if file.endswith(".toml") else "column"
        parts.append(f"## {file}\n\n| {head} | what it is |\n| --- | --- |\n" + "\n".join(rows))
    return "\n\n".join(parts) + "\n"


def _note(file, name):
    """Note on a key or column in the contract of a job."""
    owner = file.rpartition(".")[0]
    if file == "job.toml":
        section, _, name = name.rpartition(".")
        fields = KEYS[section]
    else:
        fields = COLUMNS.get(owner) or REGISTER_KEYS[owner]
    return next((field.note for field in fields if field.name == name), "")


# ---- files of a job


def job_files(parts):
    """Files of a job's folder, {path: bytes}, from its `Parts`."""
    files = {"job.toml": toml_text(_sections(parts.settings)).encode()}
    for name, rows in parts.tables.items():
        if len(rows) > 1:
            files[f"{name}.csv"] = csv_text(rows).encode()
    for name, entries in parts.registers.items():
        named = {f"{name}.{json.dumps(key)}": entry for key, entry in entries.items()}
        files[f"{name}.toml"] = toml_text(named).encode()
    return files | parts.files


def csv_text(rows):
    """Text of a CSV file with these rows."""
    stream = io.StringIO()
    write_guarded(stream, rows, ",")
    return stream.getvalue()


def toml_text(sections):
    """Text of a TOML file with {section: {key: value}}."""
    parts = []
    for section, entries in sections.items():
        lines = [f"{key} = {_value(value)}" for key, value in entries.items()]
        parts.append("\n".join([f"[{section}]", *lines]) + "\n")
    return "\n".join(parts)


def _sections(settings):
    """Convert {"section.key": value} to {section: {key: value}}."""
    sections = {}
    for path, value in settings.items():
        section, _, key = path.rpartition(".")
        sections.setdefault(section, {})[key] = value
    return sections


def _value(value):
    """Value as TOML; strings, numbers and flags have the form of JSON."""
    if isinstance(value, date):
        return value.isoformat()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value, ensure_ascii=False)


# ---- reading


def load_package(folder, log):
    """Read the manifest of a package as plain data and verify its files.

    Missing and changed files are reported to `log`, and None is returned.
    """
    path = Path(folder)
    path = path / PACKAGE.file if path.is_dir() else path
    manifest = load_saved(PACKAGE, path, log)
    if manifest is None:
        return None
    problem_count = len(log.problems)
    for entry in manifest["files"]:
        data = _bytes_of_file(path.parent, entry["file"])
        if data is None:
            text = message("ic_file_missing", "is missing; expected it, as the manifest names it")
            log.problem(entry["file"], text)
        elif digest(data) != entry["sha256"]:
            text = message("ic_file_changed", "is not the file that the manifest names: its "
                           "SHA-256 is another; get the package again")  # fmt: skip
            log.problem(entry["file"], text)
    return None if len(log.problems) > problem_count else manifest


def load_truth(path, committed, log):
    """Read the truth and verify its SHA-256.

    Parameters
    ----------
    path : path
        The file truth.json, or its folder.
    committed : sequence of (str, str)
        File names of manifest and answers, each with the SHA-256 that the file states.
    log : Log
        Receives the problems.

    Returns
    -------
    tuple of (dict, str) or None
        Truth as plain data and SHA-256 of the file; None if there are problems.
    """
    path = Path(path)
    path = path / TRUTH.file if path.is_dir() else path
    truth_data = load_saved(TRUTH, path, log)
    if truth_data is None:
        return None
    problem_count, truth_sha256 = len(log.problems), digest(path.read_bytes())
    for name, promised in committed:
        if promised != truth_sha256:
            text = message(
                "ic_other_truth",
                "names the truth with SHA-256 {promised}; that of {truth} is {own}: it was changed,"
                " or belongs to another package",
                promised=promised, truth=path.name, own=truth_sha256,
            )  # fmt: skip
            log.problem(name, text)
    for tank in truth_data["tanks"]:
        if len(tank["heights_m"]) != len(tank["volume_m3"]):
            log.problem(path.name, message("ic_truth_uneven", "{tank}: as many volumes as heights "
                        "expected", tank=tank["tank"]))  # fmt: skip
    return None if len(log.problems) > problem_count else (truth_data, truth_sha256)


def load_saved(saved_format, path, log):
    """Read and check the data of a saved file, or report problems to `log` and return None."""
    from tankcal.errors import InputError
    from tankcal.job.tables import read_bytes

    data = read_bytes(path, log)
    if data is None:
        return None
    try:
        return saved_format.migrated(json.loads(data), path.name)
    except InputError as error:
        log.problems.extend(error.problems)
    except (ValueError, RecursionError) as error:
        text = message("ic_no_json", "cannot be read as JSON: {error}", error=str(error))
        log.problem(path.name, text)
    return None


def _bytes_of_file(folder, name):
    """Bytes of a file in a folder; None if it is missing or its path leaves the folder."""
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()) or not path.is_file():
        return None
    return path.read_bytes()
