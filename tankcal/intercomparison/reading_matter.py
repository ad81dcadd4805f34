"""Documentation in a package: README, and the list of keys and columns."""

from tankcal.intercomparison.observers.cloud import LAS_STEP_M
from tankcal.job.contract import COLUMNS, KEYS, REGISTER_KEYS
from tankcal.text.shipped import shipped_folder
from tankcal.version import find_version

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


def readme_text(is_open):
    """Text of README.md of a package."""
    text = (shipped_folder("report_templates") / "intercomparison" / "readme.md").read_text(
        encoding="utf-8"
    )
    state = OPEN if is_open else SEALED
    return text.replace("{state}", state).replace("{version}", find_version())


def columns_text(used):
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
