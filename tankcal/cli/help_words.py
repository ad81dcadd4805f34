"""Help and usage errors of the command line in the current language.

The English text is in the definitions of the arguments. Translations are in the words of each
language under [help], by command and name of the argument.
"""

import argparse
from contextlib import contextmanager


def put_in_words(parser, words):
    """Replace the texts of a parser and of its commands by the texts of [help]."""
    known = words["help"]
    texts = known[_name(parser)]
    parser.description = texts.get("about", parser.description)
    parser.epilog = texts.get("ending", parser.epilog)
    for action in parser._actions:
        if isinstance(action.metavar, str):
            action.metavar = known["metavars"].get(action.metavar, action.metavar)
        if isinstance(action, argparse._SubParsersAction):
            _put_in_list(action, known)
            for command_parser in action.choices.values():
                put_in_words(command_parser, words)
        elif action.help is not None and action.dest != "help":
            action.help = texts.get(action.dest) or known["shared"][action.dest]


@contextmanager
def argparse_in(words):
    """Translate the messages of argparse within the block; {}: English."""
    translations = words.get("help", {}).get("argparse", {})
    before = argparse._, argparse.ngettext

    def translate(text):
        return translations.get(text, text)

    def counted(single, several, count):
        return translate(single if count == 1 else several)

    if translations:
        argparse._, argparse.ngettext = translate, counted
    try:
        yield
    finally:
        argparse._, argparse.ngettext = before


def _put_in_list(action, known):
    """Replace the one-line help of each command in a list."""
    names = {name: _name(command_parser) for name, command_parser in action.choices.items()}
    for line in action._choices_actions:
        line.help = known[names[line.dest]]["line"]


def _name(parser):
    """Return the command of a parser: "tankcal", "run", "camera read"."""
    return parser.prog.removeprefix("tankcal ")
