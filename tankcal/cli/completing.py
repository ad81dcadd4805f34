"""`tankcal completion`: script for completion of commands, options, values and files in a shell.

The script is created from the parser and therefore contains every command. It does not start Python
at a press of the Tab key. This module defines what the parser does not contain: file and folder
arguments, identified by their names in the help, and options with shipped names.
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


def add(commands):
    """Add the parser of `tankcal completion`."""
    parser = commands.add_parser(
        "completion",
        help="write the script for command completion in a shell",
        description="Write the script by which a shell completes the commands of tankcal, options, "
        "values, files and folders.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help=", ".join(SHELLS))
    parser.set_defaults(command=_complete)


def _complete(options):
    from tankcal.cli import _parser_in_english

    print(completion_script(options.shell, _parser_in_english))


def completion_script(shell, make_parser):
    """Return the completion script for a shell.

    Parameters
    ----------
    shell : str
        One of SHELLS.
    make_parser : callable
        Returns the parser in English, and a function that translates it to the current language.
    """
    import shtab

    parser, translate = make_parser()
    _set_completions(parser, shipped_choices())
    translate(parser)
    _describe_commands(parser)
    return shtab.complete(parser, shell)


def shipped_choices():
    """Return {(command, option or argument): (names, whether a TOML file is also valid)}."""
    from tankcal.products.base import products

    choices = {}
    for product in products():
        choices |= product.completions()
    return choices


def _set_completions(parser, choices):
    """Set the completion of each argument of a parser and of its commands."""
    command = parser.prog.removeprefix("tankcal").strip()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command_parser in action.choices.values():
                _set_completions(command_parser, choices)
            continue
        for option in action.option_strings or (action.dest,):
            if (command, option) in choices:
                action.complete = _complete_choice(*choices[command, option])
        if action.nargs != 0 and action.choices is None and not hasattr(action, "complete"):
            files = _complete_file(action)
            if files is not None:
                action.complete = files


def _describe_commands(parser):
    """Describe each command in a list by its one-line help."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for line in action._choices_actions:
                action.choices[line.dest].description = line.help
            for command_parser in action.choices.values():
                _describe_commands(command_parser)


def _complete_file(action):
    """Return the completion of an argument that may be a file, or None."""
    import shtab

    if action.type is not None or not isinstance(action.metavar, str):
        return None
    if action.metavar in FOLDERS:
        return shtab.DIRECTORY
    if action.metavar in NO_FILES:
        return None
    return shtab.glob("*.toml") if action.metavar.endswith(".toml") else shtab.FILE


def _complete_choice(names, or_file):
    """Return the completion of names, and of TOML files if `or_file`."""
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
