"""Pictures: the program's bits, derivatives, batches, arrays in place of files."""

import os
import signal
import threading
import time

import numpy as np
import pytest

import birefit
from conftest import SOURCE


@pytest.mark.parametrize("name", ["e12_droplet", "twisted_cell", "colour_droplet", "axial_droplet"])
def test_a_picture_has_the_bits_of_the_program_s(program, name):
    config = SOURCE / "fit_configs" / f"{name}.yaml"
    small = {"micrograph.image": "", "micrograph.center_px": [19.5, 17.5], "image_size_px": [40, 36], "micrograph.pixel_size_um": 0.3}
    if name == "twisted_cell":
        small = {"micrograph.image": "", "image_size_px": [40, 36]}
    items = [part for path, value in small.items() for part in ("--set", f"{path}={value}")]
    program("render", config, "--out", "picture.npy", "--quiet", *items)
    job = birefit.load(config, set={path: value if value != "" else None for path, value in small.items()})
    picture = job.render()
    assert picture.shape == job.shape
    assert picture.dtype == np.float64
    assert np.array_equal(picture, np.load("picture.npy"))


def test_derivatives_are_those_of_differences(droplet):
    job = birefit.Job(droplet)
    names = ["birefringence", "diameter_um", "center_px.x", "wavelength_nm"]
    picture, jacobian = job.render(derivatives=names)
    assert jacobian.shape == (36, 40, 4)
    assert np.allclose(picture, job.render(), rtol=0, atol=1e-12)  # in other scalars, to rounding
    for j, (name, step) in enumerate(zip(names, [1e-5, 1e-4, 1e-4, 1e-2])):
        value = job.values[name]
        more, less = (job.render({name: value + sign * step}) for sign in (1, -1))
        difference = (more - less) / (2 * step)
        # Pixels at the droplet's rim are means over points that stay while the rim moves: what both have is there.
        inner = np.hypot(*np.meshgrid(np.arange(40) - 19.7, np.arange(36) - 17.6)) < 0.85 * 15
        # A second derivative's difference, and the tables that planning anew makes otherwise (1e-6 of the intensity).
        assert np.abs(jacobian[inner, j] - difference[inner]).max() < 2e-3 * np.abs(difference).max()
    assert jacobian.flags.writeable and jacobian.strides[2] == 36 * 40 * 8  # a plane a parameter, seen otherwise
    empty = job.render(derivatives=[])
    assert empty[1].shape == (36, 40, 0)


def test_colours_come_as_channels(program):
    job = birefit.load(SOURCE / "fit_configs" / "colour_droplet.yaml",
                       set={"micrograph.image": None, "image_size_px": [14, 12], "micrograph.center_px": [6.5, 5.5], "micrograph.pixel_size_um": 1.0})
    picture, jacobian = job.render(derivatives=["birefringence", "diameter_um"])
    assert picture.shape == job.shape == (12, 14, 3)
    assert jacobian.shape == (12, 14, 3, 2)
    step = 1e-6
    value = job.values["birefringence"]
    difference = (job.render(birefringence=value + step) - picture) / step
    inner = (slice(4, 8), slice(5, 9))
    assert np.allclose(jacobian[inner][..., 0], difference[inner], rtol=0, atol=0.02 * np.abs(difference).max())


def test_a_batch_is_its_pictures(droplet):
    job = birefit.Job(droplet)
    values = np.linspace(0.1, 0.2, 5)
    batch = job.render_many({"birefringence": values, "diameter_um": 9.2})
    assert batch.shape == (5, 36, 40)
    for picture, value in zip(batch, values):
        assert np.array_equal(picture, job.render(birefringence=value, diameter_um=9.2))
    thetas = np.tile(job_start(job), (2, 1))
    assert np.array_equal(job.render_many(thetas)[1], job.render())
    assert np.array_equal(job.render_many({"birefringence": values}, threads=1), job.render_many({"birefringence": values}))
    with pytest.raises(birefit.Error, match="render_many, row 1: diameter_um = -1 is outside"):
        job.render_many({"diameter_um": [9.0, -1.0]})
    with pytest.raises(birefit.Error, match="shape"):
        job.render_many(np.zeros((2, 1)))


