"""`tankcal docs`: the documentation pages shipped with the package."""

from tankcal.errors import InputError, Problem
from tankcal.messages import message


def add(commands):
    """Add the parser of `tankcal docs`."""
    parser = commands.add_parser(
        "docs",
        help="show the installed documentation",
        description="Print a page of the documentation as text (Markdown). Without a name, list "
        "the pages and their folder. The page docs/NAME.md has the name NAME.",
    )
    parser.add_argument(
        "page", metavar="NAME", nargs="?", help="name of a page, such as job-format"
    )
    parser.set_defaults(command=_docs)


def _docs(options):
    from tankcal.text.shipped import page_names, shipped_folder

    names, folder = page_names(), shipped_folder("docs")
    if options.page is None:
        for name in names:
            print(f"{name:28} {_title(folder / f'{name}.md')}".rstrip())
        print(folder)
        return
    name = options.page.removeprefix("docs/").removesuffix(".md")
    if name not in names:
        from tankcal.job.tables import nearest

        text = message(
            "page_unknown",
            "no such page{hint}; expected a page that tankcal docs lists",
            hint=nearest(name, names),
        )
        raise InputError(Problem(options.page[:60], text))
    print((folder / f"{name}.md").read_text(encoding="utf-8"), end="")


def _title(path):
    """Return the first heading of a page without its mark."""
    with path.open(encoding="utf-8") as lines:
        return next((line[2:].strip() for line in lines if line.startswith("# ")), "")
