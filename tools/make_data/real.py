#!/usr/bin/env python3
"""Makes the crops of data/real from the files as tools/fetch_real leaves them (python3-pil):

    tools/fetch_real && python3 tools/make_data/real.py out/real

Pixels are copied, never resampled; a JPEG's are those that libjpeg decodes.
"""
import pathlib
import shutil
import sys

from PIL import Image

FULL = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "out/real")
HERE = pathlib.Path(__file__).resolve().parents[2] / "data" / "real"


def crop(name, box, target=None):
    """The pixels [x0, x1) x [y0, y1) of FULL/name."""
    image = Image.open(FULL / name).crop(box)
    image.info = {}
    path = HERE / (target or name)
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save(path, "PNG", optimize=True)


def copy(name):
    path = HERE / name
    path.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(FULL / name, path)
    path.chmod(0o644)


# Ten pixels beside what the configs fit; the medians of 5 x 5 pixels that find dead ones need two.
for volts in range(100, 1001, 100):
    crop(f"pockels_czt/led_data/Bias_-{volts:04d}V.png", (60, 68, 440, 152))
for frame in ("cross_on", "parallel_off", "parallel_on"):
    crop(f"pockels_czt/led_data/calib_{frame}.png", (60, 68, 440, 152))
    crop(f"pockels_czt/run_2025-01-16_b/calib_{frame}.png", (50, 205, 610, 320))
crop("pockels_czt/run_2025-01-16_b/bias_700V_xray_0mA.png", (50, 205, 610, 320))

# A strip left of the disc's centre, and as much again above and below.
for number in (8, 10, 11, 13, 14):
    name = f"photoelastic_disk/single_disk/DSC_{number:04d}"
    crop(name + ".jpg", (750, 1090, 960, 1310), name + ".png")

# Whole: a converging cone is measured in halves of the picture's side.
copy("conoscopy_linbo3/conoscopic_figure_633nm.png")

for name in (
    "480nm_sweep_with_outliers",
    "490nm_sweep_slow",
    "492nm_sweep",
    "514nm_sweep",
    "530nm_sweep",
    "565nm_sweep",
    "617nm_sweep",
):
    copy(f"lc_retarder_voltage/{name}.csv")
for entry in ("5CB/Wu-25.1C", "5CB/Wu-34.8C", "5PCH/Wu-25.0C", "5PCH/Wu-34.8C", "5PCH/Wu-53.4C", "E7/Li", "E44/Li", "TL-216/Li", "MLC-6608/Li"):
    for ray in "oe":
        copy(f"refractive_index/other/liquid_crystals/{entry}-{ray}.yml")
