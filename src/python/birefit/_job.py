"""Configs, pictures of them, and fits."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Union

import numpy as np
import numpy.typing as npt

from . import _birefit
from ._errors import Interrupted
from ._given import count, mapping, names as names_of, real, reals, refuse, threads_of
from ._result import Named, Objective, Result

Array = npt.NDArray[np.float64]
Picture = Union[None, str, "os.PathLike[str]", npt.ArrayLike]
Settings = Union[None, Mapping[str, Any], Sequence[str]]


def load(
    path: str | os.PathLike[str],
    *,
    image: Picture = None,
    set: Settings = None,
    arrays: Mapping[str, Any] | None = None,
) -> Job:
    """The job that a config file describes.

    path
        of the YAML file (docs/configuration.md); files that it names are looked for beside it.
    image
        an array or a file in place of ``micrograph.image``; see :meth:`Job.fit`.
    set
        other values, as of ``--set``: ``{"sample.droplet.diameter_um": 9.3}``, or ``["path=value", ..]``.
    arrays
        what the config names and is no file: see :class:`Job`.

    Raises birefit.Error for whatever is wrong with the config. Pictures are read when a fit needs them, and what is
    wrong with them is said then.
    """
    try:
        name = os.fsdecode(path)
    except TypeError:
        refuse("load", f"path is {path!r}", "give the name of a YAML file; Job takes a dictionary or text")
    return Job(_birefit.read_text(os.fsencode(name)), image=image, set=set, arrays=arrays, name=name)


class Job:
    """What is in front of the camera, what of it is known, and what is to be fitted.

    tree
        a config: a dictionary, nested like the YAML, or the text of one.
    arrays
        pictures and fields by the names that the config gives where it would name files; pictures are read where they
        lie, without a copy.
    image
        an array or a file in place of ``micrograph.image``.
    set
        other values, as of ``--set``.
    name
        what messages and results call the config; its folder is where files are looked for.

    Jobs can be pickled, with their arrays. Files that they name are read again where they are unpickled.
    """

    def __init__(
        self,
        tree: Mapping[str, Any] | str | bytes,
        *,
        arrays: Mapping[str, Any] | None = None,
        image: Picture = None,
        set: Settings = None,
        name: str = "config",
    ) -> None:
        text = _text(tree)
        images, fields = _held({} if arrays is None else arrays)
        self._state = (text, name, _items(set), images, fields, _in_place(image))
        self._job = _birefit.Job(text, os.fsencode(name), *self._state[2:])
        self._objective: Objective | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return _job_again, (type(self), *self._state)

    def __repr__(self) -> str:
        return f"birefit.Job({self._state[1]!r}: fits {', '.join(self._job.free_names) or 'nothing'})"

    # What it is ------------------------------------------------------------------------------------------------------

    @property
    def text(self) -> str:
        """The config as YAML: the lines that errors name are this text's where the job was made of a dictionary."""
        return self._job.text

    @property
    def warnings(self) -> list[str]:
        """Sentences: what reading the config gave cause for, and what nobody stated and is taken for granted."""
        return self._job.warnings

    @property
    def names(self) -> list[str]:
        """The free parameters, as results have them: those that are searched, then gains and offsets."""
        return self._job.free_names

    @property
    def values(self) -> Named:
        """Every number of the config, fitted or not: its value, where a fit starts and what :meth:`render` uses."""
        return Named((name, value) for name, unit, value, free in self._job.parameters)

    @property
    def units(self) -> Named:
        """The unit of every number: "um", "deg", "px", .., or "" for pure numbers."""
        return Named((name, unit) for name, unit, value, free in self._job.parameters)

    @property
    def shape(self) -> tuple[int, ...]:
        """(rows, columns) of what :meth:`render` returns, or (rows, columns, channels)."""
        rows, columns, colours = self._job.shape
        return (rows, columns) if colours == 1 else (rows, columns, colours)

    # Pictures --------------------------------------------------------------------------------------------------------

    def render(
        self,
        values: Mapping[str, float] | None = None,
        *,
        derivatives: Iterable[str] | None = None,
        threads: int = 0,
        **more: float,
    ) -> Any:
        """The picture at the config's values, changed by ``values`` and by keywords: ``job.render(diameter_um=9.3)``.

        values
            numbers by name, in their units; a fit's ``result.values`` will do (what the config states stays as stated,
            where a fit may have moved it: ``result.fitted`` is the fit's own picture). Keywords count above them.
        derivatives
            names of numbers (fitted or not), or the name of one, by which to differentiate as well.
        threads
            0 = all cores.

        Returns float64 intensities, 0 to 1, every pixel the mean over its area: (rows, columns), or (rows, columns,
        channels) of a colour camera. With ``derivatives``: (picture, jacobian), the jacobian (rows, columns,
        parameters) or (rows, columns, channels, parameters), in intensity per unit of each parameter. What is planned
        for the picture follows the values, as of ``birefit render``; equal values give equal bits, with derivatives equal
        numbers to rounding.
        """
        known = mapping("render", "values", {} if values is None else values, "give numbers by name: {'birefringence': 0.2}")
        given, above = ([(name, real("render", name, value)) for name, value in of.items()] for of in (known, more))
        active = [] if derivatives is None else names_of("render", "derivatives", derivatives)
        picture, jacobian = self._job.render(given, above, active, threads_of("render", threads))
        if derivatives is None:
            return picture
        return picture, np.empty((*picture.shape, 0)) if jacobian is None else jacobian

    def render_many(
        self, thetas: npt.ArrayLike | Mapping[str, npt.ArrayLike], *, names: Sequence[str] | None = None, threads: int = 0
    ) -> Array:
        """Many pictures at once, on all cores.

        thetas
            (pictures, parameters), a row a picture, its columns those of ``names`` (default: ``job.names``); or columns
            by name, ``{"birefringence": np.linspace(0.1, 0.2, 50)}``, of one length or single numbers.

        Returns (pictures, rows, columns) or (pictures, rows, columns, channels), each picture as :meth:`render` has it.
        """
        if isinstance(thetas, Mapping):
            names = list(thetas)
            each = [np.atleast_1d(reals("render_many", c, "one a picture")) for c in thetas.values()]
            if any(column.ndim > 1 for column in each) or len({column.size for column in each} - {1}) > 1:
                refuse("render_many", "the columns have several lengths", "one number a picture in each, or a single number")
            thetas = np.stack(np.broadcast_arrays(*each), axis=1) if each else np.empty((1, 0))
        columns = self.names if names is None else names_of("render_many", "names", names)
        rows = reals("render_many", thetas, "(pictures, parameters)")
        return self._job.render_many(columns, rows, threads_of("render_many", threads))

    # Fits ------------------------------------------------------------------------------------------------------------

    def fit(
        self,
        image: Picture = None,
        *,
        progress: Callable[[str], Any] | None = None,
        threads: int = 0,
        samples: int = 0,
    ) -> Result:
        """Estimates the free parameters, as ``birefit fit`` does, to the bit.

        image
            what is fitted, in place of the image that the config names: an array (rows, columns) or (rows, columns,
            channels), or a file. uint8 and uint16 are counts of a camera, which saturate at their top code; other types
            are values as they are. Start values marked ``auto`` come from it.
        progress
            called with a line of text now and then, in the thread that called; what it raises ends the fit.
        threads
            0 = all cores, or as many as the config says.
        samples
            so many draws from the posterior, for ``result.samples``.

        Raises birefit.Error for images that cannot be read or fitted, and birefit.Interrupted on Ctrl-C, with what was
        found so far. A fit without an answer is a result that says why.
        """
        if progress is not None and not callable(progress):
            refuse("fit", f"progress is {progress!r}", "give a function of one line of text, as print")
        draws = count("fit", "samples", samples, "0 for none, or how many to draw")
        fitted = self._job.fit(_in_place(image), progress, threads_of("fit", threads), draws)
        if isinstance(fitted, tuple):
            raise Interrupted(Result(fitted[0]))
        return Result(fitted)

    # For solvers and samplers of one's own ---------------------------------------------------------------------------

    def objective(self, *, threads: int = 0) -> Objective:
        """What a fit of the config's image makes small, by the weights that a fit begins with; see :class:`Objective`.
        It is made once, and read the image then; ``threads`` other than 0 makes another."""
        if threads_of("objective", threads) != 0:
            return Objective(self._job.objective(threads))
        if self._objective is None:
            self._objective = Objective(self._job.objective(0))
        return self._objective

    def residual(self, theta: npt.ArrayLike) -> Array:
        """:meth:`Objective.residual` of :meth:`objective`: (rows,), for scipy.optimize.least_squares and lmfit."""
        return self.objective().residual(theta)

    def jacobian(self, theta: npt.ArrayLike) -> Array:
        """:meth:`Objective.jacobian` of :meth:`objective`: (rows, parameters)."""
        return self.objective().jacobian(theta)

    def log_posterior(self, theta: npt.ArrayLike) -> Any:
        """:meth:`Objective.log_posterior` of :meth:`objective`: one number, or one a row, for emcee."""
        return self.objective().log_posterior(theta)

    @property
    def theta0(self) -> Array:
        """(parameters,): where a fit begins, gains and offsets at their best there, in the order of ``names``."""
        return self.objective().theta0

    @property
    def bounds(self) -> tuple[Array, Array]:
        """(lower, upper), (parameters,) each, as scipy.optimize takes them."""
        return self.objective().bounds

    # Words -----------------------------------------------------------------------------------------------------------

    def explain(self, next: str = "") -> str:
        """Which model and method would run, why, what it costs and errs, and what the image can tell: the lines of
        ``birefit explain``. ``next``: the parameter for which the next image is to be proposed."""
        return self._job.explain(_next(next), False)

    def explanation(self, next: str = "") -> dict[str, Any]:
        """The same as a dictionary: method, physics, reasons, numerical_error, cost_seconds, parameters, .."""
        return json.loads(self._job.explain(_next(next), True))


