"""What the program refuses, Python refuses at the same places: every case of tests/cli/bad_input.sh, and some of arrays."""

import os
import pathlib
import stat
import subprocess
import threading

import numpy as np
import pytest

import birefit
from conftest import SOURCE

IN_PLACE_OF_THE_PROGRAM = """#!/bin/bash
# `birefit fit bad.yaml` by the package: asks the test for what it has to say. Behind the fits come series and commands:
# the script, whose child `timeout` calls this, ends there.
[ "$*" = 'fit bad.yaml --out out' ] || {{ read -r _ _ _ script _ < /proc/$PPID/stat; kill "$script"; exit 2; }}
pwd > "{pipes}/ask"
words=$(cat "{pipes}/answer")
printf '%s\n' "$words" >&2
[ "$words" = fitted ] || exit 2
"""


def test_every_bad_input_of_the_program_raises_at_its_place(tmp_path):
    """The cases and expectations are those of tests/cli/bad_input.sh: a line that begins with the place, and its words."""
    for pipe in ("ask", "answer"):
        os.mkfifo(tmp_path / pipe)
    program = tmp_path / "birefit"
    program.write_text(IN_PLACE_OF_THE_PROGRAM.format(pipes=tmp_path))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    here, asked = os.getcwd(), 0

    def answer():
        nonlocal asked
        while folder := (tmp_path / "ask").read_text().strip():
            os.chdir(folder)
            asked += 1
            try:
                birefit.load("bad.yaml").fit()
                words = "fitted"
            except birefit.Error as error:
                sound = all(problem.cause and problem.place.startswith(problem.file) for problem in error.problems)
                words = str(error) if sound else "no causes and places"
            except BaseException as error:  # whatever it is, the script refuses it
                words = repr(error)
            os.chdir(here)
            (tmp_path / "answer").write_text(words)

    answering = threading.Thread(target=answer)
    answering.start()
    script = SOURCE / "tests" / "cli" / "bad_input.sh"
    done = subprocess.run(["bash", script, program, SOURCE], capture_output=True, text=True, timeout=200)
    (tmp_path / "ask").write_text("\n")
    answering.join()
    assert "FAIL" not in done.stdout, done.stdout
    assert asked > 60


@pytest.mark.parametrize("image, words", [
    (np.zeros(5), "has 1 dimensions"),
    (np.zeros((4, 4, 2, 2)), "has 4 dimensions"),
    (np.zeros((0, 4)), "without pixels"),
    (np.zeros((36, 40, 3)), "colour channels"),
    (np.full((36, 40), np.nan), "no usable pixel"),
    (np.random.default_rng(1).normal(1e200, 1e198, (36, 40)), "whose squares no number holds"),
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


@pytest.mark.parametrize("call, words", [
    (lambda job: job.render(birefringence=0.1 + 0j), "birefringence is"),
    (lambda job: job.render(birefringence="0.1"), "birefringence is"),
    (lambda job: job.render({"birefringence": 0.1, "sample.material.birefringence": 0.2}), "one number"),
    (lambda job: job.render(derivatives=["birefringence", "birefringence"]), "one number"),
    (lambda job: job.render(threads=-1), "threads is -1"),
    (lambda job: job.render(threads="2"), "threads is '2'"),
    (lambda job: job.render_many([[0.1, 0.2]], names=["birefringence", "material.birefringence"]), "one number"),
    (lambda job: job.render_many([[0.1], [0.2, 0.3]], names=["birefringence"]), "no array"),
    (lambda job: job.render_many({"birefringence": [0.1, 0.2], "diameter_um": [9, 9, 9]}), "several lengths"),
    (lambda job: job.render_many([["0.1"]], names=["birefringence"]), "numbers are"),
    (lambda job: job.fit(samples=-1), "samples is -1"),
    (lambda job: job.fit(threads=1.5), "threads is 1.5"),
    (lambda job: job.residual(job.theta0[:-1]), "a number for each of"),
    (lambda job: job.residual(job.theta0 + 0j), "complex"),
    (lambda job: job.residual(np.ma.masked_array(job.theta0, [True] + [False] * (len(job.theta0) - 1))), "masked"),
    (lambda job: job.log_posterior(np.zeros((2, 2, 2))), "has the shape"),
    (lambda job: job.render(0.2), "values is 0.2"),
    (lambda job: job.render(derivatives=3), "derivatives is 3"),
    (lambda job: job.render(derivatives=[3]), r"derivatives is \[3\]"),
    (lambda job: job.render_many([[0.1]], names=[3]), r"names is \[3\]"),
    (lambda job: job.fit(progress=3), "progress is 3"),
    (lambda job: job.explain(3), "next is 3"),
    (lambda job: birefit.load(None), "path is None"),
])
def test_numbers_that_are_none(droplet, call, words):
    job = birefit.Job(droplet)
    job = birefit.Job(droplet, image=job.render() * 1000)
    with pytest.raises(birefit.Error, match=words):
        call(job)


@pytest.mark.parametrize("tree", [None, 5, ["sample"], "sample: \ud800", {"sample": "\ud800"}])
def test_what_is_no_tree(tree):
    with pytest.raises(birefit.Error):
        birefit.Job(tree)


@pytest.mark.parametrize("set", [3, "sample.droplet.diameter_um=4.5", [3], {"sample.droplet.diameter_um": 3 + 0j}])
def test_what_cannot_be_set(droplet, set):
    with pytest.raises(birefit.Error, match="set"):
        birefit.Job(droplet, set=set)


@pytest.mark.parametrize("arrays", [3, ["a"], {3: np.zeros((4, 4))}])
def test_what_are_no_arrays(droplet, arrays):
    with pytest.raises(birefit.Error, match="arrays is"):
        birefit.Job(droplet, arrays=arrays)


def test_keywords_count_above_values(droplet):
    job = birefit.Job(droplet)
    whole = dict(job.values)
    assert np.array_equal(job.render(whole, diameter_um=8.7), job.render(diameter_um=8.7))


def test_one_name_is_a_name(droplet):
    job = birefit.Job(droplet)
    _, one = job.render(derivatives="birefringence")
    _, listed = job.render(derivatives=["birefringence"])
    assert np.array_equal(one, listed)
    assert np.array_equal(job.render_many([[0.1]], names="birefringence"), job.render_many({"birefringence": 0.1}))


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


def test_names_of_files_that_are_no_text(tmp_path):
    with pytest.raises(birefit.Error) as caught:
        birefit.load(os.fsencode(tmp_path) + b"/no\xff.yaml")
    assert caught.value.problems[0].file.endswith(".yaml")
    job = birefit.load(SOURCE / "fit_configs" / "e12_droplet.yaml", set={"micrograph.image": pathlib.Path("e12.tif")})
    assert "e12.tif" in job.text


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
