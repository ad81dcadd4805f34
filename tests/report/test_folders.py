"""Results survive whatever ends a command, at every call of the file system.

An audit hook sees each call that opens, makes, renames or removes something. In a process of its
own, one call after the other is made to fail, to be interrupted, or to be the last one before
`kill -9`; then the folder must hold the earlier results, or the new ones, whole.
"""

import errno
import os
import sys
from contextlib import suppress

import pytest
from draws import draws

from tankcal.record import manifest
from tankcal.report import folders
from tankcal.report.folders import MADE, PREFIX, recover, replace_folder

EVENTS = ("open", "os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.listdir", "os.scandir",
          "os.chmod", "shutil.rmtree", "tankcal.exchange")  # fmt: skip
EARLIER = {"record.json": "earlier", "certificate.pdf": "earlier paper", "design/plan.json": "old"}
NEW = {"record.json": "new", "capacity.csv": "new table", "design/plan.json": "new"}
MINE = {"letter.txt": "mine", "design/sketch.txt": "mine, too", ".notes": "hidden"}


def write(folder, files):
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def held(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_text()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != manifest.FILE
    }


def replace(results, files, meanwhile=None):
    with replace_folder(results) as folder:
        write(folder, files)
        write(results, {} if meanwhile is None else meanwhile)


def none_left(place):
    return not list(place.glob(f"{PREFIX}*"))


def recover_later(place):
    """What the next command does after more than a minute."""
    for left in place.glob(f"{PREFIX}*"):
        os.utime(left, (0, 0))
    recover(place)


class _Full(dict):
    """Files that no disk has room for."""

    def items(self):
        raise OSError("disk full")


@pytest.fixture
def results(tmp_path):
    folder = tmp_path / "results"
    replace(folder, EARLIER)
    return folder


@pytest.fixture(params=["exchange", "two renamings"])
def way(request, monkeypatch):
    """How two folders change places: systems without an exchange rename twice."""
    if request.param == "exchange" and folders._call_of_exchange() is None:
        pytest.skip("this system has no exchange of two folders")
    if request.param == "two renamings":
        monkeypatch.setattr(folders, "_exchange", lambda one, other: False)
    return request.param


def test_new_results_take_the_place_of_the_earlier(results, way):
    replace(results, NEW)
    assert held(results) == NEW
    assert set(manifest.read_manifest(results).digests) == set(NEW)
    assert none_left(results.parent)


def test_an_error_leaves_the_earlier_results(results, way):
    with pytest.raises(OSError, match="full"):
        replace(results, NEW, _Full())
    assert held(results) == EARLIER
    assert none_left(results.parent)


def test_files_of_others_are_kept(results, way):
    """Put there while the command ran, at the top and below."""
    replace(results, NEW, MINE)
    assert held(results) == NEW | MINE
    assert none_left(results.parent)


def test_a_name_that_is_taken_is_changed(results, way):
    with replace_folder(results) as folder:
        write(folder, {**NEW, ".notes": "of the new results"})
        write(results, {".notes": "mine"})
    assert held(results) == {**NEW, ".notes": "of the new results", ".notes (2)": "mine"}


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.EINVAL])
def test_a_file_system_without_exchange(results, monkeypatch, number):
    def refuse(*_):
        folders.ctypes.set_errno(number)
        return -1

    monkeypatch.setattr(folders, "_call_of_exchange", lambda: refuse)
    replace(results, NEW)
    assert held(results) == NEW


def test_another_failure_of_the_exchange_is_told(results, monkeypatch):
    def refuse(*_):
        folders.ctypes.set_errno(errno.EACCES)
        return -1

    monkeypatch.setattr(folders, "_call_of_exchange", lambda: refuse)
    with pytest.raises(PermissionError):
        replace(results, NEW)
    assert held(results) == EARLIER
    assert none_left(results.parent)


def test_a_folder_that_is_being_written_is_left_alone(tmp_path):
    with replace_folder(tmp_path / "one") as folder:
        write(folder, NEW)
        replace(tmp_path / "two", NEW)
        assert held(folder) == NEW
    assert held(tmp_path / "one") == held(tmp_path / "two") == NEW


def test_a_folder_just_made_is_left_alone(tmp_path):
    """Its process is about to lock it."""
    (tmp_path / f"{PREFIX}abc" / MADE).mkdir(parents=True)
    recover(tmp_path)
    assert not none_left(tmp_path)
    recover_later(tmp_path)
    assert none_left(tmp_path)


# ---- faults at every call


def fault(kind, number, results, files, meanwhile):
    """Exit status of a process that replaces results, and whose call of that number fails."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with suppress(BaseException):
        count = 0

        def hook(event, _):
            nonlocal count
            if event not in EVENTS:
                return
            count += 1
            if count == number:
                if kind == "kill":
                    os._exit(9)
                raise KeyboardInterrupt if kind == "interrupt" else OSError(errno.EIO, "fault")

        with replace_folder(results) as folder:
            write(folder, files)
            write(results, meanwhile)
            sys.addaudithook(hook)
        os._exit(0 if count < number else 1)
    os._exit(1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["kill", "interrupt", "error"])
def test_faults_at_every_call(tmp_path, way, kind):
    """Whatever call is the last one, or fails, results are whole and no file of others is lost."""
    seen = set()
    for number in range(1, 500, draws(2, 1)):
        place = tmp_path / str(number)
        results = place / "results"
        replace(results, EARLIER)
        status = fault(kind, number, results, NEW, MINE)
        if kind != "kill":
            ours = {name: text for name, text in held(results).items() if name not in MINE}
            assert ours in (EARLIER, NEW), f"call {number}"
        recover_later(place)
        found = held(results)
        assert found in (EARLIER | MINE, NEW | MINE), f"call {number}"
        assert none_left(place)
        seen.add(found["record.json"])
        if status == 0:
            break
    assert status == 0
    assert seen == {"earlier", "new"}


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["kill", "interrupt", "error"])
def test_faults_while_nothing_was_there(tmp_path, kind):
    for number in range(1, 200):
        results = tmp_path / str(number) / "results"
        results.parent.mkdir()
        status = fault(kind, number, results, NEW, {})
        recover_later(results.parent)
        assert not results.exists() or held(results) == NEW
        assert none_left(results.parent)
        if status == 0:
            break
    assert status == 0


def test_a_file_is_replaced_as_a_whole_or_not(tmp_path):
    path = tmp_path / "chart.pdf"
    path.write_text("earlier")

    def fill_the_disk():
        with folders.replace_file(path) as temporary:
            temporary.write_text("half")
            raise OSError(errno.ENOSPC, "No space left", str(temporary))

    with pytest.raises(OSError, match=r"chart\.pdf'$"):
        fill_the_disk()
    assert [file.name for file in tmp_path.iterdir()] == ["chart.pdf"]
    assert path.read_text() == "earlier"
    with folders.replace_file(path) as temporary:
        temporary.write_text("new")
    assert [file.read_text() for file in tmp_path.iterdir()] == ["new"]
