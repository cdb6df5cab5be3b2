"""The package as it is installed, and moved."""

import os
import pathlib
import subprocess
import sys

from conftest import PROGRAM, SOURCE


def test_an_installed_package_reads_pictures_wherever_it_lies(tmp_path):
    build = pathlib.Path(PROGRAM).parent
    subprocess.run(["cmake", "--install", build, "--component", "python", "--prefix", tmp_path / "prefix"], check=True, capture_output=True)
    (tmp_path / "prefix").rename(tmp_path / "elsewhere")
    package = tmp_path / "elsewhere" / "lib" / "python3" / "dist-packages"
    config = SOURCE / "fit_configs" / "e12_droplet.yaml"
    words = f"import birefit; print(birefit.__file__); print(birefit.load({str(config)!r}).render().shape)"
    said = subprocess.run([sys.executable, "-c", words], env={**os.environ, "PYTHONPATH": str(package)}, capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    where, shape = said.stdout.splitlines()
    assert where.startswith(str(package)) and shape == "(256, 256)"