def _job_again(cls: type[Job], text: str | bytes, name: str, set: list[str], images: Any, fields: Any, image: Any) -> Job:
    return cls(text, arrays={**images, **fields}, image=image, set=set, name=name)


def _next(name: Any) -> str:
    if not isinstance(name, str):
        refuse("explain", f"next is {name!r}", "give the name of a fitted parameter")
    return name


def _text(tree: Any) -> str | bytes:
    if isinstance(tree, str):
        try:
            return tree.encode()
        except UnicodeEncodeError:
            refuse("config", "has text that is no Unicode", "give UTF-8")
    if isinstance(tree, bytes):
        return tree
    if not isinstance(tree, Mapping):
        refuse("config", f"the tree is {type(tree).__name__}", "give a dictionary, nested like the YAML, or the text of one")
    return _birefit.text_of_tree(dict(tree))


def _items(set: Settings) -> list[str]:
    """Items of ``--set``."""
    if set is None:
        return []
    if isinstance(set, Mapping):
        return [f"{path}={_value(value)}" for path, value in set.items()]
    items = list(set) if isinstance(set, Iterable) and not isinstance(set, (str, bytes)) else []
    if not isinstance(set, Iterable) or isinstance(set, (str, bytes)) or not all(isinstance(item, str) for item in items):
        refuse("set", f"is {set!r}", "a dict of paths and values, or a list of 'path=value'")
    return items


