"""The computing of a saved job: with progress, and to be stopped."""

import threading
import time

from tankcal.errors import TankcalError
from tankcal.messages import message
from tankcal.text.time_left import how_far


class Stopped(TankcalError):
    """Somebody pressed Stop: nothing was written."""


class Run:
    """One computing of a job: the same as `tankcal run`, step by step.

    Parameters
    ----------
    source, out : Path
        The job and the folder of the results.
    tell : callable, optional
        tell(text, share), a Message and 0 to 1 or None, as a step goes on.
    papers : bool, optional
        False: record and CSV files only.
    on_result : callable, optional
        on_result(result) as soon as the table is there, before the papers.

    Attributes
    ----------
    result : Result or None
    files : list of Path
        What was written.
    error : BaseException or None
    """

    def __init__(self, source, out, tell=None, papers=True, on_result=None):
        self.source, self.out, self.papers = source, out, papers
        self._tell = tell or (lambda text, share: None)
        self._on_result = on_result or (lambda result: None)
        self._is_stopped = threading.Event()
        self._now, self._began = None, (0.0, 0)
        self.result, self.files, self.error = None, [], None

    def stop(self):
        """Ask it to stop; it does at the next step."""
        self._is_stopped.set()

    def start(self):
        """Begin in a thread of its own, which is returned."""
        thread = threading.Thread(target=self._guarded, daemon=True)
        thread.start()
        return thread

    def wait(self):
        """Compute, and return when all is written; what went wrong is raised."""
        self.start().join()
        if self.error is not None:
            raise self.error
        return self

    def _guarded(self):
        try:
            self._compute()
        except BaseException as error:  # handed over to whoever waits
            self.error = error

    def _compute(self):
        import tankcal
        from tankcal.report import outputs

        outputs.refuse_foreign(self.out)
        self._step(message("reading_saved_job", "reading the job"))
        job = tankcal.load(self.source)
        self.result = tankcal.run(job, self._step, part_progress=self._part)
        self._on_result(self.result)
        self.files = outputs.write(self.result, self.out, self._part, papers=self.papers)

    def _step(self, text):
        self._part(text, 0, 0)

    def _part(self, text, done, total):
        if self._is_stopped.is_set():
            raise Stopped(message("run_stopped", "stopped; nothing was written"))
        if text != self._now:
            self._now, self._began = text, (time.monotonic(), done)
        share = done / total if total else None
        if total > 1:
            began, first = self._began
            left = how_far(done, total, done - first, time.monotonic() - began)
            text = message("step_and_part", "{step} {part}", step=text, part=left)
        self._tell(text, share)
