"""Every command that reads files, called with spoilt files and with files written another way.

1. Spoilt files: the command ends with a documented exit status within 20 s of processor time,
   explains itself in plain lines, and leaves earlier results as they were; with status 0 no volume
   falls with height and no number is missing.
2. Neutral changes (byte order mark, line ends, separators, encodings, quotation marks, comments):
   exit status and numbers are those of the unchanged input.

`new`, `demo`, `docs`, `completion` and `intercomparison make` read no data files of a user;
`notebook` and `app` start a server.
"""

import os
from dataclasses import replace
from zlib import crc32

import numpy as np
import pytest
from called_commands import (
    DEAR,
    call,
    call_valid,
    list_accepted_falls,
    list_faults,
    make_bases,
    numbers_of,
)
from draws import draws
from fuzzing import NEUTRAL, add_odd_file, spoilt_folder

pytestmark = pytest.mark.slow

ODD_PLACES = (
    "in place", "é ü", "a'b", "$(x)", "日本", "\u202eb", "[x]", "a;b", "%s{x}", "#1", "~", "\udcff",
    "a\nb", "\x1b[2J", "results",
)  # fmt: skip


@pytest.fixture(scope="module")
def quick_bases(tmp_path_factory):
    """{name: Base} without those that take long."""
    return dict(make_bases(tmp_path_factory.mktemp("quick"), leave=DEAR))


@pytest.fixture(scope="module")
def bases(quick_bases, tmp_path_factory):
    """{name: Base} of all."""
    return quick_bases | dict(make_bases(tmp_path_factory.mktemp("bases"), leave=quick_bases))


def spoil(base, name, seed):
    """(files of a base spoilt by a seed, name of the folder that they are in)."""
    rng = np.random.default_rng([crc32(name.encode()), seed])
    files = spoilt_folder(base.files, rng, base.spoilt)
    if rng.random() < 0.04:
        files = add_odd_file(files, rng)
    odd = rng.random() < 0.05
    return files, str(rng.choice(ODD_PLACES)) if odd else "call"


def hunt(bases, seeds_of, folder):
    """[(name, seed, fault, folder of its files)] of the spoilt inputs that seeds_of(name) gives."""
    found = []
    for name, base in bases.items():
        for seed in seeds_of(name):
            files, odd = spoil(base, name, seed)
            place = folder / "calls" / odd
            outcome = call(base, files, place)
            faults = list_faults(base, outcome) + list_accepted_falls(base, files, outcome)
            if faults:
                kept = folder / "faults" / f"{name.replace(' ', '-')}-{seed}"
                kept.parent.mkdir(exist_ok=True)
                place.rename(kept)
                found += [(name, seed, fault, str(kept)) for fault in faults]
    return found


def seeds_from(start, count):
    """Function of a name of a base that gives its seeds, a tenth as many for a slow one."""
    return lambda name: range(start, start + (-(-count // 10) if name in DEAR else count))


def assert_no_faults(found):
    assert not found, "\n".join(
        f"{name}, seed {seed}: {fault}\n  files: {kept}" for name, seed, fault, kept in found
    )


def test_spoilt_files_of_every_command(quick_bases, tmp_path):
    assert_no_faults(hunt(quick_bases, seeds_from(0, 3), tmp_path))


@pytest.mark.study
def test_very_many_spoilt_files_of_every_command(bases, tmp_path):
    """Other inputs in each study: from the seed in TANKCAL_FUZZ_FROM on."""
    start = int(os.environ.get("TANKCAL_FUZZ_FROM", "1000"))
    assert_no_faults(hunt(bases, seeds_from(start, draws(10, 4000)), tmp_path))


BINARY = (".xlsx", ".npz", ".ply", ".off", ".pdf", ".png")
NOT_NEUTRAL = {  # (beginning of a base, kind): why the change is none that a user may make
    ("import csv", "tabs"): "profile.toml declares the separator",
    ("import csv", "tabs and decimal commas"): "profile.toml declares the separator",
}
MARKS = {"tabs", "semicolons"}  # beside these 1.592 alone in a file may be 1592, and is refused
AMBIGUOUS = "expected a decimal mark that is known"


def change_neutrally(base, kind):
    """The files of a base with a neutral change of each text file; None: it applies to none."""
    changed = dict(base.files)
    for name, data in base.files.items():
        if not name.endswith(BINARY) and name not in base.exact:
            new = NEUTRAL[kind](name, data)
            changed[name] = data if new is None else new
    return None if changed == base.files else changed


def compare_neutral(name, base, kinds, place):
    """Lines about neutral changes of a base that change an exit status or a number."""
    found = []
    usual = numbers_of(call_valid(base, place))
    for kind in kinds:
        files = change_neutrally(base, kind)
        if files is None or (name, kind) in NOT_NEUTRAL:
            continue
        outcome = call(replace(base, earlier={}), files, place)
        found += [f"{name}, {kind}: {one}" for one in list_faults(base, outcome)]
        is_refused = MARKS & {*kind.split()} and AMBIGUOUS in outcome.err
        if numbers_of(outcome) != usual and not is_refused:
            found.append(f"{name}, {kind}: other numbers; {outcome.err.strip()[:300]}")
    return found


def kinds_for(name, count):
    """So many kinds of neutral changes, other ones for each base."""
    first = crc32(name.encode())
    return [list(NEUTRAL)[(first + number) % len(NEUTRAL)] for number in range(count)]


def test_neutral_changes_of_every_command(quick_bases, tmp_path):
    found = [
        line
        for name, base in quick_bases.items()
        for line in compare_neutral(name, base, kinds_for(name, 1), tmp_path / "call")
    ]
    assert not found, "\n".join(found)


@pytest.mark.study
def test_every_neutral_change_of_every_command(bases, tmp_path):
    count = draws(2, len(NEUTRAL))
    found = [
        line
        for name, base in bases.items()
        for line in compare_neutral(name, base, kinds_for(name, count), tmp_path / "call")
    ]
    assert not found, "\n".join(found)
