"""What `tankcal verify` makes again: the papers of a folder, byte for byte, and its numbers."""

import re
import tempfile
from pathlib import Path

from tankcal.errors import InputError, TankcalError
from tankcal.job.tables import COVARIANCE_FILE
from tankcal.messages import message
from tankcal.record import long_tables
from tankcal.record import manifest as manifests
from tankcal.report import LETTERHEAD
from tankcal.report.paper_content import content_of_paper
from tankcal.text.languages import LANGUAGES

MOST_TOLD = 10  # numbers, or texts, that came out otherwise


def letterhead_of(folder):
    """The Letterhead that a folder of results keeps; None where it keeps none.

    Raises InputError for a file that is none.
    """
    from tankcal.report.letterhead import PLACE, Letterhead, Logo, read_saved

    path = Path(folder) / LETTERHEAD
    if not path.is_file():
        return None
    data = read_saved(path)
    logo, mark = (one if one in (None, PLACE) else Logo(**one)
                  for one in (data["logo"], data["mark"]))  # fmt: skip
    return Letterhead(data["name"], tuple(data["address"]), logo, data["colours"], mark)


def make_papers_again(found, folder, manifest, rebuild, versions=None):
    """Tell `found` of each file that its saved file does not give again.

    Parameters
    ----------
    found : Verification
    folder : path
    manifest : Manifest or None
    rebuild : callable
        rebuild(folder to write, language, letterhead), from the saved file in `folder`.
    versions : dict, optional
        {"tankcal", "python", "numpy", "scipy": version} that computed the saved file.

    Where the same programs and packages made the papers, every byte is compared. SHA256SUMS says
    so, and nobody signs it: what it calls the work of other versions is compared by its words and
    numbers, and where it contradicts the saved file it is refused.
    """
    made_by = manifest.made_by if manifest else ""
    _refuse_contradiction(found, made_by, versions)
    is_same = made_by == manifests.maker()
    with tempfile.TemporaryDirectory(prefix="tankcal-") as place:
        again = Path(place) / "again"
        language = manifest.language if manifest else language_of_page(folder)
        try:
            rebuild(again, language, letterhead_of(folder))
        except InputError as error:
            found.problems += error.problems
            return
        except TankcalError as error:
            found.tell(
                manifests.FILE,
                message(
                    "verify_papers_refused",
                    "the papers cannot be made again: {why}",
                    why="; ".join(map(str, error.texts)),
                ),
            )
            return
        found.papers_again = True
        if not is_same:
            _note_other_maker(found, made_by)
        names = sorted({*manifests.files_below(folder), *manifests.files_below(again)})
        for name in names:
            if name in (COVARIANCE_FILE, long_tables.FILE, found.saved_file):
                continue  # copied: neither is made of the other
            if not (again / name).is_file() or not (Path(folder) / name).is_file():
                continue  # the manifest tells of what is missing or extra
            found.add_compared(name)
            found.made_again.add(name)
            if found.is_told(name) or _same(again / name, Path(folder) / name):
                continue
            if is_same:
                found.tell(
                    name,
                    message(
                        "verify_other_paper",
                        "is not what {file} gives; expected every byte as tankcal makes it again",
                        file=found.saved_file,
                    ),
                )
            else:
                _compare_content(found, name, Path(folder) / name, again / name, made_by)


def language_of_page(folder):
    """The language that the web page of a folder of results says it is in; None: it has none."""
    path = Path(folder) / "report.html"
    text = path.read_bytes()[:1000].decode("utf-8", "replace") if path.is_file() else ""
    said = re.search(r'<html lang="([\w-]+)"', text)
    return said[1] if said and said[1] in LANGUAGES else None


def _refuse_contradiction(found, made_by, versions):
    """Papers are not older than the record that they were made of."""
    said = versions_in(made_by).get("tankcal")
    if versions and said and _order(said) < _order(versions["tankcal"]):
        found.tell(
            manifests.FILE,
            message(
                "verify_older_papers",
                "names tankcal {said} as what made the papers; {file} is of tankcal {version}, "
                "and papers cannot be older than it",
                said=said,
                version=versions["tankcal"],
                file=found.saved_file,
            ),
        )


def _order(version):
    """Numbers of a version, in their order: those of a release alone."""
    return tuple(map(int, re.findall(r"\d+", version.partition("+")[0].partition(".dev")[0])))


def versions_in(made_by):
    """{name: version} of the line that says what made the files."""
    parts = (part.split(" ", 1) for part in made_by.split(", ") if " " in part)
    return {name: version for name, version in parts}


def _note_other_maker(found, made_by):
    if not made_by:
        found.note(
            message(
                "verify_maker_unknown",
                "no SHA256SUMS says what made the papers: their words and numbers were compared, "
                "their pictures not",
            )
        )
        return
    found.note(
        message(
            "verify_other_maker",
            "the papers were made by other versions ({made_by}; here {here}): their words and "
            "numbers were compared, their pictures not",
            made_by=only_in(made_by, manifests.maker()),
            here=only_in(manifests.maker(), made_by),
        )
    )


