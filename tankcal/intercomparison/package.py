"""A package of surveys whose truth is sealed: made, and read again.

The truth is a file of its own, truth.json. Its SHA-256 stands in the manifest of the package, so
that anybody can see later that it was not changed (a commitment): `sha256sum truth.json` is all
that it takes. A nonce of 256 bits within keeps the hash from being found by trying. The generator
is public, so a seed alone would be no secret either: of a sealed package the draws hang on 256
random bits more, which stand in the truth alone.
"""

import hashlib
import json
import secrets
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tankcal.intercomparison.drawing import FAMILIES, draw_tank
from tankcal.intercomparison.observers import METHODS
from tankcal.intercomparison.site import Chance, ask
from tankcal.intercomparison.writing import job_files
from tankcal.messages import message
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
    plain_of,
    version,
)

LICENCE = "CC0-1.0"
COVERAGE = 0.95
DENSITIES_KG_M3 = (0.0, 850.0)  # of the head: tanks take turns
SCHEMA = "answers.schema.json"


@dataclass(frozen=True)
class Made:
    """A package and its truth, as {path: bytes} and bytes."""

    files: dict
    truth: bytes


def make_package(count, seed, methods, *, secret="", nonce=None, is_open=False, progress=None):
    """Draw tanks, survey each by all methods, and seal their volumes.

    Parameters
    ----------
    count : int
        Tanks.
    seed : int
        Of the draws.
    methods : sequence of str
        Of `observers.METHODS`.
    secret : str
        Hexadecimal digits that the draws hang on, too; "": on the seed alone, which anybody can
        try.
    nonce : str, optional
        Hexadecimal digits; None: by lot.
    is_open : bool
        Whether the truth will lie beside it, for practice.
    progress : callable, optional
        progress(text, done, total).

    Returns
    -------
    Made
        The same for the same seed, secret and nonce.
    """
    progress = progress or (lambda *_: None)
    step = message("ic_making", "drawing tanks and surveying them")
    files, asked, truth, jobs, used = {}, [], [], [], {}
    total = count * len(methods)
    for number in range(count):
        tank, wanted, true = _tank(number, seed, secret)
        asked.append(
            AskedTank(tank.name, list(wanted.dips_m), wanted.reference_temperature_c,
                      wanted.density_kg_m3)
        )  # fmt: skip
        truth.append(true)
        for place, method in enumerate(methods):
            progress(step, number * len(methods) + place, total)
            rng = _stream(seed, secret, number, 1 + list(METHODS).index(method))
            parts = METHODS[method](tank, Chance(rng), wanted)
            _note_names(parts, used)
            folder = f"{tank.name}/{method}"
            jobs.append(AskedJob(tank.name, method, folder))
            files |= {f"{folder}/{name}": data for name, data in job_files(parts).items()}
    progress(step, total, total)
    nonce = secrets.token_hex(32) if nonce is None else nonce
    sealed = TruthFile(version(), nonce, secret, seed, list(methods), truth)
    truth_bytes = as_bytes(plain_of(sealed))
    files |= _beside(used, is_open)
    manifest = PackageFile(
        tankcal=version(),
        open=is_open,
        licence=LICENCE,
        coverage_probability=COVERAGE,
        truth_sha256=digest(truth_bytes),
        tanks=asked,
        jobs=jobs,
        files=[FileHash(name, digest(files[name])) for name in sorted(files)],
    )
    files[PACKAGE.file] = as_bytes(plain_of(manifest))
    return Made(files, truth_bytes)


def _tank(number, seed, secret):
    """Tank, what is asked of it, and its assigned values."""
    family = FAMILIES[number % len(FAMILIES)]
    name = f"T{number + 1:02d}"
    tank = draw_tank(_stream(seed, secret, number, 0), name, family)
    wanted = ask(tank, DENSITIES_KG_M3[number % len(DENSITIES_KG_M3)])
    volumes = tank.volumes_m3(wanted.dips_m, wanted.density_kg_m3)
    error = tank.volume_error_m3(wanted.dips_m, wanted.density_kg_m3)
    true = TrueTank(name, family, list(wanted.dips_m), volumes.tolist(), error, tank.plain())
    return tank, wanted, true


