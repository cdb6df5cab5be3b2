"""What callers give, as the extension module takes it, or a birefit.Error that names it."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Mapping
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from ._errors import Error


def refuse(place: str, cause: str, hint: str = "") -> NoReturn:
    raise Error([(place, cause, hint, place)])


def count(place: str, name: str, value: Any, hint: str) -> int:
    """A whole number that is not negative."""
    try:
        number = operator.index(value)
    except TypeError:
        refuse(place, f"{name} is {value!r}", hint)
    if not 0 <= number < 2**31:
        refuse(place, f"{name} is {number}", hint)
    return number


def names(place: str, what: str, value: Any) -> list[str]:
    """Names, or one."""
    if isinstance(value, str):
        return [value]
    found = list(value) if isinstance(value, Iterable) and not isinstance(value, (bytes, Mapping)) else [value]
    if not all(isinstance(name, str) for name in found):
        refuse(place, f"{what} is {value!r}", "give names of numbers, or the name of one")
    return [str(name) for name in found]


def mapping(place: str, what: str, value: Any, hint: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping) or not all(isinstance(name, str) for name in value):
        refuse(place, f"{what} is {value!r}", hint)
    return value


def threads_of(place: str, value: Any) -> int:
    return count(place, "threads", value, "0 for all cores, or a whole number")


def reals(place: str, value: Any, shapes: str) -> npt.NDArray[np.float64]:
    """Numbers of a parameter vector; complex ones would lose half of themselves in silence."""
    hint = f"give real numbers, {shapes}"
    if np.ma.is_masked(value):
        refuse(place, "some of the numbers are masked", hint)
    try:
        array = np.asarray(value)
    except ValueError:  # rows of several lengths
        refuse(place, "the numbers are no array", hint)
    if array.dtype.kind not in "biuf" and not (array.dtype.kind == "O" and all(_is_real(item) for item in array.flat)):
        refuse(place, f"the numbers are {array.dtype}", hint)
    return array.astype(float)


def real(place: str, name: str, value: Any) -> float:
    if not _is_real(value):
        refuse(place, f"{name} is {value!r}", "give a real number in the unit of the name")
    return float(value)


def _is_real(value: Any) -> bool:
    """Text of digits is none, whatever float() makes of it, nor is a complex number."""
    if isinstance(value, (str, bytes, complex, np.complexfloating)):
        return False
    try:
        float(value)
    except (TypeError, ValueError, OverflowError):
        return False
    return True