def _compare_content(found, name, path, again, made_by):
    """Hold the words and numbers of a paper against those of the same made again."""
    here = versions_in(manifests.maker())
    there = versions_in(made_by)
    same_version = there.get("tankcal", here["tankcal"]) == here["tankcal"]
    ignored = {*here.values(), *there.values()} - {"-"}
    try:
        was, now = (content_of_paper(name, one.read_bytes(), ignored) for one in (path, again))
    except ValueError:
        found.tell(name, message("verify_unreadable", "cannot be read; expected a file of tankcal"))
        return
    apart = was.missing_in(now, same_version=same_version)
    if not apart and same_version:
        apart = now.missing_in(was, same_version=True)
    if apart:
        found.tell(
            name,
            message(
                "verify_other_words",
                "differs from what tankcal {version} makes of {file}, in {count} words or numbers; "
                "the first: {first!r}",
                version=here["tankcal"],
                file=found.saved_file,
                count=len(apart),
                first=apart[0][:40],
            ),
        )
    elif not same_version:
        found.by_numbers.append(name)


def only_in(one, other):
    """Of two lists in a line, what only the first one has; "nothing said" for an empty one."""
    others = other.split(", ")
    return ", ".join(part for part in one.split(", ") if part not in others) or "-"


def _same(one, other):
    return one.stat().st_size == other.stat().st_size and one.read_bytes() == other.read_bytes()


def compute_numbers_again(found, record, job, *, folder=None, step=None, part=None):
    """Compute the job of a record again and tell `found` of what does not come out again.

    Parameters
    ----------
    found : Verification
    record : dict
    job : path
        Folder of the input files, which are those of the record.
    folder : path, optional
        Of the results.
    step, part : callable, optional
        Progress, as of `compute_again`.
    """
    from tankcal.record.recomputation import compute_again

    try:
        again, adjustment = compute_again(record, job, step, part)
    except TankcalError as error:
        found.tell(
            found.saved_file,
            message(
                "verify_not_computed",
                "its job cannot be computed again by this version: {why}",
                why="; ".join(map(str, error.texts)),
            ),
        )
        return
    found.recomputed = again
    for one in again.beyond[:MOST_TOLD]:
        found.tell(
            found.saved_file,
            message(
                "verify_number_apart",
                "{place} is {recorded}, computed again {computed}: {relative} of the largest "
                "number there, expected at most {tolerance}",
                place=one.place,
                recorded=f"{one.recorded:.10g}",
                computed=f"{one.computed:.10g}",
                relative=f"{one.relative:.1e}",
                tolerance=f"{one.tolerance:.0e}",
            ),
        )
    for place, recorded, computed in again.otherwise[:MOST_TOLD]:
        found.tell(
            found.saved_file,
            message(
                "verify_text_apart",
                "{place} is {recorded!r}, computed again {computed!r}; expected the same",
                place=place,
                recorded=recorded[:100],
                computed=computed[:100],
            ),
        )
    more = len(again.beyond[MOST_TOLD:]) + len(again.otherwise[MOST_TOLD:])
    if more:
        found.tell(
            found.saved_file,
            message("verify_more_apart", "{count} further keys came out otherwise", count=more),
        )
    if folder is not None:
        _compare_covariance(found, Path(folder) / COVARIANCE_FILE, adjustment)


def _compare_covariance(found, path, adjustment):
    """Hold the covariance that no record keeps (points_cov.npz) against that computed again."""
    if adjustment is None or not path.is_file() or found.is_told(path.name):
        return
    import numpy as np

    from tankcal.record.recomputation import TOLERANCE
    from tankcal.report.outputs.tables import write_covariance

    with tempfile.TemporaryDirectory(prefix="tankcal-") as place:
        write_covariance(adjustment, Path(place))
        again = Path(place) / path.name
        if not again.is_file():
            return
        found.add_compared(path.name)
        found.made_again.add(path.name)
        if _same(again, path):
            return
        try:
            with np.load(path, allow_pickle=False) as one, np.load(again) as other:
                was, now = one["covariance_m2"], other["covariance_m2"]
                same = was.shape == now.shape and list(one["points"]) == list(other["points"])
                largest = float(np.abs(was).max(initial=0.0))
                same = same and float(np.abs(was - now).max(initial=0.0)) <= TOLERANCE * largest
        except Exception:  # of a broken archive numpy raises whatever came of it
            same = False
    if not same:
        found.tell(
            path.name,
            message(
                "verify_covariance_apart",
                "does not hold the covariance that comes out when the survey is adjusted again",
            ),
        )


def saved_folder(found, folder, again, manifest):
    """Verify a folder whose saved file is no record; gives whether it is one.

    Comparison, inspection and history are made again from their file; of a plan, the results of
    the camera, and any other folder with SHA256SUMS the hashes are compared.
    """
    from tankcal.record.camera_versions import CAMERA
    from tankcal.record.plan import PLAN
    from tankcal.report.saved_rooms import room_of

    room, path = room_of(folder)
    if room is not None:
        room.load(path)
        _take(found, path)
        if again is not None:
            make_papers_again(found, folder, manifest, _rebuild_of(room, path, again[0]))
        found.note(_not_computed(path.name))
        return True
    for name in (CAMERA.file, PLAN.file):
        path = Path(folder) / name
        if path.is_file():
            _take(found, path)
            found.note(_not_computed(name))
            return True
    if manifest is not None:
        found.saved_file = manifests.FILE
        found.note(
            message("verify_no_saved_file", "nothing here but hashes: no file says what is inside")
        )
    return manifest is not None


def _rebuild_of(room, path, step):
    def rebuild(place, language, letterhead):
        room.rebuild(path, place, language, step, letterhead)

    return rebuild


def _take(found, path):
    """The saved file that all else of a folder was made from."""
    found.saved_file = path.name
    found.digest = manifests.digest_of(path)
    found.compared.append(path.name)


def _not_computed(name):
    return message(
        "verify_not_from_inputs",
        "{file} does not say where what it was computed from lies: its numbers were not computed "
        "again",
        file=name,
    )
