"""Jobs that the app has open, uploads, and places of folders; found by identifiers of the app.

No path of a request is used: a request names a job, an upload or a folder by an identifier that
the app assigned when it listed it. A folder that a browser sends is kept as a zip archive.
"""

import asyncio
import fnmatch
import hashlib
import json
import secrets
import shutil
import sys
import time
import zipfile
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from starlette.exceptions import HTTPException

from tankcal.errors import InputError
from tankcal.messages import message
from tankcal.products.app.access import ChangeLog
from tankcal.products.desk.computing import Refusal
from tankcal.products.desk.desk import Desk
from tankcal.products.desk.display import Reader, describe_state
from tankcal.products.desk.draft import Draft, source_of
from tankcal.products.desk.jobs import (
    JOB_FILES,
    NOT_COPIED,
    RENEWAL_S,
    Act,
    JobLock,
    Journal,
    RecentJobs,
    State,
    find_decision,
    find_state_folder,
    free_folder,
    new_owner,
    read_events,
    record_digest,
    state_of_results,
)
from tankcal.report.folders import default_folder
from tankcal.text.words import load_words

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


SAVE_S = 2.0  # time after the last edit at which the files are written
QUICK_CHECK_S = 0.08  # a full check that takes less time is made before the answer to an edit
MOST_UPLOAD = 200_000_000  # bytes
KEPT_UPLOAD_S = 24 * 3600
UNUSED_S = 3600  # time without a request after which a job is closed
REGISTER = "register.csv"  # in the workspace
MOST_EDITORS = 400  # edits of which the page is known
MOST_WAITING = 64  # events that wait for a window


def identifier(path):
    """Identifier of a path in addresses."""
    return hashlib.sha256(str(path).encode("utf-8", "surrogateescape")).hexdigest()[:16]


@dataclass(frozen=True)
class Upload:
    """An uploaded file: its path, named by the app, and the name given by the user."""

    path: Path
    name: str


