"""Pages whose commands are run in an empty folder, what they print held against the page.

    python tests/support/page_sessions.py docs/tutorial-es.md    writes anew what the commands print

A line that ends in **`path`**: names the file that the next block is; where it begins with words
of APPEND the block goes to the end of that file. A block `console` has commands behind `$ ` and
what they print; `...` in it stands for anything. `examples` are those of the project. A block
`pycon` is a session of Python. The language of the terminal is that of the file's name. The path
`JOB/job.xlsx#SHEET` names a sheet of a workbook: the block has its headings and the values typed.
"""

import csv
import datetime
import os
import re
import shlex
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"^(?P<words>.*)\*\*`(?P<path>[^`]+)`\*\*:\n\n$", re.MULTILINE)
APPEND = ("No fim de", "Al final de", "At the end of")
LOCALES = {"pt-BR": "pt_BR.UTF-8", "es": "es_MX.UTF-8"}


@dataclass(frozen=True)
class Block:
    kind: str
    text: str
    start: int
    end: int
    path: str | None
    append: bool


def blocks_of(page):
    """Blocks of a page, in their order."""
    found = []
    for match in FENCE.finditer(page):
        line = page.rfind("\n", 0, max(match.start() - 2, 0)) + 1
        named = FILE.fullmatch(page[line : match.start()])
        path = None if named is None else named["path"]
        append = named is not None and named["words"].startswith(APPEND)
        found.append(Block(match[1], match[2], match.start(2), match.end(2), path, append))
    return found


def commands_of(text):
    """[(command, what it prints)] of a block `console`."""
    parts = re.split(r"^\$ (.*)\n", text, flags=re.MULTILINE)
    return list(zip(parts[1::2], parts[2::2], strict=True))


def agrees(expected, printed):
    """Whether what a command prints is what a page shows."""
    pattern = ".*?".join(re.escape(part) for part in expected.split("..."))
    return re.fullmatch(pattern, printed, re.DOTALL) is not None


def run_page(path, folder):
    """[(block, [(command, expected, printed)])]: the session of a page, run in `folder`."""
    done = []
    (folder / "examples").symlink_to(ROOT / "examples")
    for block in blocks_of(path.read_text(encoding="utf-8")):
        if block.path is not None:
            target = folder / block.path
            target.parent.mkdir(parents=True, exist_ok=True)
            if "#" in target.name:
                fill_sheet(target, block.text)
                continue
            with target.open("a" if block.append else "w", encoding="utf-8") as file:
                file.write(block.text)
        elif block.kind == "console":
            told = [
                (command, expected, printed_by(command, folder, path))
                for command, expected in commands_of(block.text)
            ]
            done.append((block, told))
        elif block.kind == "pycon":
            done.append((block, [("python", "", said_by_python(block.text, folder, path))]))
    return done


def fill_sheet(target, text):
    """Type the rows of a block into a sheet of a workbook, `job.xlsx#courses`."""
    from filled_forms import fill_form

    name, _, sheet = target.name.partition("#")
    heading, *lines = csv.reader(text.splitlines(), delimiter=";")
    rows = [[value_of_cell(cell) for cell in line] for line in lines]
    path = target.with_name(name)
    if sheet == "job":
        settings = {f"{section}.{key}": value for section, key, value in rows}
        fill_form(path, settings, {})
    else:
        fill_form(path, {}, {sheet: [heading, *rows]})


def value_of_cell(text):
    """The value that Excel stores for a typed text: a number, a date, or the text."""
    if re.fullmatch(r"-?\d+([.,]\d+)?", text):
        return float(text.replace(",", "."))
    if re.fullmatch(r"\d{4}-\d\d-\d\d", text):
        return datetime.date.fromisoformat(text)
    return text or None


def printed_by(command, folder, page):
    """What a command prints on the terminal, as its user would call it."""
    tankcal = shlex.join([sys.executable, "-m", "tankcal"])
    script = f'tankcal() {{ {tankcal} "$@"; }}\n{command}'
    done = subprocess.run(
        ["bash", "-c", script], cwd=folder, env=environment(page), stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=300,
    )  # fmt: skip
    return done.stdout.decode("utf-8")


def environment(page):
    """Of the reader of a page."""
    language = re.search(r"-(pt-BR|es)$", page.stem)
    kept = {k: v for k, v in os.environ.items() if not k.startswith("LC_")}
    root = str(ROOT)
    return kept | {
        "LANG": LOCALES[language[1]] if language else "C.UTF-8",
        "PYTHONPATH": os.pathsep.join([root, kept.get("PYTHONPATH", "")]).rstrip(os.pathsep),
        "PYTHONUNBUFFERED": "1",
    }


def said_by_python(text, folder, page):
    """What doctest has against a session of Python; "" when it prints what it shows."""
    session = folder / "session.txt"
    session.write_text(text + "\n", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "doctest", "-o", "ELLIPSIS", session.name], cwd=folder,
        env=environment(page), capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    session.unlink()
    return done.stdout + done.stderr


def renew(path):
    """Write into a page what its commands print."""
    page = path.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        done = run_page(path, Path(folder))
    for block, told in reversed(done):
        if block.kind == "console":
            text = "".join(
                f"$ {command}\n{expected if agrees(expected, printed) else printed}"
                for command, expected, printed in told
            )
            page = page[: block.start] + text + page[block.end :]
        else:
            print(*(printed for _, _, printed in told))
    path.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    for name in sys.argv[1:]:
        renew(Path(name))