def _stream(seed, secret, *places):
    """A generator of its own for each tank and method, so that a choice of methods changes none."""
    text = f"tankcal intercomparison {seed} {secret} {' '.join(map(str, places))}"
    return np.random.default_rng(list(hashlib.sha256(text.encode()).digest()))


def _note_names(parts, used):
    """Add keys and columns of a job to {file: names}."""
    for path in parts.settings:
        used.setdefault("job.toml", {})[path] = None
    for name, rows in parts.tables.items():
        used.setdefault(f"{name}.csv", {}).update(dict.fromkeys(rows[0]))
    for name, entries in parts.registers.items():
        for entry in entries.values():
            used.setdefault(f"{name}.toml", {}).update(dict.fromkeys(entry))


def _beside(used, is_open):
    """What is to be read: README, columns, schema of the answers, licence."""
    from tankcal.intercomparison.reading_matter import columns_text, readme_text
    from tankcal.text.shipped import shipped_folder

    texts = {
        "README.md": readme_text(is_open),
        "COLUMNS.md": columns_text(used),
        "LICENSE.txt": (shipped_folder("report_templates") / "intercomparison" / "licence.txt")
        .read_text(encoding="utf-8"),
        SCHEMA: json.dumps(ANSWERS.schema(), ensure_ascii=False, indent=1) + "\n",
    }  # fmt: skip
    return {name: text.encode() for name, text in texts.items()}


def as_bytes(plain):
    """Plain data as the bytes of a file."""
    return (json.dumps(plain, ensure_ascii=False, indent=1, allow_nan=False) + "\n").encode()


def digest(data):
    """SHA-256 of bytes, as hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def write_files(folder, files):
    """Write {path: bytes} into a folder."""
    for name, data in files.items():
        path = Path(folder) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


# ---- read again


def load_package(folder, log):
    """The manifest of a package as plain data, its files as they were; None after telling `log`."""
    path = Path(folder)
    path = path / PACKAGE.file if path.is_dir() else path
    found = load_saved(PACKAGE, path, log)
    if found is None:
        return None
    before = len(log.problems)
    for one in found["files"]:
        data = _bytes(path.parent, one["file"])
        if data is None:
            text = message("ic_file_missing", "is missing; expected it, as the manifest names it")
            log.problem(one["file"], text)
        elif digest(data) != one["sha256"]:
            text = message("ic_file_changed", "is not the file that the manifest names: its "
                           "SHA-256 is another; get the package again")  # fmt: skip
            log.problem(one["file"], text)
    return None if len(log.problems) > before else found


def load_truth(path, committed, log):
    """(truth as plain data, SHA-256 of the file), or None after telling `log`.

    committed  SHA-256 by manifest and answers, each with the name of the file that says so
    """
    path = Path(path)
    path = path / TRUTH.file if path.is_dir() else path
    found = load_saved(TRUTH, path, log)
    if found is None:
        return None
    before, own = len(log.problems), digest(path.read_bytes())
    for name, promised in committed:
        if promised != own:
            text = message(
                "ic_other_truth",
                "names the truth with SHA-256 {promised}; that of {truth} is {own}: it was changed,"
                " or belongs to another package",
                promised=promised, truth=path.name, own=own,
            )  # fmt: skip
            log.problem(name, text)
    for one in found["tanks"]:
        if len(one["heights_m"]) != len(one["volume_m3"]):
            log.problem(path.name, message("ic_truth_uneven", "{tank}: as many volumes as heights "
                        "expected", tank=one["tank"]))  # fmt: skip
    return None if len(log.problems) > before else (found, own)


def load_saved(saved_format, path, log):
    """Data of a saved file, checked; None after telling `log`."""
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


def _bytes(folder, name):
    """A file within a folder; None where there is none, or its path leads out of it."""
    path = (folder / name).resolve()
    if not path.is_relative_to(folder.resolve()) or not path.is_file():
        return None
    return path.read_bytes()
