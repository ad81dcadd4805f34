"""Measures of the structure of the package: `make check` runs this.

    python tests/house/structure_counts.py           fails where a measure is above its limit
    python tests/house/structure_counts.py --lower   writes smaller measures as the new limits
    python tests/house/structure_counts.py --list    the modules behind each measure

Size has no limit, because features need lines; it is printed for comparison. All measures come
from syntax trees.
"""

import argparse
import ast
import re
import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from prose_counts import ROOT, compare_with_limits
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

LIMITS = Path(__file__).with_suffix(".toml")
CORE = ("adjust", "sections", "quadrature", "uncertainty")
COMMENTED = ("geometry", "survey", "solver")  # packages with algebra to explain
METHODS = (
    "hits|tangents|clouds|strapping|straps|lines|rings|great_circles|circles|radii|liquid|ship|"
    "mesh|points|measurements|stadia"
)
# `if job.straps`, `kind == "mesh"`, `"liquid" in surveys`: a question that the method answers.
# Not counted: `job.points.unbound`, a value of known readings; `survey.points`, of a network.
BRANCH = re.compile(
    rf"\b(?:job|raw|record|result|design|values|tables)\.({METHODS})\b(?!\.)"
    rf"|\bsurvey\.(?!points)({METHODS})\b(?!\.)"
    r"|\b(?:kind|surveyed_as) (?:[=!]=|in|not in) [^=]*?"
    rf"'({METHODS}|hit|tangent|cloud|strap|line|ring)'"
    rf"|'({METHODS})' (?:not )?in\b"
)
OWN_PARTS = {"mesh": {"mesh", "ship"}, "strapping": {"strapping", "straps"}}  # others: the name


def asks_for_method(test, module, class_name=""):
    """Whether a condition asks for a method or kind; a method may ask for its own readings."""
    package = re.match(r"tankcal\.methods\.(\w+)", module)
    own = OWN_PARTS.get(package[1], {package[1]}) if package else set()
    text = re.sub(r"\bself\b", class_name.lower() or "self", test)
    return any({*groups} - {"", *own} for groups in BRANCH.findall(text))


@dataclass
class Module:
    """A module of the package: its syntax tree, lines, imports of other modules and measures."""

    name: str
    tree: ast.Module
    lines: int
    comments: int
    imports: set = field(default_factory=set)
    functions: int = 0
    branches: int = 0
    lines_called_once: int = 0

    @property
    def is_package(self):
        """Whether it is the `__init__` of a package."""
        return self.name.endswith(".__init__")


def read_module(path, root):
    """Read a module and measure all but its imports."""
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    name = ".".join(path.relative_to(root.parent).with_suffix("").parts)
    module = Module(
        name, ast.parse(text), len(lines), sum(line.lstrip().startswith("#") for line in lines)
    )
    used, class_of = Counter(), {}
    for node in ast.walk(module.tree):
        if isinstance(node, ast.ClassDef):
            class_of |= dict.fromkeys(ast.walk(node), node.name)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            module.functions += 1
        elif isinstance(node, ast.Name | ast.Attribute):
            used[node.id if isinstance(node, ast.Name) else node.attr] += 1
        elif isinstance(node, ast.If | ast.IfExp | ast.While):
            module.branches += asks_for_method(ast.unparse(node.test), name, class_of.get(node, ""))
    for node in module.tree.body:
        is_private = isinstance(node, ast.FunctionDef) and re.match("_[^_]", node.name)
        if is_private and used[node.name] == 1:
            module.lines_called_once += node.end_lineno - node.lineno + 1
    return module


def link_modules(modules):
    """Fill the imports of modules, {name: Module}; imports for type checkers alone do not count."""
    for module in modules.values():
        for_types = {
            node
            for test in ast.walk(module.tree)
            if isinstance(test, ast.If) and "TYPE_CHECKING" in ast.unparse(test.test)
            for node in ast.walk(test)
        }
        for node in ast.walk(module.tree):
            if node in for_types:
                continue
            if isinstance(node, ast.Import):
                wanted = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.module:
                wanted = [f"{node.module}.{alias.name}" for alias in node.names]
            elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("Delegate", "Import"):
                wanted = [node.args[0].value.replace(":", ".")]  # a hook of a method
            else:
                continue
            for target in wanted:  # a module, a package, or a name in one of the two
                parent = target.rpartition(".")[0]
                candidates = (target, f"{target}.__init__", parent, f"{parent}.__init__")
                known = next((name for name in candidates if name in modules), None)
                module.imports |= {known} - {None, module.name}


