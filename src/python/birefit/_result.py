"""What fits come to."""

from __future__ import annotations

import json
import os
from typing import Any, Sequence

import numpy as np
import numpy.typing as npt

from . import _birefit
from ._errors import Error
from ._given import reals, refuse, threads_of

Array = npt.NDArray[np.float64]


class Named(dict):
    """Something of every parameter, by the names that configs have; any ending that no other has will do::

        result.values["sample.material.birefringence"] == result.values["birefringence"]
    """

    def __missing__(self, name: str) -> Any:
        if not isinstance(name, str):
            refuse("names", f"{name!r} is no name", "names are text, as in the config")
        return self[_birefit.path_named(list(self), name, "name")]

    def __contains__(self, name: object) -> bool:
        if super().__contains__(name) or not isinstance(name, str):
            return super().__contains__(name)
        try:
            return bool(_birefit.path_named(list(self), name, "name"))
        except Error:
            return False

    def get(self, name: str, default: Any = None) -> Any:
        return self[name] if name in self else default

    def copy(self) -> Named:
        return Named(self)


class Objective:
    """What a fit makes small, as a function of all free parameters: for scipy.optimize, lmfit, emcee and their like.

    ``theta`` is (parameters,), in the order and units of ``names``: searched parameters first, then gains and offsets,
    which birefit's own fit solves exactly and others search like the rest. Plans and weights stay what they are: those
    a fit begins with (``job.objective()``), or those that one ended with (``result.objective()``). Priors of the config
    are rows like those of pixels. What nobody knows exactly, departures of the picture from the model, and the
    enlargement of errors by what is left over are birefit's own and not in here. ::

        o = result.objective()
        scipy.optimize.least_squares(o.residual, o.theta0, jac=o.jacobian, bounds=o.bounds)
        emcee.EnsembleSampler(walkers, len(o.names), o.log_posterior, vectorize=True)
    """

    def __init__(self, objective: Any) -> None:
        self._objective = objective

    @property
    def names(self) -> list[str]:
        """Config paths of the parameters."""
        return self._objective.names

    @property
    def theta0(self) -> Array:
        """(parameters,): where the fit begins, or ended."""
        return self._objective.start

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(lower, upper), each (parameters,); infinite where there are none."""
        return self._objective.lower, self._objective.upper

    def residual(self, theta: npt.ArrayLike) -> Array:
        """(rows,): (model - value) / standard deviation of every pixel that is used, picture after picture, row by row,
        then (parameter - mean) / sd of every prior. Its sum of squares is chi-square with the priors."""
        return self._objective.residual(self._theta(theta, 1))

    def jacobian(self, theta: npt.ArrayLike) -> Array:
        """(rows, parameters): the derivatives of :meth:`residual`, per unit of each parameter."""
        return self._objective.jacobian(self._theta(theta, 1))

    def log_posterior(self, theta: npt.ArrayLike) -> Any:
        """-(sum of squares of :meth:`residual`) / 2, the logarithm of the posterior density but for a constant;
        -infinity outside of the bounds. theta (points, parameters) gives (points,), as emcee's ``vectorize`` asks."""
        return self._objective.log_posterior(self._theta(theta, 2))

    def _theta(self, theta: npt.ArrayLike, most: int) -> Array:
        shapes = "(parameters,)" if most == 1 else "(parameters,) or (points, parameters)"
        numbers = reals("theta", theta, shapes)
        if not 1 <= numbers.ndim <= most or numbers.shape[-1] != len(self.names):
            refuse("theta", f"has the shape {numbers.shape}", f"{shapes}, a number for each of {', '.join(self.names)}")
        return numbers


