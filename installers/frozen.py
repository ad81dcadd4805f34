"""Program of the folder that PyInstaller builds: tankcal, and the Python that tankcal calls.

tankcal starts processes as `sys.executable -m MODULE` and `sys.executable -c CODE`. In this folder
that program is tankcal itself, so these two forms are answered as Python answers them.
"""

import multiprocessing
import runpy
import sys


def main():
    """Run a module, code, or the command line; without arguments the app opens on a display."""
    multiprocessing.freeze_support()
    form, *rest = sys.argv[1:] or [""]
    if form == "-m" and rest:
        sys.argv = rest
        runpy.run_module(rest[0], run_name="__main__", alter_sys=True)
    elif form == "-c" and rest:
        sys.argv = ["-c", *rest[1:]]
        exec(compile(rest[0], "<string>", "exec"), {"__name__": "__main__"})
    else:
        from tankcal.cli import main as run

        sys.exit(run())


if __name__ == "__main__":
    main()
