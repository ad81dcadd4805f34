"""The registry of the products, and a product of another distribution."""

import argparse
import os
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from tankcal.cli import _parser, main
from tankcal.products.base import Product, find_module, products
from tankcal.record.saved_formats import SavedFormat
from tankcal.report.saved_document import SavedDocument
from tankcal.report.saved_documents import find_document

TOY = Path(__file__).with_name("toy")
LOCALES = {"en": "C.UTF-8", "pt-BR": "pt_BR.UTF-8", "es": "es_MX.UTF-8"}


def call(*arguments, language="en", folder=TOY):
    """Run the command line with a folder of distributions."""
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run(
        [sys.executable, "-m", "tankcal", *arguments],
        capture_output=True,
        encoding="utf-8",
        env=os.environ | {"PYTHONPATH": path, "LC_ALL": LOCALES[language], "PYTHONUTF8": "1"},
        cwd=Path(__file__).parents[2],
    )


@pytest.mark.parametrize("product", products(), ids=lambda product: product.name)
def test_a_product_is_complete(product):
    assert isinstance(product, Product)
    assert product.name
    for command, module in product.commands:
        assert find_module(command) == module
        assert callable(import_module(module).add)
    assert all(isinstance(document, SavedDocument) for document in product.documents())
    assert all(isinstance(saved[0], SavedFormat) for saved in product.saved_types())
    formats = [saved[0] for saved in product.saved_types()]
    assert all(document.saved_format in formats for document in product.documents())


def test_every_command_of_the_parser_is_of_one_product():
    commands = next(a for a in _parser()._actions if isinstance(a, argparse._SubParsersAction))
    listed = [command for product in products() for command, _ in product.commands]
    assert len(listed) == len(set(listed))
    assert list(commands.choices) == listed


def test_documents_are_found_by_their_files(tmp_path):
    files = [one.saved_format.file for product in products() for one in product.documents()]
    assert {"comparison.json", "inspection.json", "history.json"} <= set(files)
    assert len(files) == len(set(files))
    for file in files:
        (tmp_path / file).touch()
        document, path = find_document(tmp_path / file)
        assert document.saved_format.file == path.name == file


@pytest.mark.parametrize("command", ["run", "ticket", "lint"])
def test_a_command_loads_no_module_of_another_command(command):
    code = (
        "import re, sys; from tankcal.cli import main\n"
        f"try: main([{command!r}, '--help'])\n"
        "except SystemExit: pass\n"
        "loaded = {name for name in sys.modules\n"
        "          if re.match(r'tankcal\\.(cli\\.|products\\..*command$)', name)}\n"
        "print('loaded', *sorted(loaded))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    expected = {
        "run": "tankcal.cli.running",
        "ticket": "tankcal.products.quantity.command",
        "lint": "tankcal.products.linter.command",
    }
    assert done.stdout.splitlines()[-1] == f"loaded {expected[command]}"


@pytest.mark.slow
def test_help_and_dispatch_of_a_product_of_another_distribution():
    done = call("barrels", "1.58987294928")
    assert (done.returncode, done.stdout, done.stderr) == (0, "10.0000 bbl\n", "")
    assert call("barrels", "--unit", "gal", "-1").returncode == 4
    assert "convert a volume" in call("--help").stdout
    assert "did you mean 'barrels'?" in call("barels", "1").stderr
    assert "barrels" not in call("--help", folder=TOY.parent).stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("language", "line", "volume"),
    [
        ("pt-BR", "converter um volume", "volume em metros cúbicos"),
        ("es", "convertir un volumen", "volumen en metros cúbicos"),
    ],
)
def test_help_of_another_distribution_in_the_language(language, line, volume):
    assert line in call("--help", language=language).stdout
    done = call("barrels", "--help", language=language)
    assert done.returncode == 0
    assert volume in done.stdout
    assert "bbl or gal" in done.stdout  # without a translation the English text remains


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_of_another_distribution(shell):
    pytest.importorskip("shtab")
    done = call("completion", shell)
    assert done.returncode == 0, done.stderr
    assert "barrels" in done.stdout
    assert "bbl gal" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("toy_product:Missing", "AttributeError"),
        ("no_such_module:Barrels", "ModuleNotFoundError"),
        ("twice:Run", "tankcal already has the command run"),
    ],
)
def test_a_faulty_product_of_another_distribution_stops_no_other_command(tmp_path, entry, reason):
    folder = tmp_path / "installed"
    shutil.copytree(TOY, folder)
    (folder / "twice.py").write_text(
        "from tankcal.products.base import Product\n"
        "class Run(Product):\n    name = 'twice'\n    commands = (('run', 'twice'),)\n"
    )
    entries = folder / "toy_product.dist-info/entry_points.txt"
    entries.write_text(f"[tankcal.products]\nfaulty = {entry}\nbarrels = toy_product:Barrels\n")
    done = call("barrels", "1", folder=folder)
    assert done.returncode == 0
    assert "the product faulty of another package is not available" in done.stderr
    assert reason in done.stderr
    assert call("run", "--help", folder=folder).stderr == ""


def test_usage_errors_are_as_before(capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["run", "x", "--of"])
    assert stopped.value.code == 2
    assert "unrecognized arguments: --of" in capsys.readouterr().err
