"""What a polarized micrograph says about its sample: birefringence, size, twist, an applied field, a thermal state.

birefit models how light travels through a birefringent sample, fits that model to the pixels of a micrograph, and says
how well it knows what it found. This package is a door to it from Python; what it computes has the same bits as what
the program ``birefit`` computes.

A fit in ten lines
------------------
::

    import birefit

    job = birefit.load("droplet.yaml")           # a config, as `birefit new droplet` prints one
    image = job.render(birefringence=0.2)        # what the camera would see: (rows, columns), float64
    result = job.fit()                           # of the image that the config names, or job.fit(array)
    print(result)                                # values, errors, verdict
    result.values["birefringence"], result.stderr["birefringence"]
    result.report("out")                         # out/report.html, out/fit.json and the rest
    result.to_frame()                            # a pandas.DataFrame

Configs
-------
:func:`load` reads a YAML file, :class:`Job` takes the same tree as a dictionary. Where it names a picture (``image``,
``mask``, ``dark``, ..) or a director field (``file`` of ``sample.volume``) it may name an array of ``arrays`` instead::

    job = birefit.Job({"sample": {"volume": {"file": "n", "spacing_um": [0.1, 0.1, 0.1]}, ..}, ..}, arrays={"n": n})

=============================  =========================================================================================
an array that is               is
=============================  =========================================================================================
(rows, columns)                a picture, row 0 on top; uint8 and uint16 are counts that saturate at their top code
(rows, columns, channels)      a picture in three or four channels (r, g, b, alpha); the config's ``channel`` chooses
(z, y, x, 3), (.., 6)          a director field or tensor field, as ``numpy.save`` would write it
a dict of such, or bytes       the same as ``numpy.savez`` would write it, or the bytes of such a file
=============================  =========================================================================================

Names and units
---------------
Numbers are called as in configs (``sample.droplet.diameter_um``), and by any ending that no other has
(``diameter_um``). A name's unit is its ending: ``_um``, ``_nm``, ``_deg``, ``_px``, ``_v``, ``_k``; none is a pure
number. A picture's values are intensities behind the analyser over those behind the polarizer, from 0 to 1; a fit's are
in counts of the micrograph, or whatever the array had. Pixels are counted from 0 at the top left, their centres integers.
A vector ``theta`` has a number for each of ``job.names``, in their units: the free parameters, those that are searched
first, then gains and offsets.

Errors
------
Every mistake in a config, an image, a name or a number is a :class:`birefit.Error`, whose ``problems`` say where, what
and what to do about it; all that can be found at once are reported at once. A fit without an answer is no error: see
``result.has_answer`` and ``result.verdict``. Ctrl-C ends a fit with :class:`birefit.Interrupted`, which is a
KeyboardInterrupt and has the best ``result`` so far.

Threads
-------
The interpreter's lock is released while birefit computes. Pictures and fits take all cores unless ``threads`` says
otherwise, and have the same bits whatever it says. Jobs may be used from several threads at once. Signals reach a fit
that the main thread has called.
"""

from ._birefit import version as __version__
from ._errors import Error, Interrupted, Problem
from ._job import Job, Objective, load
from ._result import Named, Result

__all__ = ["Error", "Interrupted", "Job", "Named", "Objective", "Problem", "Result", "load"]

for _item in (Error, Interrupted, Job, Named, Objective, Problem, Result, load):
    _item.__module__ = __name__  # where people look for them, and where they are pickled from
del _item