class OpenJob:
    """A job with its desk, its lock, its computation, and the windows that show it."""

    def __init__(self, key, desk, lock):
        self.key, self.desk, self.lock = key, desk, lock
        self.reading = secrets.token_hex(8)  # revisions count from this reading of the files
        self.holder, self.used_s = None, time.monotonic()
        self._has_formulas, self._approval = desk.draft.locked, (None, None)
        self._editors = {}
        self.run, self.is_autosaved = None, not desk.draft.is_book
        self.check_s, self.saved_s, self.refusal = 0.0, None, ""
        self._windows, self._tasks = set(), {}

    @property
    def source(self):
        """Folder or workbook of the job."""
        return self.desk.draft.source

    @property
    def is_computing(self):
        """Whether a computation has not ended."""
        return self.run is not None and self.run.is_active

    @property
    def is_watched(self):
        """Whether a window shows the job."""
        return bool(self._windows)

    @property
    def is_unsaved(self):
        """Whether the draft differs from the files."""
        return self.desk.draft.is_changed

    @property
    def out(self):
        """Folder of the results."""
        return self.desk.out

    @property
    def folder(self):
        """Folder of the files of the job."""
        return self.source.parent if self.source.is_file() else self.source

    # ---- lock and approval

    def follow_lock(self, *, by_force=False):
        """Lock the draft while another program has the job open, or while it is approved."""
        self.used_s = time.monotonic()
        self.holder = self.lock.acquire(by_force=by_force)
        self.desk.draft.locked = self._has_formulas or self.read_only

    @property
    def read_only(self):
        """Message why the job must not be changed or computed; None if it may be."""
        if self.holder is not None:
            return message(
                "job_open_elsewhere",
                "open in another program ({user} on {machine}); it is only shown here until it is "
                "closed there",
                user=self.holder.user, machine=self.holder.machine,
            )  # fmt: skip
        approval = self._find_approval()
        if approval is not None:
            return message(
                "job_approved", "approved by {name} on {day}; Revise on the page Review permits "
                "changes", name=approval.name, day=f"{approval.time:%Y-%m-%d}",
            )  # fmt: skip
        return None

    def _find_approval(self):
        """Event of the approval of the present results, or None; kept while no file changes."""
        from tankcal.products.desk.jobs import FILE, folder_of

        path = folder_of(self.source) / FILE
        try:
            stamp = path.stat().st_mtime_ns, (self.out / "record.json").stat().st_mtime_ns
        except OSError:
            return None
        if self._approval[0] != stamp:
            decision = None
            with suppress(InputError):
                decision = find_decision(read_events(self.source), record_digest(self.out))
            if decision is not None and decision.act is not Act.APPROVED:
                decision = None
            self._approval = stamp, decision
        decision = self._approval[1]
        is_present = decision and state_of_results(self.folder, self.out) is State.COMPUTED
        return decision if is_present else None

    # ---- edits of a page

    def note_edits(self, before, client):
        """Note the page that made the edits since a revision."""
        for revision in range(before, self.desk.draft.revision):
            self._editors[revision] = client
            self._editors.pop(revision - MOST_EDITORS, None)

    def seen_revision(self, revision, client):
        """Revision that a page has seen; its own edits after it are known there."""
        while isinstance(revision, int) and client and self._editors.get(revision) == client:
            revision += 1
        return revision

    # ---- windows

    def subscribe(self):
        """New queue of the events for a window."""
        queue = asyncio.Queue(MOST_WAITING)
        self._windows.add(queue)
        return queue

    def unsubscribe(self, queue):
        """Forget a window."""
        self._windows.discard(queue)

    def publish(self):
        """Notify all windows of a change; a window asks for its differences."""
        for queue in self._windows:
            with suppress(asyncio.QueueFull):
                queue.put_nowait("changed")

    # ---- check and save after edits

    def follow_edit(self):
        """Check after an edit, at once if that is quick, and save after a pause."""
        if self.check_s < QUICK_CHECK_S:
            began = time.monotonic()
            self.desk.outcome  # noqa: B018  the check is kept
            self.check_s = time.monotonic() - began
        elif "check" not in self._tasks:
            self._start("check", self._check_later())
        if self.is_autosaved:
            self._cancel("save")
            self._start("save", self._save_later())
        self.publish()

    def _start(self, name, work):
        task = asyncio.get_running_loop().create_task(work)
        self._tasks[name] = task
        task.add_done_callback(lambda done: self._forget(name, done))

    def _forget(self, name, task):
        if self._tasks.get(name) is task:
            del self._tasks[name]

    def _cancel(self, name):
        task = self._tasks.pop(name, None)
        if task is not None:
            task.cancel()

    async def check(self):
        """Make the full check of the present revision, in a thread, and keep it."""
        desk = self.desk
        while desk.present_check is None:
            revision, began = desk.draft.revision, time.monotonic()
            try:
                check = await asyncio.to_thread(desk.draft.check)
            except Exception:
                # An edit during the check may mix two states; then the check is repeated.
                if revision == desk.draft.revision:
                    raise
                continue
            self.check_s = time.monotonic() - began
            desk.keep_check(check, revision)

    async def _check_later(self):
        await self.check()
        self.publish()

    async def _save_later(self):
        await asyncio.sleep(SAVE_S)
        self.save()
        self.publish()

    def save(self):
        """Write the files; a refusal is kept for the windows. Return whether all is saved."""
        check = self.desk.present_check
        try:
            self.desk.save()
        except Exception as error:  # a refusal of the desk has its text in the language
            self.refusal = str(error)
            return False
        if check is not None:
            self.desk.keep_check(check, self.desk.draft.revision)
        self.refusal, self.saved_s = "", time.time()
        return True

    # ---- computing

    def start(self, has_documents=True):
        """Save the job and start its computation; raises Refusal if it cannot be computed."""
        if self.is_computing:
            return
        if self.read_only is not None:
            raise Refusal(self.desk.reader.say(self.read_only))
        prepared = self.desk.prepare_run()
        self.saved_s = time.time()
        self.run = WorkerRun(prepared.source, prepared.out, has_documents, self.publish)
        self.publish()

    def describe(self):
        """State of the job for all windows."""
        run = None if self.run is None else self.run.show(self.desk.reader.language)
        return describe_state(self.desk) | {
            "desk": self.reading,
            "run": run,
            "refusal": self.refusal,
            "saved_s": self.saved_s,
            "is_autosaved": self.is_autosaved,
        }


def _add_certificate(job, certificates):
    """`RecentJob` with the state of its certificate in the register, if there is any."""
    known = certificates.get(job.state.record_sha256) if job.state.record_sha256 else None
    if known is None:
        return job
    return replace(job, state=replace(job.state, state=State(known.state), number=known.number))


