"""Computation of a job in a process of its own, with progress for all windows."""

import asyncio
import json
import sys
import time
from contextlib import suppress

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
