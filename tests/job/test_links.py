"""Symbolic links in the folder of a job: none leads out of it, those within are followed."""

import os

import pytest
from job_builder import write_job

import tankcal
from tankcal.cli import main

SECRET = "keeper;x;0;0"


@pytest.mark.parametrize("name", ["points.csv", "courses.csv", "job.toml"])
def test_a_link_out_of_the_folder_is_refused(tmp_path, capsys, name):
    """And no line of its target is printed."""
    folder = write_job(tmp_path / "job")
    (tmp_path / "secret").write_text(f"{SECRET}\n")
    (folder / name).unlink()
    (folder / name).symlink_to(tmp_path / "secret")
    assert main(["run", str(folder)]) == 2
    assert "symbolic link" in capsys.readouterr().err
    assert not list(tmp_path.glob("**/record.json"))
    assert main(["notebook", str(folder), "--no-open"]) in (0, 2)
    assert "keeper" not in "".join(capsys.readouterr())


def test_a_loop_and_a_link_to_nowhere_are_told_in_a_line(tmp_path, capsys):
    folder = write_job(tmp_path / "job")
    for target in ("points.csv", "nowhere.csv"):
        (folder / "points.csv").unlink()
        (folder / "points.csv").symlink_to(folder / target)
        assert main(["run", str(folder), "--quiet"]) == 2
        assert "points.csv" in capsys.readouterr().err


def test_links_within_the_folder_and_to_the_folder_are_followed(tmp_path):
    folder = write_job(tmp_path / "job")
    (folder / "kept").mkdir()
    os.replace(folder / "points.csv", folder / "kept" / "points.csv")
    (folder / "points.csv").symlink_to("kept/points.csv")
    (tmp_path / "link").symlink_to(folder)
    assert tankcal.load(tmp_path / "link").points is not None