class Result:
    """What a fit found, how well it knows it, and whether it is an answer at all.

    Numbers are by name (:class:`Named`), in the units of the names; ``to_dict()`` is the whole fit.json, whose keys
    docs/fit_json.md explains. ``print(result)`` is the summary of ``birefit fit``. Results can be pickled, with their
    pictures and the report; only :meth:`objective` does not survive that.
    """

    def __init__(self, fitted: Any) -> None:
        self._fitted = fitted
        self._files: dict[str, bytes] | None = None
        self._set(fitted.json, fitted.summary, fitted.has_answer, fitted.fitted, fitted.residual, fitted.sigma, fitted.samples)

    def _set(self, text: str, summary: str, answer: bool, *arrays: Any) -> None:
        self._json, self._summary, self._answer = text, summary, answer
        self._all: dict[str, Any] = json.loads(text)
        fitted, residual, sigma, self._samples = arrays
        self._pictures = tuple(fitted), tuple(residual), tuple(sigma)

    def __getstate__(self) -> tuple[Any, ...]:
        return (self._json, self._summary, self._answer, *self._pictures, self._samples, self._report_files())

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        self._fitted = None
        self._set(*state[:-1])
        self._files = state[-1]

    def __repr__(self) -> str:
        return self._summary

    # Numbers ---------------------------------------------------------------------------------------------------------

    @property
    def names(self) -> list[str]:
        """Of the free parameters: searched, then gains and offsets; the order of :attr:`covariance`."""
        return list(self._all["covariance"]["names"])

    @property
    def values(self) -> Named:
        """Estimates, each in the unit of its name."""
        return self._of_parameters(lambda p: _number(p["value"]))

    @property
    def stderr(self) -> Named:
        """Standard errors; NaN where the image does not determine the parameter."""
        return self._of_parameters(lambda p: _number(p["stderr"]))

    @property
    def intervals(self) -> Named:
        """95 % intervals, (low, high)."""
        return self._of_parameters(lambda p: tuple(_number(end) for end in p["interval_95"]))

    @property
    def units(self) -> Named:
        """"um", "deg", "px", .., "" for pure numbers."""
        return self._of_parameters(lambda p: p["unit"])

    @property
    def covariance(self) -> Array:
        """(parameters, parameters), in the order of :attr:`names` and the parameters' own units."""
        return _matrix(self._all["covariance"])

    @property
    def correlation(self) -> Array:
        """The same over the standard errors, -1 to 1."""
        return _matrix(self._all["correlation"])

    @property
    def chi_square(self) -> float:
        """Of pixels and priors, by the noise that the fit used."""
        return _number(self._all["chi_square"])

    @property
    def reduced_chi_square(self) -> float:
        """The same over the degrees of freedom."""
        return _number(self._all["reduced_chi_square"])

    @property
    def samples(self) -> Array | None:
        """(draws, parameters) from the posterior, in the order of :attr:`names`, where ``fit(samples=..)`` asked."""
        return self._samples

    # Words -----------------------------------------------------------------------------------------------------------

    @property
    def has_answer(self) -> bool:
        """Whether the values may be used at all: what gives ``birefit fit`` its exit code 0."""
        return self._answer

    @property
    def grade(self) -> str:
        """"answer", "answer with misfit", or why there is none: "ambiguous", "not identifiable", .."""
        return self._all["grade"]

    @property
    def verdict(self) -> str:
        """What the fit says of itself, a paragraph."""
        return self._all["verdict"]

    @property
    def warnings(self) -> list[str]:
        """Sentences; empty when there is nothing to warn of."""
        return list(self._all["warnings"])

    @property
    def interrupted(self) -> bool:
        """It was ended early; its values are the best so far and no answer."""
        return self._all["interrupted"]

    # Pictures --------------------------------------------------------------------------------------------------------

    @property
    def fitted(self) -> tuple[Array, ...]:
        """The model, (rows, columns) of each picture in units of its values; of a table, (1, 1) of each row."""
        return self._pictures[0]

    @property
    def residual(self) -> tuple[Array, ...]:
        """Values less model, (rows, columns) of each; NaN where a pixel is not used."""
        return self._pictures[1]

    @property
    def sigma(self) -> tuple[Array, ...]:
        """The standard deviations that were used, (rows, columns) of each."""
        return self._pictures[2]

    def plot(self, picture: int = 0) -> Any:
        """A matplotlib figure: measured, fitted, and residual over noise; of a table, its rows. Needs matplotlib."""
        from matplotlib.figure import Figure

        tables = all(image.size <= 1 for image in self.fitted)
        if tables:
            return self._plot_rows(Figure(figsize=(7, 3.2), layout="constrained"))
        fitted, residual, sigma = (which[picture] for which in self._pictures)
        figure = Figure(figsize=(10, 3.2), layout="constrained")
        axes = figure.subplots(1, 3)
        low, high = np.nanmin(fitted + np.nan_to_num(residual)), np.nanmax(fitted + np.nan_to_num(residual))
        for axis, image, title in zip(axes, (fitted + residual, fitted), ("measured", "fitted")):
            shown = axis.imshow(image, cmap="gray", vmin=low, vmax=high, interpolation="nearest")
            axis.set_title(title)
            figure.colorbar(shown, ax=axis, shrink=0.8)
        with np.errstate(divide="ignore", invalid="ignore"):
            whitened = residual / sigma
        most = float(np.nanpercentile(np.abs(whitened), 99.5)) or 1.0
        shown = axes[2].imshow(whitened, cmap="RdBu_r", vmin=-most, vmax=most, interpolation="nearest")
        axes[2].set_title("residual / noise")
        figure.colorbar(shown, ax=axes[2], shrink=0.8)
        for axis in axes:
            axis.set_xlabel("x (px)")
        axes[0].set_ylabel("y (px)")
        return figure

    def _plot_rows(self, figure: Any) -> Any:
        fitted = np.array([image.ravel()[0] if image.size else np.nan for image in self.fitted])
        residual = np.array([image.ravel()[0] if image.size else np.nan for image in self.residual])
        axis = figure.subplots()
        axis.plot(fitted + residual, ".", label="measured")
        axis.plot(fitted, "-", label="fitted")
        axis.set_xlabel("row of the table")
        axis.legend()
        return figure

    # Files -----------------------------------------------------------------------------------------------------------

    def report(self, folder: str | os.PathLike[str], *, npy: bool = False) -> str:
        """Writes what ``birefit fit --out`` writes: report.html, fit.json, config.yaml, log.txt, fitted and residual
        pictures (.tif; with ``npy`` also .npy). Returns the path of the report."""
        where = os.fspath(folder)
        if npy and self._fitted is None:
            refuse("report", "a result that was pickled has its pictures as .tif alone", "numpy.save(.., result.fitted[0])")
        _birefit.write_files(os.fsencode(where), self._fitted.files([".tif", ".npy"]) if npy else self._report_files())
        return os.path.join(where, "report.html")

    def _report_files(self) -> dict[str, bytes]:
        if self._files is None:
            self._files = self._fitted.files([".tif"])
        return self._files

    def to_dict(self) -> dict[str, Any]:
        """The fit.json of ``birefit fit`` (docs/fit_json.md) as a dictionary, to the bit."""
        return json.loads(self._json)

    def to_json(self) -> str:
        """The same as text."""
        return self._json

    def to_frame(self, columns: Sequence[str] | None = None) -> Any:
        """A pandas.DataFrame, a row a parameter: value, stderr, low, high, unit, start, prior_value, prior_sd,
        at_bound, limit, interval_kind; or of these ``columns``. Needs pandas."""
        import pandas

        rows = {
            name: {
                "value": _number(p["value"]),
                "stderr": _number(p["stderr"]),
                "low": _number(p["interval_95"][0]),
                "high": _number(p["interval_95"][1]),
                "unit": p["unit"],
                "start": _number(p["start"]),
                "prior_value": _number((p["prior"] or {}).get("value")),
                "prior_sd": _number((p["prior"] or {}).get("sd")),
                "at_bound": p["at_bound"],
                "limit": (p["limit"] or {}).get("side", ""),
                "interval_kind": p["interval_kind"],
            }
            for name, p in self._all["parameters"].items()
        }
        frame = pandas.DataFrame.from_dict(rows, orient="index")
        frame.index.name = "parameter"
        return frame if columns is None else frame[list(columns)]

    def objective(self, *, threads: int = 0) -> Objective:
        """What the fit made small, by the plans, pixels and noise that it ended with; see :class:`Objective`."""
        if self._fitted is None:
            refuse("objective", "a result that was pickled has none", "use job.objective(), or fit again")
        return Objective(self._fitted.objective(threads_of("objective", threads)))

    def _of_parameters(self, what: Any) -> Named:
        return Named((name, what(p)) for name, p in self._all["parameters"].items())


def _number(value: Any) -> float:
    """JSON has no NaN: null."""
    return float("nan") if value is None else float(value)


def _matrix(of: dict[str, Any]) -> Array:
    return np.array([[_number(value) for value in row] for row in of["matrix"]], dtype=float).reshape(
        len(of["names"]), len(of["names"])
    )
