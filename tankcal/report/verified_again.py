"""What `tankcal verify` makes again: the papers of a folder, byte for byte, and its numbers."""

import tempfile
from pathlib import Path

from tankcal.errors import InputError, TankcalError
from tankcal.job.tables import COVARIANCE_FILE
from tankcal.messages import message
from tankcal.record import long_tables
from tankcal.report import LETTERHEAD
from tankcal.report import manifest as manifests

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


def make_papers_again(found, folder, manifest, rebuild):
    """Tell `found` of each file that its saved file does not give again, byte for byte.

    Parameters
    ----------
    found : Verification
    folder : path
    manifest : Manifest or None
    rebuild : callable
        rebuild(folder to write, language, letterhead), from the saved file in `folder`.

    Papers are compared where the manifest says that the same programs and packages made them, or
    where there is none: then a file is only taken as made again when it is the same.
    """
    if manifest is None:
        found.note(
            message(
                "verify_papers_not_again",
                "no SHA256SUMS says what made the papers: they were not made again",
            )
        )
        return
    if manifest.made_by != manifests.maker():
        found.note(
            message(
                "verify_other_maker",
                "the papers were made by other versions ({made_by}; here {here}): held against "
                "SHA256SUMS only",
                made_by=only_in(manifest.made_by, manifests.maker()),
                here=only_in(manifests.maker(), manifest.made_by),
            )
        )
        return
    with tempfile.TemporaryDirectory(prefix="tankcal-") as place:
        again = Path(place) / "again"
        try:
            rebuild(again, manifest.language, letterhead_of(folder))
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
        names = sorted({*manifests.files_below(folder), *manifests.files_below(again)})
        for name in names:
            if name in (COVARIANCE_FILE, long_tables.FILE, found.saved_file):
                continue  # copied: neither is made of the other
            if not (again / name).is_file() or not (Path(folder) / name).is_file():
                continue  # the manifest tells of what is missing or extra
            found.add_compared(name)
            if not found.is_told(name) and not _same(again / name, Path(folder) / name):
                found.tell(
                    name,
                    message(
                        "verify_other_paper",
                        "is not what {file} gives; expected every byte as tankcal makes it again",
                        file=found.saved_file,
                    ),
                )


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
