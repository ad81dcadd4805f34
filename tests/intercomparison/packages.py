"""A package without surveys that take time, its truth, and answers to it."""

import json
from functools import cache

from tankcal.products.intercomparison.answers import answer_files, make_forms
from tankcal.products.intercomparison.package import make_package, write_files
from tankcal.record.intercomparison import Answer, AnswersFile, Participant

METHODS = ("points", "total-station")
SECRET, NONCE = "5e" * 32, "ab" * 32


@cache
def made_package(seed=1):
    """A sealed package of two tanks by two methods; the same each time."""
    return make_package(2, seed, METHODS, secret=SECRET, nonce=NONCE)


def written_package(folder):
    """(folder of the package, path of the truth, manifest, truth)."""
    made = made_package()
    write_files(folder / "package", made.files)
    write_files(folder / "sealed", {"truth.json": made.truth})
    manifest = json.loads(made.files["manifest.json"])
    return folder / "package", folder / "sealed" / "truth.json", manifest, json.loads(made.truth)


def answers_of(manifest, truth, *, factor=1.0, U_part=5e-4, k=2.0, methods=METHODS):
    """An AnswersFile whose volumes are the true ones times a factor, U that part of them."""
    answers = []
    for one in truth["tanks"]:
        volumes = [factor * volume for volume in one["volume_m3"]]
        U = [None if U_part is None else U_part * volume for volume in one["volume_m3"]]
        factors = [None if U_part is None else k] * len(volumes)
        answers += [Answer(one["tank"], m, one["heights_m"], volumes, U, factors) for m in methods]
    who = Participant("Lab", "hand", "1.0", "2026-05-05", None, None, manifest["truth_sha256"])
    return AnswersFile(who, answers)


def write_answers(folder, saved):
    """A folder of answers."""
    write_files(folder, answer_files(saved))
    return folder


def write_template(folder, manifest):
    """A folder of empty forms."""
    write_files(folder, make_forms(manifest))
    return folder
