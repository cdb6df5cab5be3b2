"""The package under test, the program beside it, and small scenes. BIREFIT and BIREFIT_SOURCE_DIR come from ctest."""

import copy
import json
import os
import pathlib
import subprocess

import numpy as np
import pytest

import birefit

PROGRAM = os.environ["BIREFIT"]
SOURCE = pathlib.Path(os.environ["BIREFIT_SOURCE_DIR"])

DROPLET = {
    "image_size_px": [40, 36],
    "micrograph": {
        "pixel_size_um": 0.3,
        "center_px": [{"value": 19.7, "fit": [17, 22]}, {"value": 17.6, "fit": [15, 20]}],
        "gain": {"fit": "auto"},
        "offset": {"fit": "auto"},
        "noise": {"read_counts": 4.0},
    },
    "sample": {
        "droplet": {"diameter_um": {"value": 9.0, "fit": [8, 10.5]}, "director": {"radial": {}}},
        "material": {"ordinary": 1.52, "birefringence": {"value": 0.15, "fit": [0.05, 0.4]}},
        "surround": {"index": 1.43},
    },
    "microscope": {"light": {"wavelength_nm": 590}, "polarizer_deg": 0, "analyzer_deg": 90},
    "physics": {"ceiling": "one_way", "rays": "straight"},
}


@pytest.fixture
def droplet():
    """A config that may be changed."""
    return copy.deepcopy(DROPLET)


@pytest.fixture(scope="session")
def photograph():
    """Counts of a camera: the droplet at other values than the config's start, with noise."""
    light = birefit.Job(DROPLET).render(birefringence=0.152, diameter_um=9.05)
    noise = np.random.default_rng(7).normal(0, 4.0, light.shape)
    return np.clip(np.rint(900 * light + 100 + noise), 0, 4000).astype(np.uint16)


@pytest.fixture(scope="session")
def result(photograph):
    """A fit that others look at."""
    return birefit.Job(DROPLET, image=photograph).fit(samples=200)


@pytest.fixture
def program(tmp_path, monkeypatch):
    """Runs birefit in a folder of its own, where Python then is, too."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments, code=0):
        done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
        assert done.returncode == code, done.stderr
        return done

    return run


def fit_of(folder):
    """A fit.json without what differs from run to run."""
    fit = json.loads((pathlib.Path(folder) / "fit.json").read_text())
    del fit["run"]
    return fit
