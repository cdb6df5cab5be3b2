"""Fits: the program's bits, results, pickles, interruptions, and objectives for others' solvers."""

import os
import pickle
import signal
import threading

import numpy as np
import pytest

import birefit
from conftest import SOURCE, fit_of


@pytest.mark.parametrize("name", ["twisted_cell", "lc_5pch"])
def test_a_fit_is_the_program_s_to_the_bit(program, name):
    config = SOURCE / "fit_configs" / f"{name}.yaml"
    program("fit", config, "--out", "out", "--quiet")
    result = birefit.load(config).fit()
    found = result.to_dict()
    del found["run"]
    assert found == fit_of("out")
    report = result.report("again")
    assert os.path.exists(report)
    assert fit_of("again") == fit_of("out")
    of_program, of_python = (sorted(p.name for p in os.scandir(folder)) for folder in ("out", "again"))
    assert of_program == of_python


def test_an_array_is_fitted_as_its_file_is(program, droplet, photograph):
    from PIL import Image

    Image.fromarray(photograph).save("photograph.tif")
    droplet["micrograph"]["image"] = "photograph.tif"
    droplet["micrograph"]["roi_px"] = [3, 2, 38, 34]
    text = birefit.Job(droplet).text
    with open("droplet.yaml", "w") as file:
        file.write(text)
    program("fit", "droplet.yaml", "--out", "out", "--quiet")
    of_file = birefit.load("droplet.yaml").fit().to_dict()
    of_array = birefit.load("droplet.yaml", arrays={"photograph.tif": photograph}).fit()
    turned = np.asfortranarray(photograph)  # read where it lies, whatever the strides
    in_place = birefit.load("droplet.yaml").fit(turned)
    for fit in (of_array, in_place):
        assert fit.to_dict()["parameters"] == of_file["parameters"] == fit_of("out")["parameters"]
        assert fit.to_dict()["chi_square"] == of_file["chi_square"]
    assert of_array.to_dict()["micrographs"][0]["name"] == "photograph.tif"
    made_by = of_array.to_dict()["made_by"]["files"][1]
    import hashlib
    assert made_by == {"file": "photograph.tif", "sha256": hashlib.sha256(photograph.tobytes()).hexdigest()}


