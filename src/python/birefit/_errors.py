"""What goes wrong, as exceptions."""

from __future__ import annotations

from typing import Any, NamedTuple, Sequence


class Problem(NamedTuple):
    """One mistake in what birefit was given."""

    place: str  #: "droplet.yaml:14:7", "render", or "" where no place is known
    cause: str  #: what is wrong there
    hint: str  #: what to do about it; may be empty
    file: str = ""  #: the place's parts: the file, or what else was given
    line: int = 0  #: from 1; 0 = unknown
    column: int = 0  #: from 1; 0 = unknown

    def __str__(self) -> str:
        return (self.place + ": " if self.place else "") + self.cause + ("; " + self.hint if self.hint else "")


class Error(ValueError):
    """Every mistake in a config, an image, a name or a number that birefit was given, all of them at once.

    ``problems`` is a tuple of :class:`Problem` (``place``, ``cause``, ``hint``); ``str(error)`` is a line for each.
    """

    problems: tuple[Problem, ...]

    def __init__(self, problems: Sequence[Sequence[Any]]) -> None:
        self.problems = tuple(Problem(*problem) for problem in problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.problems,)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a fit. ``result`` is the best that was found so far, a :class:`birefit.Result` whose ``interrupted``
    is True. Like any KeyboardInterrupt it ends a script that does not ask for it::

        try:
            result = job.fit(image)
        except birefit.Interrupted as stop:
            result = stop.result
    """

    def __init__(self, result: Any) -> None:
        super().__init__("the fit was interrupted")
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.result,)
