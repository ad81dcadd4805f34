"""The help of the command line, and its usage errors, in the language that is spoken.

The English stands where the arguments are made; the other languages have theirs in their words
under [help], by the command and the name of the argument.
"""

import argparse
from contextlib import contextmanager


def put_in_words(parser, words):
    """Give a parser and those of its commands the texts of [help]."""
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
    """Within it argparse itself says what it says in these words; {}: in English."""
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
    """The line of each command in the list of them."""
    names = {name: _name(command_parser) for name, command_parser in action.choices.items()}
    for line in action._choices_actions:
        line.help = known[names[line.dest]]["line"]


def _name(parser):
    """The command of a parser: "tankcal", "run", "camera read"."""
    return parser.prog.removeprefix("tankcal ")
