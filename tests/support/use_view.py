"""Uses `birefit view` in Chromium as people do. usage: use_view.py BIREFIT SOURCE_DIR, in the folder of view_page.sh"""

import json
import os
import subprocess
import sys

from browser import Browser

birefit, source = sys.argv[1:]
failures = []


def check(holds, words):
    if not holds:
        print("FAIL", words)
        failures.append(words)


process = subprocess.Popen([birefit, "view", "inner/crystal.yaml", "--threads", "1"], stdout=subprocess.PIPE,
                           stderr=subprocess.DEVNULL, text=True)
address = process.stdout.readline().strip()
with Browser() as page:
    page.go(address)
    page.wait("self.birefitView && birefitView.drawn && birefitView.drawn.settle")
    check(page.run("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)", "no style sheet")
    # What a user wrote is text: the name of the picture would run a script otherwise.
    check(page.run("[...document.querySelectorAll('#item option')].map(o => o.textContent)") == ["f<img src=x onerror=alert(1)>.tif"], "the picture's name")
    check(page.run("document.querySelectorAll('img').length") == 0, "a name has become an element")
    # Everything that can be used has a name for those who hear the page.
    check(page.run("[...document.querySelectorAll('input, select, button, canvas')].filter(e => !(e.labels && e.labels.length) && !e.getAttribute('aria-label') && !e.textContent.trim()).map(e => e.id)") == [], "controls without a name")
    # A drag of the first slider moves the picture and chi-square; the arrow keys do the same.
    before = page.run("birefitView.drawn.header.chi_square")
    box = page.run("(r => [r.x, r.y, r.width, r.height])(document.getElementById('p0').getBoundingClientRect())")
    x, y = box[0] + box[2] * 0.27, box[1] + box[3] / 2
    page.mouse("mousePressed", x, y, button="left", clickCount=1)
    for step in range(1, 6):
        page.mouse("mouseMoved", x + step * 3, y, button="left", buttons=1)
    page.mouse("mouseReleased", x + 15, y, button="left", clickCount=1)
    page.wait("birefitView.drawn.settle && birefitView.drawn.values[0] === birefitView.values[0]")
    dragged = page.run("birefitView.values[0]")
    check(dragged != 1400, "a drag does not move the value")
    check(page.run("birefitView.drawn.header.chi_square") != before, "chi-square stays as one drags")
    check(page.run("document.activeElement.id") == "p0", "the slider has no focus")
    page.press("ArrowRight")
    page.wait("birefitView.drawn.settle && birefitView.drawn.values[0] === birefitView.values[0]")
    check(abs(page.run("birefitView.values[0]") - dragged - 2) < 1e-6, "an arrow key does not move the value by a step")
    check(page.run("document.getElementById('spoken').textContent").startswith("reduced chi-square "), "chi-square is not spoken")
    # Zoom is linked, the profile's line follows the hand.
    page.run("document.getElementById('measured').focus()")
    page.press("+")
    page.run("document.querySelector('[value=line]').click()")
    page.press("ArrowDown")
    # Fit, with its log; then save. On a slow line a picture asked for before the fit comes when what is measured is on its way anew.
    page.run("self.quick = fetch; self.fetch = async (path, options) => { const reply = await quick(path, options); await new Promise(r => setTimeout(r, { draw: 1500, measured: 3000 }[path.split('?')[0]] || 0)); return reply; }")
    page.run("document.getElementById('reset').click()")
    page.run("document.getElementById('fit').click()")
    page.wait("!document.getElementById('result').hidden && document.getElementById('stop').hidden")
    check(page.run("document.getElementById('grade').textContent").startswith("answer"), "no answer")
    check(page.run("document.getElementById('log').textContent.split('\\n').length") > 2, "no log")
    page.run("self.fetch = quick")
    page.wait("birefitView.drawn && birefitView.drawn.settle && birefitView.drawn.values[0] === birefitView.values[0]")
    fit = json.loads(subprocess.run([birefit, "fit", "inner/crystal.yaml", "--json", "--quiet", "--threads", "1", "--out", "out"],
                                    capture_output=True, text=True).stdout)
    value = fit["parameters"]["sample.crystal.half_wave_voltage_v"]["value"]
    check(page.run("birefitView.values[0]") == value, "the slider is not where the fit ended")
    page.run("document.getElementById('save-button').click()")
    page.wait("document.getElementById('saved').textContent.startsWith('saved: ')")
    check(subprocess.run([birefit, "fit", "inner/crystal-tried.yaml", "--quiet", "--threads", "1", "--out", "tried"]).returncode == 0, "the saved config does not run")
    check(page.complaints() == [], f"{page.complaints()}")
    # A second page is told, and gets in when the first has gone.
    with Browser() as other:
        other.go(address)
        other.wait("document.getElementById('banner').textContent.includes('another page has this session')")
        check(other.run("document.getElementById('work').hidden"), "a second page shows something")
        page.go("about:blank")
        other.wait("self.birefitView && birefitView.drawn")
    check(process.poll() is None, "birefit ends with the page")
process.terminate()
process.wait(30)

# From an image to a config without writing a line of it.
subprocess.run([birefit, "new", "droplet", "--demo", "demo"], check=True, stdout=subprocess.DEVNULL)
os.rename("demo/droplet.png", "inner/mine.png")
process = subprocess.Popen([birefit, "view", "inner/mine.png", "--threads", "1"], stdout=subprocess.PIPE,
                           stderr=subprocess.DEVNULL, text=True)
address = process.stdout.readline().strip()
with Browser() as page:
    page.go(address)
    page.wait("document.querySelectorAll('#kinds label').length > 3")
    page.run("document.querySelector('#kinds [value=droplet]').click()")
    page.wait("document.querySelectorAll('#told .missing').length === 1")
    check("pixel_size_um" in page.run("document.querySelector('#told .missing').textContent"), "what is missing is not said")
    x, y, width, height = page.run("(r => [r.x, r.y, r.width, r.height])(document.getElementById('photo').getBoundingClientRect())")
    # From rim to rim of the droplet, which is 182 px across in the middle of 240.
    ends = [(x + width * (0.5 + sign * 0.268), y + height * (0.5 + sign * 0.268)) for sign in (-1, 1)]
    page.mouse("mousePressed", *ends[0], button="left", clickCount=1)
    page.mouse("mouseMoved", *ends[1], button="left", buttons=1)
    page.mouse("mouseReleased", *ends[1], button="left", clickCount=1)
    page.run("(i => { i.value = '0.05'; i.dispatchEvent(new Event('input')); })(document.getElementById('pixel-um'))")
    page.run("(i => { i.value = '546'; i.dispatchEvent(new Event('input')); })([...document.querySelectorAll('#numbers label')].find(l => l.title === 'microscope.light.wavelength_nm').querySelector('input'))")
    page.wait("/pixel_size_um: 0.05/.test(begin.text) && /center_px: \\[{value: 1/.test(begin.text) && /wavelength_nm: 546/.test(begin.text)")
    check(page.run("document.querySelectorAll('#told .missing').length") == 0, "something is still missing")
    text = page.run("begin.text")
    page.run("document.getElementById('open').click()")
    page.wait("self.birefitView && birefitView.drawn && birefitView.drawn.settle")
    check(abs(page.run("birefitView.values[0]") - 9.1) < 0.2, "the circle is not the diameter's start")
    check(page.run("document.getElementById('save-as').value") == "mine.yaml", "the config has another name than the image")
    page.run("document.getElementById('save-button').click()")
    page.wait("document.getElementById('saved').textContent.startsWith('saved: ')")
    check(open("inner/mine.yaml").read() == text, "what is saved is not what was shown")
    check(page.complaints() == [], f"{page.complaints()}")
check(subprocess.run([birefit, "explain", "inner/mine.yaml"], stdout=subprocess.DEVNULL).returncode == 0, "the config does not run")
process.terminate()
process.wait(30)
print(f"{len(failures)} failures" if failures else "all as required")
sys.exit(bool(failures))