def job_start(job):
    return [job.values[name] for name in job.names]


def test_names_are_paths_or_unique_endings(droplet):
    job = birefit.Job(droplet)
    assert job.names[:2] == ["sample.droplet.diameter_um", "sample.material.birefringence"]
    assert set(job.names[-2:]) == {"micrograph.gain", "micrograph.offset"}
    assert np.array_equal(job.render(birefringence=0.2), job.render({"sample.material.birefringence": 0.2}))
    assert job.values["birefringence"] == 0.15 and job.units["diameter_um"] == "um"
    with pytest.raises(birefit.Error) as unknown:
        job.render(birefringense=0.2)
    assert unknown.value.problems[0].place == "render"
    assert unknown.value.problems[0].hint == "did you mean birefringence?"
    with pytest.raises(birefit.Error, match="gain may be micrographs\\[0\\].gain and") as several:
        birefit.Named({"micrographs[0].gain": 1, "micrographs[1].gain": 2})["gain"]
    assert several.value.problems[0].hint


def test_values_are_checked_as_in_a_config(droplet):
    job = birefit.Job(droplet)
    with pytest.raises(birefit.Error, match=r"diameter_um = -3.2 is outside \(0, 10000\]; did you mean 3.2\?"):
        job.render(diameter_um=-3.2)
    with pytest.raises(birefit.Error, match="no finite number"):
        job.render(diameter_um=float("nan"))


def test_a_tree_is_the_yaml_that_it_would_be(droplet, tmp_path):
    droplet["micrograph"]["gain"] = np.float64(1 / 3)
    droplet["micrograph"]["center_px"] = np.array([19.7, 17.6])
    job = birefit.Job(droplet)
    (tmp_path / "written.yaml").write_text(job.text)
    read = birefit.load(tmp_path / "written.yaml")
    assert read.values == job.values and read.values["gain"] == 1 / 3
    assert np.array_equal(read.render(), job.render())
    with pytest.raises(birefit.Error, match="sample is set"):
        birefit.Job({"sample": {1, 2}})


