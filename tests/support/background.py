"""What a child process of a test needs where the tests themselves run in the background."""

import signal


def heed_ctrl_c():
    """Before a child starts: a shell has what it puts into the background ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
