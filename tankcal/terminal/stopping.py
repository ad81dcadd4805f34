"""Early end of a command: by Ctrl-C, SIGTERM, a closed terminal, or lack of memory."""

import signal
import threading
from contextlib import contextmanager

_OF_MEMORY = ("failed to map segment", "cannot allocate memory", "can't start new thread")
ENDING = ("SIGTERM", "SIGHUP")  # beside SIGINT, which Python turns into KeyboardInterrupt


class EndingSignal(KeyboardInterrupt):
    """A signal ended the command; unfinished work is undone, as after Ctrl-C.

    number  number of the signal
    """

    def __init__(self, number):
        super().__init__()
        self.number = number


@contextmanager
def raise_at_signals():
    """Raise `EndingSignal` in the block for a signal of ENDING; ignored signals remain ignored."""
    handled = []
    if threading.current_thread() is threading.main_thread():
        numbers = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
        handled = [number for number in numbers if signal.getsignal(number) == signal.SIG_DFL]
    for number in handled:
        signal.signal(number, _end)
    try:
        yield
    finally:
        for number in handled:
            signal.signal(number, signal.SIG_DFL)


def _end(number, _):
    raise EndingSignal(number)


def signal_status(error):
    """Return the exit status of a command ended by a signal (128 + signal), or None.

    Also if a library raised another error while handling the signal.
    """
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    return None if error is None else 128 + getattr(error, "number", signal.SIGINT)


def is_out_of_memory(error):
    """Return whether a command failed for lack of memory.

    Python raises other errors for libraries that cannot be loaded and threads that cannot start.
    """
    if isinstance(error, ImportError | RuntimeError | OSError):
        return any(text in str(error).lower() for text in _OF_MEMORY)
    return isinstance(error, MemoryError)
