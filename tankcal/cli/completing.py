"""`tankcal completion`: the script that completes commands, options, values and files in a shell.

The script is made of the parser itself, so that it knows every command; it is text, and no Python
starts at a press of the Tab key. What a parser does not say stands here: which arguments are files
or folders, by their names in help, and which options have names that ship.
"""

import argparse
import shlex

SHELLS = ("bash", "zsh", "fish")
FOLDERS = ("DIR",)
NO_FILES = (  # arguments that are neither a file nor a folder
    "CODE", "NAME", "PATTERN", "TIME", "WHERE", "RULE", "FORM", "N", "I|II|LOW,RANGE",
    "COLUMNSxROWS,START,START,STEP", "ADDRESS", "ID", "STEPS",
)  # fmt: skip
EPILOG = """\
for this session:  eval "$(tankcal completion bash)"
for good:
  bash  tankcal completion bash > ~/.local/share/bash-completion/completions/tankcal
  zsh   tankcal completion zsh > DIR/_tankcal, with DIR in fpath before compinit
  fish  tankcal completion fish > ~/.config/fish/completions/tankcal.fish"""


def add(commands, make_parser):
    """The parser of `tankcal completion`; `make_parser` gives (the whole parser in English, its
    words in the language that is spoken or None)."""
    parser = commands.add_parser(
        "completion",
        help="write the script for command completion in a shell",
        description="Write the script by which a shell completes the commands of tankcal, options, "
        "values, files and folders.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help=", ".join(SHELLS))
    parser.set_defaults(command=lambda options: print(script_for(options.shell, make_parser)))


def script_for(shell, make_parser):
    """The script for a shell, as text.

    Parameters
    ----------
    shell : str
        One of SHELLS.
    make_parser : callable
        Gives the parser in English, and a function that puts it into the language that is spoken.
    """
    import shtab

    parser, translate = make_parser()
    mark(parser, names_that_ship())
    translate(parser)
    _describe_by_their_lines(parser)
    return shtab.complete(parser, shell)


def names_that_ship():
    """{(command, option or argument): (names, whether a TOML file may stand there, too)}."""
    from tankcal.camera.formats.writing import KINDS
    from tankcal.cli.pages import page_names
    from tankcal.exports.profiles import shipped_profiles
    from tankcal.inspection import rules
    from tankcal.job import rule_files
    from tankcal.text.languages import LANGUAGES

    profiles = tuple(shipped_profiles())
    of_inspections, of_comparisons = rules.shipped_names(), rule_files.shipped_names()
    return {
        ("export", "--profile"): (profiles, True),
        ("inspect", "--rule"): (of_inspections, True),
        ("compare", "--rule"): (of_comparisons, True),
        ("batch", "--profile"): (profiles, True),
        ("batch", "--inspect-by"): (of_inspections, True),
        ("batch", "--compare-by"): (of_comparisons, True),
        ("report", "--language"): (LANGUAGES, False),
        ("docs", "page"): (page_names(), False),
        ("run", "--cluster"): (("auto", "local"), False),
        ("camera convert", "--to"): (KINDS, False),
        ("camera convert", "--from"): (KINDS, False),
    }


def mark(parser, named):
    """Say of each argument of a parser and of its commands what completes it."""
    command = parser.prog.removeprefix("tankcal").strip()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command_parser in action.choices.values():
                mark(command_parser, named)
            continue
        for option in action.option_strings or (action.dest,):
            if (command, option) in named:
                action.complete = _names_or_toml(*named[command, option])
        if action.nargs != 0 and action.choices is None and not hasattr(action, "complete"):
            files = _files_of(action)
            if files is not None:
                action.complete = files


def _describe_by_their_lines(parser):
    """A list of commands shows one line of each, in place of what its own help begins with."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for line in action._choices_actions:
                action.choices[line.dest].description = line.help
            for command_parser in action.choices.values():
                _describe_by_their_lines(command_parser)


def _files_of(action):
    """What completes an argument that may be a file; None: it is none."""
    import shtab

    if action.type is not None or not isinstance(action.metavar, str):
        return None
    if action.metavar in FOLDERS:
        return shtab.DIRECTORY
    if action.metavar in NO_FILES:
        return None
    return shtab.glob("*.toml") if action.metavar.endswith(".toml") else shtab.FILE


def _names_or_toml(names, or_file):
    """Completes one of these names; a TOML file and what lies in folders, where one may stand."""
    words = " ".join(map(shlex.quote, names))
    name = f"_tankcal_names_{sum(ord(c) * k for k, c in enumerate(words, 1))}"
    bash = [f"compgen -W {shlex.quote(words)} -- $1"]
    zsh = [f"'names:name:({words})'"]
    fish = [f"printf '%s\\n' {words}"]
    if or_file:
        bash += ["compgen -f -X '!*.toml' -- $1", "compgen -d -- $1"]
        zsh += ["'files:file:_files -g \"*.toml\"'"]
        fish += ["__fish_complete_suffix .toml"]
    functions = {
        "bash": f"{name}() {{\n  {'; '.join(bash)}\n}}",
        "zsh": f"{name}() {{\n  _alternative {' '.join(zsh)}\n}}",
        "fish": f"function {name}\n  {'; '.join(fish)}\nend",
    }
    return {"bash": name, "zsh": name, "fish": f"({name})", "preamble": functions}
