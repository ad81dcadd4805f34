"""`tankcal completion`: what the Tab key gives in a real bash, fish and zsh."""

import argparse
import re
import shlex
import shutil
import subprocess

import pytest

from tankcal.cli import _parser_in_english
from tankcal.cli.completing import SHELLS, completion_script
from tankcal.terminal import speak

pytest.importorskip("shtab")
LINES = {  # what is typed: what completes its last word (property: read off the parser's help)
    "tankcal re": {"read-table", "register", "report"},
    "tankcal new x --survey t": {"total-station", "tangents", "triangulation"},
    "tankcal new x --kind h": {"horizontal"},
    "tankcal new x --language p": {"pt-BR"},
    "tankcal run my-tank --o": {"--out", "--only"},
    "tankcal run my": {"my-tank"},
    "tankcal inspect x --rule api": {"api_650", "api_653"},
    "tankcal inspect x --rule ho": {"house.toml"},
    "tankcal compare old.csv x --rule oi": {"oiml_r71"},
    "tankcal compare old.csv x --former h": {"house.toml"},
    "tankcal export x --profile signet": {"signet-9900"},
    "tankcal batch x --inspect-by api": {"api_650", "api_653"},
    "tankcal batch x --compare-by ho": {"house.toml"},
    "tankcal batch x --profile signet": {"signet-9900"},
    "tankcal history x --tank o": set(),
    "tankcal camera co": {"compare", "convert"},
    "tankcal camera convert x --to opencv": {"opencv", "opencv-json"},
    "tankcal import a.gsi o": {"old.csv"},
    "tankcal lint x --sheet o": set(),
    "tankcal completion z": {"zsh"},
}
BASH = """\
source {script}
while IFS= read -r line; do
  read -ra COMP_WORDS <<< "$line"
  COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 )) COMPREPLY=()
  _shtab_tankcal
  echo "${{COMPREPLY[*]}}"
done
"""
FISH = """\
source {script}
while read line
  echo (complete -C "$line" | string split -f1 \\t | string join ' ')
end
"""
ZSH = """\
PS1='READY> '; fpath=({folder} $fpath); autoload -Uz compinit; compinit -u -D
setopt nolistbeep noautomenu nolistpacked; LISTMAX=500; echo LO""ADED
"""  # zsh has no door to what it would complete: it is asked in a terminal
IN_ZSH = {
    "tankcal re": ("report ", "register ", "read-table "),
    "tankcal new x --survey t": ("total-station", "tangents", "triangulation"),
    "tankcal run my-tank --o": ("--out ", "--only "),
    "tankcal inspect x --rule api": ("api_650", "api_653"),
    "tankcal inspect x --rule h": ("house.toml",),
    "tankcal run my": ("my-tank/",),
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my-tank").mkdir()
    for name in ("old.csv", "house.toml", "my-tank/job.toml"):
        (tmp_path / name).touch()
    return tmp_path


@pytest.fixture(scope="module")
def scripts():
    speak("en")
    return {shell: completion_script(shell, _parser_in_english) for shell in SHELLS}


def completed(shell, program, folder, script):
    """What the shell completes each of LINES to: a text for each."""
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    (folder / ".script").mkdir()
    file = folder / ".script/_tankcal"
    file.write_text(script, encoding="utf-8")
    run = program.format(script=shlex.quote(str(file)), folder=shlex.quote(str(file.parent)))
    done = subprocess.run(
        [shell, "-c", run], input="\n".join(LINES) + "\n", cwd=folder, text=True,
        capture_output=True, check=True, timeout=120,
    )  # fmt: skip
    return dict(zip(LINES, done.stdout.split("\n"), strict=False))


@pytest.mark.slow
@pytest.mark.parametrize(("shell", "program"), [("bash", BASH), ("fish", FISH)])
def test_words_that_a_shell_completes(shell, program, folder, scripts):
    found = completed(shell, program, folder, scripts[shell])
    told = {line: {one.rstrip("/") for one in text.split()} for line, text in found.items()}
    if shell == "fish":  # after names with the ending it lists what lies beside them
        told = {line: words & (LINES[line] or words) for line, words in told.items()}
    assert told == LINES


@pytest.mark.slow
def test_words_that_zsh_completes(folder, scripts):
    pexpect = pytest.importorskip("pexpect")
    if shutil.which("zsh") is None:
        pytest.skip("zsh is not installed")
    (folder / ".script").mkdir()
    (folder / ".script/_tankcal").write_text(scripts["zsh"], encoding="utf-8")
    environment = {"PATH": "/usr/bin:/bin", "TERM": "dumb", "HOME": str(folder / ".script")}
    shell = pexpect.spawn(
        "zsh", ["-f", "-i"], cwd=str(folder), env=environment | {"LC_ALL": "C.UTF-8"},
        encoding="utf-8", timeout=60, dimensions=(50, 300),
    )  # fmt: skip
    shell.sendline(ZSH.format(folder=shlex.quote(str(folder / ".script"))))
    shell.expect("LOADED\r\n")
    for line, words in IN_ZSH.items():
        shell.expect("READY> ")
        shell.send(f"{line}\t\t")
        for word in sorted(words):
            shell.expect(re.escape(word))
        shell.sendcontrol("u")
        shell.sendline("")
    shell.close(force=True)


@pytest.mark.parametrize("shell", SHELLS)
def test_every_command_and_option_is_in_the_script(shell, scripts):
    parser, _ = _parser_in_english()
    words = set()

    def walk(one):
        for action in one._actions:
            words.update(option.lstrip("-") for option in action.option_strings)
            if isinstance(action, argparse._SubParsersAction):
                words.update(action.choices)
                for command in action.choices.values():
                    walk(command)

    walk(parser)
    assert len(words) > 80
    assert [word for word in words if word not in scripts[shell]] == []


def test_a_script_speaks_the_language_of_the_user():
    speak("es")
    try:
        assert "calcular un servicio" in completion_script("fish", _parser_in_english)
    finally:
        speak("en")
