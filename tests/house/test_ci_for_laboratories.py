"""The workflow of docs/ci-for-laboratories.md, its own commands run on two jobs."""

import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from job_builder import write_job

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "ci-for-laboratories.md").read_text(encoding="utf-8")
WORKFLOW = re.search(r"```yaml\n(.*?)```", PAGE, re.DOTALL)[1]
STEP = re.compile(r"^ +- name: (.*)\n +run: (?:\|\n((?: {10}.*\n)+)|(.+))", re.MULTILINE)


def commands():
    """{name of a step: its commands}; the steps that only name an action have none."""
    steps = {}
    for name, block, line in STEP.findall(WORKFLOW):
        steps[name] = textwrap.dedent(block) or line
    return steps


def run(beginning, folder):
    """The commands of a step as the service runs them: bash that stops at the first failure."""
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    return subprocess.run(
        ["bash", "-eo", "pipefail", "-c", named(beginning)],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
    )


def named(beginning):
    """The commands of the step whose name begins so."""
    (found,) = (text for name, text in commands().items() if name.startswith(beginning))
    return found


def test_workflow_installs_what_the_page_names():
    assert named("install") == "pip install -c constraints.txt wheels/tankcal-*.whl"
    assert "wheels/tankcal-*.whl" in PAGE.split("```yaml")[0]


@pytest.mark.study
@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_steps_of_the_workflow_run(tmp_path):
    """Of one job, its name with a space; that each job has its turn is the next test's."""
    write_job(tmp_path / "jobs" / "TK 108", settings={"table.step_m": 0.5})
    for beginning in ("compute", "papers", "the notebook"):
        done = run(beginning, tmp_path)
        assert done.returncode == 0, done.stderr
    paper = tmp_path / "results" / "TK 108" / "certificate.pdf"
    assert paper.read_bytes()[:5] == b"%PDF-"
    page = tmp_path / "es" / "TK 108" / "report.html"
    assert 'lang="es"' in page.read_text(encoding="utf-8")


@pytest.mark.study
@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_mistake_fails_its_step_only(tmp_path):
    write_job(tmp_path / "jobs" / "A", settings={"table.step_m": "ten"})
    write_job(tmp_path / "jobs" / "B", settings={"table.step_m": 0.5})
    done = run("compute", tmp_path)
    assert done.returncode == 2
    assert "table.step_m: found the text 'ten'" in done.stderr
    assert not (tmp_path / "results" / "A").exists()
    assert (tmp_path / "results" / "B" / "capacity.xlsx").exists()
