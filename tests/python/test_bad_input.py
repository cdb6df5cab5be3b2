"""What the program refuses, Python refuses in the same words: every case of tests/cli/bad_input.sh, and some of arrays."""

import os
import pathlib
import stat
import subprocess

import numpy as np
import pytest

import birefit
from conftest import PROGRAM, SOURCE

RECORDER = """#!/bin/bash
# Keeps the folder as it is, and what birefit says of it. Behind the fits come series and commands: the script, whose
# child `timeout` calls this, ends there.
[ "$*" = 'fit bad.yaml --out out' ] || {{ read -r _ _ _ script _ < /proc/$PPID/stat; kill "$script"; exit 2; }}
kept=$(mktemp -d "{kept}/XXXXXX")
cp -a . "$kept/folder"
"{program}" "$@" 2> "$kept/stderr"
code=$?
cat "$kept/stderr" >&2
exit $code
"""


@pytest.fixture(scope="module")
def refused(tmp_path_factory):
    """Folders with a bad.yaml that `birefit fit bad.yaml` refuses, and what it says."""
    kept = tmp_path_factory.mktemp("kept")
    recorder = kept / "birefit"
    recorder.write_text(RECORDER.format(program=PROGRAM, kept=kept))
    recorder.chmod(recorder.stat().st_mode | stat.S_IXUSR)
    done = subprocess.run(["bash", SOURCE / "tests" / "cli" / "bad_input.sh", recorder, SOURCE], capture_output=True, text=True)
    assert "FAIL" not in done.stdout, done.stdout
    return [(case / "folder", (case / "stderr").read_text()) for case in kept.iterdir() if case.is_dir()]


def test_every_bad_input_of_the_program_raises_the_same(refused, monkeypatch):
    assert len(refused) > 60
    for folder, said in refused:
        monkeypatch.chdir(folder)
        with pytest.raises(birefit.Error) as error:
            birefit.load("bad.yaml").fit()
        assert str(error.value) + "\n" == said
        for problem in error.value.problems:
            # Limits of a machine and of a method have no place in a file.
            assert problem.cause and problem.place.startswith(problem.file)
        assert any(problem.place for problem in error.value.problems), said


@pytest.mark.parametrize("image, words", [
    (np.zeros(5), "has 1 dimensions"),
    (np.zeros((4, 4, 2, 2)), "has 4 dimensions"),
    (np.zeros((0, 4)), "without pixels"),
    (np.zeros((36, 40, 3)), "colour channels"),
    (np.full((36, 40), np.nan), "no usable pixel"),
    (np.full((36, 40), "a"), "no real numbers"),
    (np.zeros((36, 40), complex), "no real numbers"),
    (np.full((36, 40), 255, np.uint8), "saturated"),
    (np.zeros((17000, 1), np.uint8), "17000"),
    (np.zeros((30, 30)), "differs from the size"),
    ("none.tif", "does not exist"),
])
def test_images_that_are_none(droplet, image, words):
    with pytest.raises(birefit.Error, match=words):
        birefit.Job(droplet).fit(image)


@pytest.mark.parametrize("tree", [{}, {"sample": None}, {"sample": {"droplet": []}}, {3: 4}, {"image_size_px": [1, object()]}])
def test_trees_that_are_no_configs(tree):
    with pytest.raises(birefit.Error) as error:
        birefit.Job(tree)
    assert error.value.problems[0].place


def test_all_mistakes_at_once_and_their_lines(droplet):
    droplet["microscope"]["light"]["wavelength_nm"] = -590
    droplet["sample"]["surround"]["index"] = 143
    with pytest.raises(birefit.Error) as error:
        birefit.Job(droplet)
    first, second = error.value.problems
    assert "index = 143" in first.cause and "did you mean 590?" in second.hint
    assert first.file == "config" and 0 < first.line < second.line


def test_set_names_what_it_sets(droplet):
    with pytest.raises(birefit.Error) as error:
        birefit.Job(droplet, set={"sample.droplet.diameter_um": -1})
    assert error.value.problems[0].place == "--set sample.droplet.diameter_um=-1"


def test_reports_that_cannot_be_written(result, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(birefit.Error, match="folder"):
        result.report(tmp_path / "file")


def test_the_manual_names_what_there_is():
    import inspect

    manual = birefit.__doc__
    for word in ("render", "fit", "problems", "arrays", "theta", "threads"):
        assert word in manual
    for name in birefit.__all__:
        item = getattr(birefit, name)
        assert inspect.getdoc(item), name
        for attribute, value in vars(item).items():
            if not attribute.startswith("_") and (callable(value) or isinstance(value, property)):
                assert inspect.getdoc(value), f"{name}.{attribute}"
    package = pathlib.Path(birefit.__file__).parent
    assert (package / "py.typed").exists() and (package / "_birefit.pyi").exists()