def test_a_field_from_an_array_is_the_field_of_a_file(tmp_path):
    z, y, x = np.mgrid[-1:1:9j, -1:1:9j, -1:1:9j]
    n = np.stack([np.cos(z), np.sin(z), 0 * z + 0.2], axis=-1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    tree = {
        "image_size_px": [16, 16],
        "micrograph": {"pixel_size_um": 0.1},
        "sample": {"volume": {"file": "field.npy", "spacing_um": [0.2, 0.2, 0.2]},
                   "material": {"ordinary": 1.5, "birefringence": 0.1}, "surround": {"index": 1.5}},
        "microscope": {"light": {"wavelength_nm": 550}, "polarizer_deg": 0, "analyzer_deg": 90},
    }
    np.save(tmp_path / "field.npy", n)
    of_file = birefit.Job(tree, name=str(tmp_path / "config.yaml")).render()
    assert of_file.max() > 0.01
    tree["sample"]["volume"]["file"] = "n"
    assert np.array_equal(birefit.Job(tree, arrays={"n": n}).render(), of_file)
    assert np.array_equal(birefit.Job(tree, arrays={"n": {"n": n}}).render(), of_file)
    with pytest.raises(birefit.Error, match="does not exist"):
        birefit.Job(tree)


def test_ten_thousand_pictures_take_no_memory(droplet):
    cell = {
        "image_size_px": [8, 8],
        "sample": {
            "cell": {"thickness_um": 5, "director": {"uniform": {"azimuth_deg": 30}}},
            "material": {"ordinary": 1.5, "birefringence": 0.1},
            "surround": {"index": 1.5},
        },
        "microscope": droplet["microscope"],
    }
    job, other = birefit.Job(cell), birefit.Job(droplet)

    def kilobytes():
        with open("/proc/self/smaps_rollup") as maps:
            return next(int(line.split()[1]) for line in maps if line.startswith("Anonymous:"))

    for i in range(10_000):
        picture = job.render(birefringence=0.1 + 1e-6 * (i // 5), threads=1)  # some planned anew, some not
        if i % 100 == 0:  # other ways in and out
            job.render_many({"birefringence": [0.1, 0.2]}, threads=1)
            other.render(derivatives=["birefringence", "diameter_um"], threads=1)
            with pytest.raises(birefit.Error):
                job.render(thickness_um=-1)
        if i == 100:
            before = kilobytes()
    assert picture.shape == (8, 8)
    assert kilobytes() - before < 1024


def test_others_run_while_pictures_are_made(droplet):
    droplet["image_size_px"] = [400, 360]
    droplet["micrograph"]["pixel_size_um"] = 0.03
    droplet["micrograph"]["center_px"] = [197, 176]
    droplet["sample"]["droplet"]["director"] = {"bipolar": {"azimuth_deg": 20}}
    job = birefit.Job(droplet)
    stop, longest, last = threading.Event(), 0.0, 0.0

    def look():
        nonlocal longest, last
        last = time.perf_counter()
        while not stop.is_set():
            now = time.perf_counter()
            longest, last = max(longest, now - last), now
            time.sleep(0.0005)

    other = threading.Thread(target=look)
    other.start()
    begin = time.perf_counter()
    job.render_many({"birefringence": np.linspace(0.1, 0.2, 12)})
    seconds = time.perf_counter() - begin
    stop.set()
    other.join()
    # A thread that waited for the whole batch would have found nothing in between.
    assert longest < 0.5 * seconds


def test_a_config_without_a_size_waits_for_its_picture(droplet, photograph):
    del droplet["image_size_px"]
    job = birefit.Job(droplet)
    with pytest.raises(birefit.Error, match="image_size_px"):
        job.render()
    assert "image_size_px" not in job.text
    assert birefit.Job(droplet, image=photograph).render().shape == photograph.shape


def test_explain_says_what_the_program_says(program):
    config = SOURCE / "fit_configs" / "twisted_cell.yaml"
    said = program("explain", config).stdout.splitlines()
    words = birefit.load(config).explain().splitlines()
    measured = ("Cost", "Time")  # of this moment
    assert [line for line in words if not line.startswith(measured)] == [line for line in said if not line.startswith(measured)]
    assert birefit.load(config).explanation()["method"]


def test_what_is_tied_follows(droplet):
    """Pictures, batches and derivatives are those of a config with the numbers written out."""
    droplet["microscope"]["analyzer_deg"] = "microscope.polarizer_deg + 90 * deg"
    job = birefit.Job(droplet)

    def turned(angle):
        return birefit.Job(droplet, set={"microscope.polarizer_deg": angle}).render()

    assert np.array_equal(job.render(polarizer_deg=30), turned(30))
    assert np.array_equal(job.render_many({"polarizer_deg": [0, 30]})[1], turned(30))
    _, jacobian = job.render(derivatives=["polarizer_deg"])
    difference = (turned(1e-3) - turned(-1e-3)) / 2e-3
    assert np.allclose(jacobian[..., 0], difference, rtol=0, atol=1e-3 * np.abs(difference).max())
    # One that is given is known, as by --set.
    apart = birefit.Job(droplet, set={"microscope.analyzer_deg": 100}).render()
    assert np.array_equal(job.render(analyzer_deg=100), apart)


def test_ctrl_c_ends_a_batch(droplet):
    droplet["image_size_px"] = [200, 200]
    job = birefit.Job(droplet)
    timer = threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        job.render_many({"birefringence": np.linspace(0.1, 0.2, 100_000)[:20_000]}, threads=1)
    assert time.monotonic() - begin < 30  # all of them take minutes