def _value(value: Any) -> str:
    """A value as YAML in a line, which JSON is."""
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if isinstance(value, os.PathLike):
        return os.fspath(value)

    def plain(other: Any) -> Any:
        if isinstance(other, os.PathLike):
            return os.fspath(other)
        if hasattr(other, "tolist"):
            return other.tolist()
        refuse("set", f"has the value {other!r}", "numbers, text, lists and dicts can be set")

    return json.dumps(value, ensure_ascii=False, default=plain)


def _in_place(image: Picture) -> Any:
    if image is None or isinstance(image, (bytes, np.ndarray)):  # bytes: the name of a file
        return image
    if isinstance(image, (str, os.PathLike)):
        return os.fsencode(image)
    return np.asarray(image)


def _held(arrays: Mapping[str, Any]) -> tuple[dict[str, np.ndarray], dict[str, bytes]]:
    """Pictures, and fields as the files that NumPy would write of them."""
    images: dict[str, np.ndarray] = {}
    fields: dict[str, bytes] = {}
    for name, value in mapping("arrays", "arrays", arrays, "give arrays by the names that the config has").items():
        if isinstance(value, (bytes, bytearray, memoryview)):
            fields[name] = bytes(value)
            continue
        file = io.BytesIO()
        if isinstance(value, Mapping):
            np.savez(file, **value)
        else:
            array = value if isinstance(value, np.ma.MaskedArray) else np.asarray(value)
            if array.dtype.hasobject:
                refuse(f"array '{name}'", "has elements that are no numbers", "a picture or a field has integers or floats")
            if array.ndim < 4:
                images[name] = array
                continue
            if np.ma.is_masked(array):  # a place without a director
                array = array.astype(float).filled(np.nan)
            np.save(file, np.asarray(array), allow_pickle=False)
        fields[name] = file.getvalue()
    return images, fields