def read_package(root):
    """Modules of a package folder with their imports, {name: Module}."""
    modules = {m.name: m for m in (read_module(path, root) for path in sorted(root.rglob("*.py")))}
    link_modules(modules)
    return modules


def list_cycles(modules):
    """Sets of modules that import one another in a circle."""
    number = {name: i for i, name in enumerate(modules)}
    edges = [(number[name], number[to]) for name, m in modules.items() for to in m.imports]
    rows, columns = np.array(edges, int).reshape(-1, 2).T
    graph = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(modules), len(modules)))
    labels = connected_components(graph, connection="strong")[1]
    groups = defaultdict(list)
    for name, label in zip(modules, labels, strict=True):
        groups[label].append(name)
    return [group for group in groups.values() if len(group) > 1]


def list_single_importers(modules):
    """(lines, module, its only importer) of each module that a single other imports, by lines."""
    importers = defaultdict(list)
    for name, module in modules.items():
        for imported in module.imports:
            importers[imported].append(name)
    return sorted(
        (module.lines, name, importers[name][0])
        for name, module in modules.items()
        if len(importers[name]) == 1 and not module.is_package
    )


def share_with_parameters(modules):
    """Percentage of the public functions of the core whose docstrings list the parameters."""
    docs = [
        ast.get_docstring(node) or ""
        for name in CORE
        if (module := modules.get(f"tankcal.{name}"))
        for node in module.tree.body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
    ]
    return 100 * sum("Parameters\n" in doc for doc in docs) / max(len(docs), 1)


def measure(modules):
    """({measure with a limit: value}, {measure of size or of care: value}) of modules."""
    lines = sum(m.lines for m in modules.values())
    commented = [m for m in modules.values() if m.name.split(".")[1] in COMMENTED]
    limited = {
        "modules in import cycles": sum(map(len, list_cycles(modules))),
        "branches on a method or kind": sum(m.branches for m in modules.values()),
        "modules in pipeline": sum(
            m.name.startswith("tankcal.pipeline.") for m in modules.values()
        ),
        "lines in private functions called once, %": round(
            100 * sum(m.lines_called_once for m in modules.values()) / lines, 1
        ),
        "functions per 1000 lines": round(
            1000 * sum(m.functions for m in modules.values()) / lines, 1
        ),
    }
    free = {
        "modules": len(modules),
        "lines": lines,
        "modules with a single importer": len(list_single_importers(modules)),
        f"comments per 1000 lines of {', '.join(COMMENTED)}": round(
            1000 * sum(m.comments for m in commented) / max(sum(m.lines for m in commented), 1)
        ),
        "public functions of the core with their parameters, %": round(
            share_with_parameters(modules)
        ),
    }
    return limited, free


def main(arguments=None):
    """Print the measures and compare them with the limits; exit status 1 above a limit."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--lower", action="store_true", help="write smaller measures as limits")
    parser.add_argument("--list", action="store_true", help="list the modules behind each measure")
    options = parser.parse_args(arguments)
    modules = read_package(ROOT / "tankcal")
    limited, free = measure(modules)
    for name, value in (limited | free).items():
        print(f"{value:>9}  {name}")
    if options.list:
        for group in list_cycles(modules):
            print("cycle:", *group)
        for lines, name, importer in list_single_importers(modules):
            print(f"single importer: {lines:4d}  {name}  in {importer} ({modules[importer].lines})")
        for name in ("branches", "lines_called_once"):
            for module in sorted(modules.values(), key=lambda m: -getattr(m, name))[:25]:
                print(f"{name}: {getattr(module, name):4d}  {module.name}")
    return compare_with_limits(limited, LIMITS, options.lower, "change the structure")


if __name__ == "__main__":
    sys.exit(main())
