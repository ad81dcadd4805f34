"""Computation of a saved job with progress and Stop, and errors of a notebook."""

import threading
import time

from tankcal.errors import TankcalError
from tankcal.messages import message
from tankcal.terminal import describe_progress


class Refusal(TankcalError):
    """An error that a notebook shows as its message, without a traceback."""

    exit_status = 2

    def _render_traceback_(self):
        """Lines that IPython shows in place of a traceback."""
        return [f"tankcal: {line}" for line in str(self).splitlines()]


class Stopped(TankcalError):
    """The user stopped the computation; nothing was written."""


class Run:
    """Computation of a job with the steps of `tankcal run`.

    Parameters
    ----------
    source, out : Path
        The job and the folder of the results.
    on_progress : callable, optional
        Function on_progress(text, share) that receives the progress of a step: a Message, and a
        share from 0 to 1 or None.
    papers : bool, optional
        Whether to write reports; if not, only record and CSV files are written.
    on_result : callable, optional
        Function on_result(result) that is called after the computation, before the reports.

    Attributes
    ----------
    result : Result or None
        Result of the job.
    files : list of Path
        Written files.
    error : BaseException or None
        Error that ended the computation.
    """

    def __init__(self, source, out, on_progress=None, papers=True, on_result=None):
        self.source, self.out, self.papers = source, out, papers
        self._on_progress = on_progress or (lambda text, share: None)
        self._on_result = on_result or (lambda result: None)
        self._is_stopped = threading.Event()
        self._now, self._began = None, (0.0, 0)
        self.result, self.files, self.error = None, [], None

    def stop(self):
        """Stop the computation at its next step."""
        self._is_stopped.set()

    def start(self):
        """Start the computation in a new thread, and return the thread."""
        thread = threading.Thread(target=self._compute_in_thread, daemon=True)
        thread.start()
        return thread

    def wait(self):
        """Compute and write the results, and raise the error if there is an error."""
        self.start().join()
        if self.error is not None:
            raise self.error
        return self

    def _compute_in_thread(self):
        """Compute, and keep an error for the thread that waits."""
        try:
            self._compute()
        except BaseException as error:  # raised again by `wait`
            self.error = error

    def _compute(self):
        """Read and compute the job, and write the results."""
        import tankcal
        from tankcal.report import outputs

        outputs.refuse_foreign(self.out)
        self._step(message("reading_saved_job", "reading the job"))
        job = tankcal.load(self.source)
        self.result = tankcal.run(job, self._step, part_progress=self._part)
        self._on_result(self.result)
        self.files = outputs.write(self.result, self.out, self._part, papers=self.papers)

    def _step(self, text):
        """Report the start of a step."""
        self._part(text, 0, 0)

    def _part(self, text, done, total):
        """Report the progress of a step with the time left; raise Stopped after Stop."""
        if self._is_stopped.is_set():
            raise Stopped(message("run_stopped", "stopped; nothing was written"))
        if text != self._now:
            self._now, self._began = text, (time.monotonic(), done)
        share = done / total if total else None
        if total > 1:
            began, first = self._began
            left = describe_progress(done, total, done - first, time.monotonic() - began)
            text = message("step_and_part", "{step} {part}", step=text, part=left)
        self._on_progress(text, share)
