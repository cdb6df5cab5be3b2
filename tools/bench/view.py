#!/usr/bin/python3
"""How fast the page of `birefit view` answers in Chromium: pictures a second while a slider is dragged, and how long one takes from
the hand to the screen.   tools/bench/view.py [BIREFIT] [--size N] [--seconds S] [--screenshots FOLDER]

The picture is that of `birefit new droplet --demo` by rays, N x N pixels of the same field of view (512 by default)."""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile

root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(root, "tests", "support"))
from browser import Browser, program  # noqa: E402

options = argparse.ArgumentParser()
options.add_argument("birefit", nargs="?", default=os.path.join(root, "build/release/birefit"))
options.add_argument("--size", type=int, default=512)
options.add_argument("--seconds", type=float, default=5)
options.add_argument("--screenshots")
arguments = options.parse_args()
if not program():
    sys.exit("there is no chromium (apt-get install chromium)")

CONFIG = """micrograph:
  image: droplet.tif
  pixel_size_um: {pixel}
sample:
  droplet:
    diameter_um: {{value: {diameter}, fit: [8.5, 10.0]}}   # a slider
    director: {{radial: {{}}}}
  material:
    ordinary: 1.52
    birefringence: {{value: {birefringence}, fit: [0.1, 0.3]}}
  surround: {{index: 1.43}}
microscope:
  light: {{wavelength_nm: 590}}
  polarizer_deg: 0
  analyzer_deg: 90
"""

# A drag as a hand makes it: as many events as the screen has pictures, over the slider's middle half.
DRAG = """(async (seconds) => {
  const slider = document.getElementById('p1'), low = Number(slider.min), span = Number(slider.max) - low;
  const before = birefitView.counters.pictures, begin = performance.now();
  birefitView.counters.latency.length = 0;
  while (performance.now() - begin < 1000 * seconds) {
    slider.value = low + span * (0.5 + 0.25 * Math.sin((performance.now() - begin) / 300));
    slider.dispatchEvent(new Event('input'));
    await new Promise(requestAnimationFrame);
  }
  return {pictures: (birefitView.counters.pictures - before) / (performance.now() - begin) * 1000,
          latency: birefitView.counters.latency, render: birefitView.drawn.header.render_seconds};
})(%g)"""

with tempfile.TemporaryDirectory() as folder:
    config, pixel = os.path.join(folder, "droplet.yaml"), 0.05 * 256 / arguments.size
    write = lambda d, b: open(config, "w").write(CONFIG.format(pixel=pixel, diameter=d, birefringence=b))
    write(9.12, 0.187)
    subprocess.run([arguments.birefit, "render", config, "--set", "micrograph.image=", "--set",
                    f"image_size_px=[{arguments.size}, {arguments.size}]", "--quiet", "--out",
                    os.path.join(folder, "droplet.tif")], check=True)
    write(9.3, 0.2)
    server = subprocess.Popen([arguments.birefit, "view", config], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    address = server.stdout.readline().strip()
    try:
        with Browser() as page:
            page.go(address)
            page.wait("self.birefitView && birefitView.drawn && birefitView.drawn.settle")
            page.run(DRAG % 1)
            found = page.run(DRAG % arguments.seconds)
            latency = sorted(found["latency"])
            if not latency:
                sys.exit("no picture while the slider moved: the machine is too busy for a figure")
            print(f"{arguments.size} x {arguments.size}: {found['pictures']:.0f} pictures a second, each "
                  f"{statistics.median(latency):.0f} ms from the question to the painted answer (one in twenty over "
                  f"{latency[int(0.95 * len(latency))]:.0f} ms), of which the model {1000 * found['render']:.1f} ms")
    finally:
        server.terminate()
        server.wait()