class Site:
    """Jobs, uploads and folders of a running app.

    Parameters
    ----------
    workspace : Path
        Folder of new jobs.
    state : Path, optional
        State folder; by default that of the user.
    people : People, optional
        Users of an app that other machines can reach; None: the user of this machine.
    """

    def __init__(self, workspace, state=None, people=None):
        self.workspace, self.people = Path(workspace), people
        self.owner, self._renewal = new_owner(), None
        self.state = Path(state or find_state_folder())
        self.recent, self.log = RecentJobs(self.state), ChangeLog(self.state)
        self._paths, self._jobs, self._uploads, self._readers = {}, {}, {}, {}
        self._places, self._words = {}, {}
        self._remove_old_uploads()

    def _remove_old_uploads(self):
        for path in (self.state / "uploads").glob("*"):
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > KEPT_UPLOAD_S:
                    path.unlink()

    def reader(self, language):
        """`Reader` of a language, which is kept because its words take long to load."""
        if language not in self._readers:
            self._readers[language] = Reader(language)
        return self._readers[language]

    def words(self, language):
        """Words of the pages in a language, which are kept."""
        if language not in self._words:
            self._words[language] = load_words(language)["app"]
        return self._words[language]

    # ---- jobs

    def add(self, source):
        """Add a job to the list of recent jobs, and return its identifier."""
        source = source_of(source).resolve()
        self.recent.add(source)
        key = identifier(source)
        self._paths[key] = source
        return key

    def list_recent(self):
        """List of (identifier, RecentJob); the register states which results are issued."""
        jobs = self.recent.list()
        self._paths |= {identifier(job.source): job.source for job in jobs}
        certificates = {}
        with suppress(InputError):  # the page of the register shows the problem
            certificates = {item.record_sha256: item for item in self.read_register().values()}
        return [(identifier(job.source), _add_certificate(job, certificates)) for job in jobs]

    @property
    def register(self):
        """Path of the register of certificates."""
        return self.workspace / REGISTER

    def read_register(self):
        """Certificates of the register, {number: RegisteredCertificate}."""
        from tankcal.products.register.certificates import read_certificates

        return read_certificates(self.register) if self.register.is_file() else {}

    def path(self, key):
        """Path of a listed job, or None."""
        if key not in self._paths:
            self.list_recent()
        return self._paths.get(key)

    def job(self, key, language):
        """`OpenJob` of an identifier with texts in a language; None if there is no such job."""
        source = self.path(key)
        if source is None:
            return None
        job = self._jobs.get(key)
        if job is not None and not job.desk.draft.is_changed and not job.is_computing:
            try:
                job.desk.draft.refuse_changed_elsewhere()
            except InputError:  # another program has changed a file: read the job again
                job = None
        if job is None:
            try:
                desk = Desk(Draft.open(source), default_folder(source), self.reader(language))
            except InputError:
                return None
            desk.keep_journal(Journal(source, self.state))
            lock = JobLock(source, self.owner)
            job = self._jobs[key] = OpenJob(key, desk, lock)
            self._keep_locks()
        job.follow_lock()
        job.desk.reader = self.reader(language)
        return job

    def _keep_locks(self):
        """Start to renew the locks, and to close unused jobs, while the server runs."""
        if self._renewal is None or self._renewal.done():
            with suppress(RuntimeError):  # without a running loop, as in a test of the model
                self._renewal = asyncio.get_running_loop().create_task(self._renew_locks())

    async def _renew_locks(self):
        while self._jobs:
            await asyncio.sleep(RENEWAL_S)
            for key, job in list(self._jobs.items()):
                is_unused = time.monotonic() - job.used_s > UNUSED_S
                if is_unused and not (job.is_watched or job.is_computing or job.is_unsaved):
                    job.lock.release()
                    del self._jobs[key]
                else:
                    job.lock.renew()

    def close(self):
        """Save jobs that are saved automatically, and release the locks, when the server ends."""
        for job in self._jobs.values():
            if job.is_unsaved and job.is_autosaved:
                job.save()
            job.lock.release()

    def forget(self, key):
        """Read a job again when it is next shown, because its files were replaced."""
        self._jobs.pop(key, None)

    # ---- uploads

    def new_upload(self, name):
        """New `Upload` without content, and its identifier."""
        key = secrets.token_hex(12)
        folder = self.state / "uploads"
        folder.mkdir(parents=True, exist_ok=True)
        self._uploads[key] = Upload(folder / f"{key}.bin", Path(name.replace("\\", "/")).name[:120])
        return key, self._uploads[key]

    def upload(self, key):
        """`Upload` of an identifier, or None."""
        upload = self._uploads.get(key)
        return upload if upload is not None and upload.path.is_file() else None

    # ---- folders

    def list_places(self, key):
        """Folder of an identifier with its parent and its folders; the roots for "".

        Returns
        -------
        path : Path or None
        places : list of (str, str, bool)
            Identifier, name, and whether the folder or workbook is a job.
        """
        # Users of other machines get the workspace only.
        roots = [self.workspace] if self.people else [self.workspace, Path.home()]
        if key == "":
            return None, [self._place(root, str(root)) for root in dict.fromkeys(roots)]
        path = self._places.get(key)
        if path is None:
            return None, []
        places = [self._place(path.parent, "..")] if path not in roots else []
        with suppress(OSError):
            for item in sorted(path.iterdir(), key=lambda item: item.name.lower()):
                is_inside = any(item.resolve().is_relative_to(root.resolve()) for root in roots)
                is_shown = item.is_dir() or item.suffix.lower() == ".xlsx"
                if is_inside and is_shown and not item.name.startswith("."):
                    places.append(self._place(item, item.name))
        return path, places

    def _place(self, path, name):
        """Identifier, name, and whether a path is a job."""
        key = identifier(path)
        self._places[key] = path
        try:
            source_of(path)
        except InputError:
            return key, name, False
        return key, name, True

    def place(self, key):
        """Path of a listed folder, or None."""
        return self._places.get(key)