def test_a_file_of_numpy_is_fitted_as_its_array(droplet, photograph, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    in_place = birefit.Job(droplet).fit(photograph).to_dict()["parameters"]
    np.save("plain.npy", photograph)
    np.save("swapped.npy", photograph.astype(">u2"))
    np.save("by_columns.npy", np.asfortranarray(photograph))
    np.save("stack.npy", np.stack([photograph // 2, photograph, photograph // 3]))
    np.save("stack_by_columns.npy", np.asfortranarray(np.load("stack.npy")))
    del droplet["image_size_px"]
    for name in ("plain", "swapped", "by_columns", "stack", "stack_by_columns"):
        droplet["micrograph"]["image"] = f"{name}.npy"
        droplet["micrograph"].pop("page", None)
        if "stack" in name:
            with pytest.raises(birefit.Error, match="has 3 pictures"):
                birefit.Job(droplet).fit()
            droplet["micrograph"]["page"] = 1
        assert birefit.Job(droplet).fit().to_dict()["parameters"] == in_place, name


def test_a_result_has_values_errors_and_words(result, photograph):
    assert result.has_answer and result.grade == "answer"
    assert abs(result.values["birefringence"] - 0.152) < 5 * result.stderr["birefringence"]
    low, high = result.intervals["diameter_um"]
    assert low < result.values["diameter_um"] < high
    assert result.units["diameter_um"] == "um"
    assert result.covariance.shape == (len(result.names),) * 2
    assert np.isclose(np.sqrt(result.covariance[0, 0]), result.stderr[result.names[0]])
    assert np.allclose(np.diag(result.correlation), 1)
    assert result.samples.shape == (200, len(result.names))
    assert "birefringence" in str(result) and result.verdict
    assert result.fitted[0].shape == result.residual[0].shape == result.sigma[0].shape == photograph.shape
    assert np.allclose((result.fitted[0] + result.residual[0])[5:8, 5:8], photograph[5:8, 5:8])
    with pytest.raises(ValueError):
        result.fitted[0][0, 0] = 1  # what the report shows
    with pytest.raises(birefit.Error, match="no parameter"):
        result.values["thickness"]


def test_a_result_as_a_frame_and_a_figure(result):
    pandas = pytest.importorskip("pandas")
    frame = result.to_frame()
    assert list(frame.index) == result.names
    assert frame.loc["sample.material.birefringence", "value"] == result.values["birefringence"]
    assert isinstance(result.to_frame(["value", "stderr"]), pandas.DataFrame)
    pytest.importorskip("matplotlib")
    assert len(result.plot().axes) >= 3


def test_jobs_and_results_survive_pickling(droplet, photograph, result, tmp_path):
    job = birefit.Job(droplet, image=photograph, set={"sample.surround.index": 1.44})
    again = pickle.loads(pickle.dumps(job))
    assert again.text == job.text and again.values == job.values
    assert np.array_equal(again.render(), job.render())
    assert again.log_posterior(job.theta0) == job.log_posterior(job.theta0)
    copy = pickle.loads(pickle.dumps(result))
    assert copy.to_json() == result.to_json() and str(copy) == str(result)
    assert np.array_equal(copy.fitted[0], result.fitted[0]) and np.array_equal(copy.samples, result.samples)
    copy.report(tmp_path / "copy")
    result.report(tmp_path / "own")
    for file in os.scandir(tmp_path / "own"):
        assert (tmp_path / "copy" / file.name).read_bytes() == (tmp_path / "own" / file.name).read_bytes()
    with pytest.raises(birefit.Error, match="pickled"):
        copy.objective()
    error = pickle.loads(pickle.dumps(birefit.Error([("a", "b", "c")])))
    assert error.problems[0].hint == "c" and str(error) == "a: b; c"


def test_objectives_are_consistent(droplet, photograph):
    droplet["sample"]["material"]["birefringence"]["prior_sd"] = 0.01
    job = birefit.Job(droplet, image=photograph)
    theta = job.theta0
    lower, upper = job.bounds
    assert job.objective().names == job.names and np.all((lower <= theta) & (theta <= upper))
    residual, jacobian = job.residual(theta), job.jacobian(theta)
    assert residual.shape == (photograph.size + 1,) and jacobian.shape == (photograph.size + 1, theta.size)
    moved = theta + 1e-3 * np.array([0.1, 0.01, 1, 1, 10, 10])
    assert job.log_posterior(theta) == pytest.approx(-0.5 * residual @ residual, rel=1e-12)
    chi_square, prior = ((job.residual(t)[:-1] @ job.residual(t)[:-1], ((t[1] - 0.15) / 0.01) ** 2) for t in (theta, moved))
    fell = job.log_posterior(moved) - job.log_posterior(theta)
    assert fell == pytest.approx(-0.5 * (prior[0] + prior[1] - chi_square[0] - chi_square[1]), abs=1e-6)
    for j, step in enumerate([1e-4, 1e-5, 1e-4, 1e-4, 1e-2, 1e-2]):
        by = np.zeros(theta.size)
        by[j] = step
        difference = (job.residual(theta + by) - job.residual(theta - by)) / (2 * step)
        assert np.linalg.norm(jacobian[:, j] - difference) < 1e-3 * np.linalg.norm(difference), job.names[j]
    outside = theta.copy()
    outside[1] = 0.6
    assert job.log_posterior(outside) == -np.inf
    both = job.log_posterior(np.stack([theta, outside]))
    assert both.shape == (2,) and both[0] == job.log_posterior(theta)
    for wrong in (job.residual, job.log_posterior):
        with pytest.raises(ValueError):
            wrong(theta[:2])
    with pytest.raises(ValueError):
        job.residual(theta[None])


def test_another_solver_finds_what_the_fit_found(droplet, photograph):
    """Gauss-Newton by residual and jacobian, from beside the answer, where nothing is unknown but what is fitted."""

    def exact(value):
        return {"value": value, "exact": True}

    droplet["micrograph"]["pixel_size_um"] = exact(0.3)
    droplet["sample"]["material"]["ordinary"] = exact(1.52)
    droplet["sample"]["surround"]["index"] = exact(1.43)
    droplet["microscope"] = {"light": {"wavelength_nm": exact(590)}, "polarizer_deg": exact(0), "analyzer_deg": exact(90)}
    result = birefit.Job(droplet).fit(photograph)
    objective = result.objective()
    assert objective.names == result.names
    theta = objective.theta0
    answer = np.array([result.values[name] for name in objective.names])
    assert np.array_equal(theta, answer)
    stderr = np.array([result.stderr[name] for name in objective.names])
    theta = theta + 2 * stderr * np.array([1, -1, 1, -1, 1, -1])
    for _ in range(6):
        theta = theta - np.linalg.lstsq(objective.jacobian(theta), objective.residual(theta), rcond=None)[0]
    assert np.all(np.abs(theta - answer) < 0.01 * stderr)
    residual = objective.residual(answer)
    assert residual @ residual == pytest.approx(result.chi_square, rel=1e-9)


def test_progress_is_told_and_may_end_a_fit(droplet, photograph):
    job = birefit.Job(droplet)
    lines, threads = [], set()

    def note(line):
        lines.append(line)
        threads.add(threading.get_ident())

    job.fit(photograph, progress=note)
    assert lines and all(isinstance(line, str) for line in lines) and threads == {threading.get_ident()}

    def refuse(line):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        job.fit(photograph, progress=refuse)


def test_ctrl_c_ends_a_fit_with_the_best_so_far(droplet, photograph):
    job = birefit.Job(droplet)
    with pytest.raises(birefit.Interrupted) as stop:
        job.fit(photograph, progress=lambda line: os.kill(os.getpid(), signal.SIGINT))
    assert isinstance(stop.value, KeyboardInterrupt)
    result = stop.value.result
    assert result.interrupted and not result.has_answer
    assert "interrupted" in result.verdict.lower()


def test_a_fit_without_an_answer_is_a_result(droplet):
    noise = np.random.default_rng(1).normal(1000, 4, (36, 40))
    result = birefit.Job(droplet).fit(noise)
    assert not result.has_answer and result.grade != "answer" and result.verdict


def test_what_is_masked_is_left_out(droplet, photograph):
    """As NaN is, whatever lies below the mask."""
    mask = np.zeros(photograph.shape, bool)
    mask[:, :12] = True
    garbage, holes = photograph.copy(), photograph.astype(float)
    garbage[mask], holes[mask] = 3999, np.nan
    job = birefit.Job(droplet)
    masked, expected = job.fit(np.ma.masked_array(garbage, mask)), job.fit(holes)
    assert masked.values == expected.values
    # An array of the user's own may have any name.
    droplet["micrograph"] |= {"image": "photo", "mask": "image"}
    both = birefit.Job(droplet, arrays={"photo": photograph, "image": (~mask).astype(np.uint8)})
    assert both.fit().values == both.fit(photograph).values


def test_masked_counts_saturate_as_others_do(droplet):
    light = birefit.Job(droplet).render(birefringence=0.152)
    noise = np.random.default_rng(3).normal(0, 4, light.shape)
    counts = np.clip(np.rint(270 * light / light.max() + 8 + noise), 0, 255).astype(np.uint8)
    mask = np.zeros(counts.shape, bool)
    mask[0, 0] = True
    job = birefit.Job(droplet)
    masked = job.fit(np.ma.masked_array(counts, mask))
    droplet["micrograph"] |= {"image": "photo", "mask": "usable"}
    expected = birefit.Job(droplet, arrays={"photo": counts, "usable": (~mask).astype(np.uint8)}).fit()
    saturated = masked.to_dict()["pixels"]["saturated"]
    assert saturated == np.count_nonzero(counts == 255) > 0
    assert masked.values == expected.values


def test_names_are_found_by_their_endings_however_one_asks(result):
    values = result.values
    assert "birefringence" in values and "sample.material.birefringence" in values and "birefringenc" not in values
    assert values.get("birefringence") == values["birefringence"] and values.get("none", 3) == 3
    assert values.copy()["birefringence"] == values["birefringence"]
    with pytest.raises(birefit.Error, match="is no name"):
        values[3]


def test_quantities_at_a_kink_or_the_edge_of_what_is_defined(droplet, photograph, result):
    at = result.values["birefringence"]
    droplet["report"] = {"size": f"abs(birefringence - {at:.17g})", "edge": f"log(birefringence - {at - 1e-9:.17g})"}
    derived = {each["name"]: each for each in birefit.Job(droplet).fit(photograph).to_dict()["derived"]}
    low, high = derived["size"]["interval_95"]
    # No size is negative; of a normal distribution's, 97.5 % lie within 2.24 standard deviations.
    assert 0 <= low < high < 2.5 * result.stderr["birefringence"]
    # Half of what the picture allows has no logarithm.
    assert derived["edge"]["stderr"] is None


def test_what_follows_from_a_limit_is_not_known(droplet):
    """A thickness that the picture does not tell from 0 has no product with an error."""
    cell = {
        "micrograph": {"pixel_size_um": 0.5, "gain": 3000, "offset": 100},
        "sample": {
            "cell": {"thickness_um": {"value": 0.05, "fit": [0, 1]}, "director": {"uniform": {"azimuth_deg": 45}}},
            "material": {"ordinary": 1.5, "birefringence": 0.1},
            "surround": {"index": 1.5},
        },
        "microscope": {"light": {"wavelength_nm": 550}, "polarizer_deg": 0, "analyzer_deg": 90},
        "physics": {"ceiling": "e_only"},
        "report": {"retardance_nm": "sample.cell.thickness_um * sample.material.birefringence"},
    }
    for seed in range(4):
        dark = 100 + np.random.default_rng(seed).normal(0, 5, (24, 24))
        found = birefit.Job(cell).fit(dark).to_dict()
        if found["parameters"]["sample.cell.thickness_um"].get("limit"):
            derived = next(d for d in found["derived"] if d["name"] == "retardance_nm")
            assert derived["stderr"] is None and derived["interval_95"] == [None, None]
            break
    else:
        pytest.fail("no limit in four pictures of nothing")


def test_what_is_at_an_extremum_has_errors_all_the_same(droplet, photograph):
    """To first order a square is exact at 0; of a wavelength known to 0.3 % it is a chi-square of one degree of freedom."""
    droplet["report"] = {"square": "(microscope.light.wavelength_nm / nm - 590) ^ 2"}
    found = birefit.Job(droplet, image=photograph).fit().to_dict()["derived"][0]
    variance = (0.003 * 590) ** 2
    # 4000 draws know its quantiles at 68 and 97.5 % to 3 and 5 %.
    assert found["value"] == 0 and found["stderr"] == pytest.approx(variance, rel=0.12)
    assert found["interval_95"] == [0, pytest.approx(5.02 * variance, rel=0.2)]


def test_units_of_counts_do_not_matter_to_what_follows(droplet, photograph):
    """A camera that counts a million times as many has the same birefringence, and what follows from it."""
    droplet["report"] = {"same": "2 * sample.material.birefringence"}
    droplet["micrograph"]["noise"]["read_counts"] = 4e7
    result = birefit.Job(droplet, image=1e7 * photograph).fit()
    found = result.to_dict()["derived"][0]
    assert found["stderr"] == pytest.approx(2 * result.stderr["sample.material.birefringence"], rel=1e-3)
