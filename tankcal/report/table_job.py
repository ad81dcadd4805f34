"""Folder of a job that is derived from a former table."""

import json
import re

import numpy as np

from tankcal.report.folders import refuse_foreign, replace_folder
from tankcal.text.shipped import DEFAULT
from tankcal.text.words import load_words, say

SETTINGS = "job.toml"
COVARIANCE = "radii_cov.npz"
FILES = (
    *(SETTINGS, "courses.csv", "radii.csv", COVARIANCE, "bottom.csv", "deadwood.csv"),
    "uncertainty.csv",
)


def refuse_foreign_job(directory):
    """Raise InputError if `directory` contains files that `write_job` does not write."""
    refuse_foreign(directory, FILES)


def write_job(job, directory, language=DEFAULT):
    """Write the files of a `JobOfTable`, all or none.

    Parameters
    ----------
    job : JobOfTable
        Content of the job.
    directory : str or Path
        Folder of the job.
    language : str, optional
        Code of the language of the papers.

    Returns
    -------
    list of str
        Names of the files.
    """
    has_radii = job.covariance_m2 is not None
    names = [name for name in FILES if name in job.texts or (name == COVARIANCE and has_radii)]
    with replace_folder(directory) as folder:
        words = load_words(language)
        for name, text in job.texts.items():
            text = _translate(text, job.words, words)
            if name == SETTINGS and language != DEFAULT:
                text = text.replace("[table]\n", f'[table]\nlanguage = "{language}"\n', 1)
            (folder / name).write_text(text, encoding="utf-8")
        if has_radii:
            np.savez(
                folder / COVARIANCE,
                covariance_m2=job.covariance_m2,
                courses=np.array(job.courses, dtype=str),
            )
    return names


def _translate(text, messages, words):
    """Translate the messages in the text of a file."""
    for message in messages:
        english, translation = (json.dumps(part, ensure_ascii=False)[1:-1] for part in
                        (str(message), say(words, message)))  # fmt: skip
        pattern = rf"(?<![\w-]){re.escape(english)}(?![\w-])"
        text = re.sub(pattern, lambda _, translation=translation: translation, text)
    return text