# ---- computation of a job in a process of its own, with progress for all windows


STOP_S = 3.0  # time after which a process that does not stop is killed
MOST_AT_ONCE = 2  # computations at a time; others wait
MOST_LINE = 2**20  # longest line of a worker, bytes
_turns = asyncio.Semaphore(MOST_AT_ONCE)


class WorkerRun:
    """Computation of a saved job.

    Attributes
    ----------
    state : {"waiting", "running", "done", "failed", "stopped"}
        State.
    text : dict
        Present step in each language.
    share : float or None
        Completed share of the step.
    lines : dict
        Lines of the error in each language.
    began_s : float
        Time of the start, seconds since 1970.
    """

    def __init__(self, source, out, has_documents, on_change):
        self._command = (str(source), str(out), "documents" if has_documents else "")
        self._on_change, self._process = on_change, None
        self.state, self.text, self.share, self.lines = "waiting", {}, None, {}
        self.began_s = time.time()
        self.task = asyncio.get_running_loop().create_task(self._follow())

    @property
    def is_active(self):
        """Whether the computation has not ended."""
        return self.state in ("waiting", "running")

    async def _follow(self):
        """Run the process and keep its last line."""
        try:
            async with _turns:
                if self.is_active:
                    await self._compute()
        finally:
            if self.is_active:
                self.state = "failed"
            self._on_change()

    async def _compute(self):
        """Start the process and read its lines until it ends."""
        self.state = "running"
        self._process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "tankcal.products.app.worker", *self._command,
            stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE, limit=MOST_LINE,
        )  # fmt: skip
        errors = asyncio.get_running_loop().create_task(self._process.stderr.read())
        async for line in self._process.stdout:
            with suppress(ValueError):
                self._take(json.loads(line))
        await self._process.wait()
        last = (await errors).decode("utf-8", "replace").strip().splitlines()[-1:]
        if self.state == "running":
            self.state, self.lines = "failed", {"": last}

    def _take(self, content):
        """Take over a line of the process."""
        if self.state == "stopped":
            return
        if "done" in content:
            self.state = "done"
        elif "error" in content:
            self.state, self.lines = "failed", content["error"]
        else:
            self.text, self.share = content["text"], content["share"]
        self._on_change()

    async def stop(self):
        """Stop the computation."""
        if not self.is_active:
            return
        self.state = "stopped"
        if self._process is not None:
            with suppress(ProcessLookupError):
                self._process.terminate()
                try:
                    await asyncio.wait_for(self._process.wait(), STOP_S)
                except TimeoutError:
                    self._process.kill()
        self._on_change()

    def show(self, language):
        """State, step, share and lines of the error in a language, for a page."""
        return {
            "state": self.state,
            "text": self.text.get(language, ""),
            "share": self.share,
            "lines": self.lines.get(language, self.lines.get("", [])),
            "seconds": round(time.time() - self.began_s),
        }
