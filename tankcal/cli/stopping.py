"""A command that ends early: by Ctrl-C, SIGTERM, a closed terminal, or for want of memory."""

import signal
import threading
from contextlib import contextmanager

_OF_MEMORY = ("failed to map segment", "cannot allocate memory", "can't start new thread")
ENDING = ("SIGTERM", "SIGHUP")  # beside SIGINT, which Python turns into KeyboardInterrupt


class Ended(KeyboardInterrupt):
    """A signal ended the command: what was begun is taken back, as with Ctrl-C.

    number  of the signal
    """

    def __init__(self, number):
        super().__init__()
        self.number = number


@contextmanager
def ended_by_signals():
    """Raise `Ended` in the block when one of ENDING comes; a signal that is ignored remains so."""
    ours = []
    if threading.current_thread() is threading.main_thread():
        numbers = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
        ours = [number for number in numbers if signal.getsignal(number) == signal.SIG_DFL]
    for number in ours:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)


def _end(number, _):
    raise Ended(number)


def stopped_status(error):
    """Exit status of a command by what ended it: 128 and the signal; None: no signal did.

    However a library dressed it: what was being handled when an error was raised counts.
    """
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return None if error is None else 128 + getattr(error, "number", signal.SIGINT)


def is_of_memory(error):
    """Whether a command failed because the system gave it no more memory.

    Python raises other errors for a library that cannot be loaded and a thread that cannot start.
    """
    if isinstance(error, ImportError | RuntimeError | OSError):
        return any(text in str(error).lower() for text in _OF_MEMORY)
    return isinstance(error, MemoryError)
