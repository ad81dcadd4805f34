"""`Product`, the base of all commands, and the registry of the products.

A product owns its commands, saved formats, documents and help. The command line, `tankcal report`
and `tankcal verify` contain no list of products: they ask `products()`.

This module imports no package that computes, and the registry holds names only. A product imports
its modules within the function that needs them, so that a command loads only its own product.
"""

from functools import cache
from importlib import import_module

from tankcal.entry_points import find_entry_points

GROUP = "tankcal.products"  # entry points of products in other distributions
_BUILT_IN = (  # in the order of `tankcal --help`
    "tankcal.products.shipped:MainJob",
    "tankcal.products.batch:Batch",
    "tankcal.products.app:App",
    "tankcal.products.workbench:Workbench",
    "tankcal.products.fieldbooks:FieldBooks",
    "tankcal.products.shipped:Planning",
    "tankcal.products.linter:Linter",
    "tankcal.products.assess:Assessment",
    "tankcal.products.recalibration:FormerTables",
    "tankcal.products.register:Register",
    "tankcal.products.exports:Exports",
    "tankcal.products.inspection:Inspection",
    "tankcal.products.quantity:Quantity",
    "tankcal.products.gauge:Gauge",
    "tankcal.products.upkeep:Upkeep",
    "tankcal.products.shipped:Cameras",
    "tankcal.products.intercomparison:Intercomparison",
    "tankcal.products.shipped:Help",
)


class Product:
    """A product of the command line; a subclass overrides what differs from the default.

    Attributes
    ----------
    name : str
        Name of the product in messages.
    commands : tuple of (str, str)
        Commands and their modules. The function `add(commands)` of a module adds the parsers of
        all its commands to the subparsers of argparse, with English texts. The default `command`
        of a parser is a function of the parsed options, which returns the exit status or None.
    """

    name = ""
    commands = ()

    def completions(self):
        """Names that the Tab key offers: {(command, option): (names, whether a file is valid)}."""
        return {}

    def documents(self):
        """`report.saved_document.SavedDocument`s, for `tankcal report` and `tankcal verify`."""
        return ()

    def saved_types(self):
        """Formats of saved files: (SavedFormat, kind or None, dataclass), for their schemas."""
        return ()

    def help_words(self, language):
        """Help in a language, {command: texts} as in [help] of the words; {}: English.

        The texts of products of tankcal are in `report_templates/words/`. The key "metavars"
        contains the translated names of arguments.
        """
        return {}


@cache
def products():
    """Products of tankcal, then those of other distributions.

    Raises
    ------
    ImportError, AttributeError
        If a product of tankcal cannot be loaded. A product of another distribution that cannot be
        loaded, or whose command has the name of an earlier command, is in `refusals()`.
    """
    return tuple(map(_load, _BUILT_IN)) + _load_others()[0]


def refusals():
    """Reasons why products of other distributions are not available: {name: reason}."""
    return _load_others()[1]


def find_module(command):
    """Module with the parser of a command of tankcal; None for another command."""
    for path in _BUILT_IN:
        for name, module in _load(path).commands:
            if name == command:
                return module
    return None


@cache
def _load_others():
    """Products of other distributions, and {name: reason} of the rejected products."""
    accepted, rejected = [], {}
    taken = {command for path in _BUILT_IN for command, _ in _load(path).commands}
    for name, path in find_entry_points(GROUP).items():
        try:
            product = _load(path)
            for command, module in product.commands:
                if command in taken:
                    raise ValueError(f"tankcal already has the command {command}")
                import_module(module)
        except Exception as error:  # no fault of another distribution may stop tankcal
            rejected[name] = f"{type(error).__name__}: {error}"
        else:
            accepted.append(product)
            taken |= {command for command, _ in product.commands}
    return tuple(accepted), rejected


@cache
def _load(path):
    """Product from "module:class"."""
    module, _, name = path.partition(":")
    return getattr(import_module(module), name)()
