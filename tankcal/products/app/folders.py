"""Folders that a browser sends: their list of files, kept as a zip archive, and their content."""

import fnmatch
import json
import shutil
import zipfile
from pathlib import Path, PurePosixPath

from starlette.exceptions import HTTPException

from tankcal.products.desk.jobs import JOB_FILES, NOT_COPIED, free_folder

MOST_FILES = 2000  # as in app.js
MOST_LIST = 1_000_000  # bytes of the list of files
RECORD, CERTIFICATE = "record.json", "certificate.pdf"


def pack_sent_folder(path):
    """Replace a sent folder by a zip archive.

    The first line is a list of (path, size); the contents of the files follow in its order.

    Raises
    ------
    HTTPException
        400 if the file has another form, 413 for too many files.
    """
    packed = path.with_suffix(".part")
    try:
        with path.open("rb") as file, zipfile.ZipFile(packed, "w") as archive:
            items = json.loads(file.readline(MOST_LIST))
            if len(items) > MOST_FILES:
                raise HTTPException(413)
            for name, size in items:
                content = file.read(size) if size >= 0 else b""
                if len(content) != size:
                    raise ValueError(name)
                archive.writestr(zipfile.ZipInfo(name), content)
        packed.replace(path)
    except (ValueError, TypeError, LookupError, AttributeError) as error:
        raise HTTPException(400) from error
    finally:
        packed.unlink(missing_ok=True)


def list_folder(path, most_bytes):
    """Files of an archive, {path without a common folder: ZipInfo}; {} for any other file.

    Files whose path leads out of the folder are left out.
    """
    if not zipfile.is_zipfile(path):
        return {}
    with zipfile.ZipFile(path) as archive:
        items = [item for item in archive.infolist() if not item.is_dir()]
    if len(items) > MOST_FILES or sum(item.file_size for item in items) > most_bytes:
        return {}
    files = {
        parts: item for item in items
        if (parts := PurePosixPath(item.filename).parts) and not _is_unsafe(item.filename, parts)
    }  # fmt: skip
    tops = {parts[0] for parts in files}
    if len(tops) == 1 and all(len(parts) > 1 for parts in files):
        files = {parts[1:]: item for parts, item in files.items()}
    return {"/".join(parts): item for parts, item in files.items()}


def _is_unsafe(name, parts):
    return name.startswith("/") or ".." in parts or any(mark in name for mark in '\\:*?"<>|\0')


def find_results(files):
    """Folder of the results among the files, with "/" at its end; None without a record."""
    places = [name.removesuffix(RECORD) for name in files if name.rpartition("/")[2] == RECORD]
    return min(places, key=lambda place: (place.count("/"), place), default=None)


def find_job_file(files):
    """Settings or workbook of the job of a folder; "" without a job."""
    return next((name for name in JOB_FILES if name in files), "")


def read_member(path, item):
    """Content of a file of an archive (bytes)."""
    with zipfile.ZipFile(path) as archive:
        return archive.read(item)


def copy_sent_job(path, files, workspace, name):
    """Copy the input files of a sent job to a new folder of the workspace, and return its path."""
    folder = free_folder(Path(workspace), name)
    folder.mkdir(parents=True)
    try:
        with zipfile.ZipFile(path) as archive:
            for place, item in files.items():
                parts = place.split("/")
                if any(fnmatch.fnmatch(part, form) for part in parts for form in NOT_COPIED):
                    continue
                target = folder.joinpath(*parts)
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(archive.read(item))
    except BaseException:
        shutil.rmtree(folder)
        raise
    return folder
