"""Asks a `birefit view` as a page does, and as nobody may. usage: ask_view.py BIREFIT SOURCE_DIR, in the folder of view.sh"""

import ast
import http.client
import json
import os
import signal
import struct
import subprocess
import sys

birefit, source = sys.argv[1:]
failures = []


def check(holds, words):
    if not holds:
        print("FAIL", words)
        failures.append(words)


process = subprocess.Popen([birefit, "view", "inner/crystal.yaml", "--port", "0", "--threads", "1"],
                           stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
address = process.stdout.readline().strip()
host, token = address.removeprefix("http://").rstrip("/").split("/")
check(host.startswith("127.0.0.1:") and len(token) == 32, f"the address {address}")


def ask(path, body=None, client="first", prefix="/" + token + "/", **headers):
    connection = http.client.HTTPConnection(host, timeout=120)
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    if client:
        headers["X-Client"] = client
    if body is not None:
        headers.setdefault("Content-Type", "application/json")
        body = json.dumps(body)
    connection.request("GET" if body is None else "POST", prefix + path, body, headers)
    reply = connection.getresponse()
    data = reply.read()
    connection.close()
    return reply.status, data, reply


def ok(path, body=None):
    status, data, _ = ask(path, body)
    check(status == 200, f"{path}: {status} {data[:200]}")
    return data


# ---- who may ask -------------------------------------------------------------------------------------------------------

for words, arguments in {
        "no token": {"prefix": "/"},
        "another token": {"prefix": "/" + "0" * 32 + "/"},
        "a token that goes on": {"prefix": "/" + token + "0/"},
        "another host name": {"Host": "evil.example:" + host.split(":")[1]},
        "another port": {"Host": "127.0.0.1:1"},
        "another origin": {"Origin": "http://evil.example"},
        "no origin at all": {"Origin": "null"},
        "another port's origin": {"Origin": "http://127.0.0.1:1"},
        "another site": {"Sec_Fetch_Site": "cross-site"}}.items():
    for path, body in (("description", None), ("fit", {"values": [1400, 0.3]}), ("", None)):
        status, data, _ = ask(path, body, **arguments)
        check(status == 403 and token.encode() not in data, f"{words} is answered {status}")
check(ask("description", Origin="http://" + host)[0] == 200, "its own origin is refused")
check(ask("stop", {}, Content_Type="text/plain")[0] == 400, "what a form of another site can send")
for path in ("../crystal.yaml", "..%2fcrystal.yaml", "%2e%2e/crystal.yaml", "../../../../etc/passwd", "crystal.yaml"):
    check(ask(path)[0] in (400, 403, 404), f"{path} is served")
status, data, _ = ask("description", client="second")
check(status == 409 and b"another page has this session" in data, f"a second page is told {status} {data}")
check(ask("draw", {"item": 0, "values": [1400, 0.3], "settle": True}, client="second")[0] == 409, "a second page draws")
check(ask("description", client=None)[0] == 409, "a page without a name")

# ---- the page ------------------------------------------------------------------------------------------------------------

status, page, reply = ask("", client=None)
policy = reply.getheader("Content-Security-Policy")
check(status == 200 and "script-src 'self'" in policy and "unsafe" not in policy and "default-src 'none'" in policy, policy)
check(reply.getheader("X-Content-Type-Options") == "nosniff", "types may be guessed")
check(page.count(b"<script ") == page.count(b"<script src="), "a script in the page")
check(b" style=" not in page and b"<style" not in page and b" on" not in page.split(b"<body>")[0], "a style or handler in the page")
for name in ("app.js", "draw.js", "style.css"):
    text = ok(name)
    check(b"http://" not in text and b"https://" not in text, f"{name} names another place")
    for word in (b"innerHTML", b"outerHTML", b"insertAdjacentHTML", b"document.write", b"eval("):
        check(word not in text, f"{name} has {word}")
status, data, reply = ask("description")
check(reply.getheader("Content-Type") == "application/json", "a description that a browser may take for a page")
description = json.loads(data)
check(description["items"][0]["name"] == "f<img src=x onerror=alert(1)>.tif", f"{description['items']}")
check([p["label"] for p in description["parameters"]] == ["half_wave_voltage_v", "field_legendre[1]"], f"{description['parameters']}")

# ---- a picture is that of `birefit render` -----------------------------------------------------------------------------------


def numbers(data):
    return struct.unpack(f"<{len(data) // 4}f", data)


def drawn(values, settle=True):
    data = ok("draw", {"item": 0, "values": values, "settle": settle})
    length = struct.unpack("<I", data[:4])[0]
    return json.loads(data[4:4 + length]), numbers(data[4 + length:])


measured = numbers(ok("measured", {"item": 0}))
check(len(measured) == 2 * 48 * 48, "measured values and their deviations")
values = [1480, 0.42]
header, model = drawn(values)
subprocess.run([birefit, "render", "inner/crystal.yaml", "--set", "sample.crystal.half_wave_voltage_v=1480", "--set",
                "sample.crystal.field_legendre=[0.42]", "--out", "model.npy", "--quiet"], check=True)
npy = open("model.npy", "rb").read()
shape = ast.literal_eval(npy[10:10 + struct.unpack("<H", npy[8:10])[0]].decode())["shape"]
intensity = struct.unpack(f"<{shape[0] * shape[1]}d", npy[-8 * shape[0] * shape[1]:])
linear = {p["label"]: p["value"] for p in header["linear"]}
# Single precision of the page's numbers, of up to 255.
worst = max(abs(linear["gain"] * i + linear["offset"] - m) for i, m in zip(intensity, model))
check(worst < 255 * 2**-23, f"the picture is {worst} from that of render")
# Chi-square is that of these numbers; gain and offset are the best, so that a change of either makes it larger.
sigma = measured[48 * 48:]


def chi_square(gain, offset):
    return sum(((v - gain * i - offset) / s)**2 for v, i, s in zip(measured, intensity, sigma))


check(abs(chi_square(linear["gain"], linear["offset"]) / header["chi_square"] - 1) < 1e-5, "chi-square")
for gain, offset in ((1.001, 1), (0.999, 1), (1, 1.003), (1, 0.997)):
    check(chi_square(gain * linear["gain"], offset * linear["offset"]) > header["chi_square"], "gain and offset")
for bad in ([1480], [1480, "x"], [1e400, 0.3], "x"):
    check(ask("draw", {"item": 0, "values": bad, "settle": True})[0] == 400, f"values {bad}")
check(ask("draw", {"item": 7, "values": values, "settle": True})[0] == 400, "a picture that is not there")

# ---- fit, then save --------------------------------------------------------------------------------------------------------------


def fitted(values):
    before = json.loads(ok("news", {"state": -1, "line": 0}))
    ok("fit", {"values": values})
    state, line, lines = before["state"], before["line"], []
    while True:
        news = json.loads(ok("news", {"state": state, "line": line}))
        state, line = news["state"], news["line"]
        lines += news["lines"]
        if not news["running"] and len(lines) > 1:
            return lines, json.loads(ok("description"))


def by_command(config):
    run = subprocess.run([birefit, "fit", config, "--json", "--quiet", "--threads", "1", "--out", "out"],
                         capture_output=True, text=True)
    check(run.returncode == 0, run.stderr)
    return json.loads(run.stdout)


start = [p["start"] for p in description["parameters"]]
lines, after = fitted(start)
expected = by_command("inner/crystal.yaml")
values_of = {name: p["value"] for name, p in expected["parameters"].items()}
check(all(p["value"] == values_of[p["name"]] for p in after["result"]["parameters"]), "the page's fit has other values than the command's")
check(after["result"]["answer"] and lines[-1].startswith("answer"), f"the log ends with {lines[-1:]}")
header, _ = drawn([p["value"] for p in after["parameters"]])
check(abs(header["chi_square"] / after["result"]["chi_square"] - 1) < 1e-9, f"chi-square {header['chi_square']} is not the fit's {after['result']['chi_square']}")
check(b"<html" in ask("report.html", client=None)[1], "no report")

for name in ("../out.yaml", "/tmp/out.yaml", "a/b.yaml", ".hidden.yaml", "notes.txt", ".yaml", "a\nb.yaml", "..\\x.yaml", ""):
    status, data, _ = ask("save", {"name": name, "values": values})
    check(status == 400, f"saved as {name!r}: {status} {data}")
check(not os.path.exists("out.yaml"), "a file out of the folder")
ok("save", {"name": "tried.yaml", "values": values})
check(ask("save", {"name": "tried.yaml", "values": values})[0] == 400, "a file is overwritten unasked")
ok("save", {"name": "tried.yaml", "values": values, "overwrite": True})
saved, before = open("inner/tried.yaml").read(), open("inner/crystal.yaml").read()
check(saved == before.replace("value: 1400", "value: 1480").replace("value: 0.3", "value: 0.42"), f"what was saved:\n{saved}")
_, after = fitted(values)
values_of = {name: p["value"] for name, p in by_command("inner/tried.yaml")["parameters"].items()}
check(all(p["value"] == values_of[p["name"]] for p in after["result"]["parameters"]), "the saved config's fit has other values than the page's")
check(ok("words", {"values": values}).startswith(b"Image      48 x 48"), "the planner's words")

# ---- a port is one program's ---------------------------------------------------------------------------------------------------

other = subprocess.run([birefit, "view", "inner/crystal.yaml", "--port", host.split(":")[1]], capture_output=True, text=True, timeout=60)
check(other.returncode == 2 and "no port" in other.stderr, f"a second program at the same port: {other.returncode} {other.stderr}")

# ---- a page that leaves makes room; the program ends as others do -----------------------------------------------------------------

connection = http.client.HTTPConnection(host, timeout=60)
connection.request("POST", f"/{token}/leave", "first", {"Content-Type": "text/plain"})
check(connection.getresponse().status == 204, "goodbye")
check(ask("description", client="second")[0] == 200, "nobody gets the session that was left")
process.send_signal(signal.SIGTERM)
check(process.wait(30) == -signal.SIGTERM, "SIGTERM does not end it as it ends other commands")

# ---- from an image: a region that it does not have ---------------------------------------------------------------------------------

image = next(name for name in os.listdir("inner") if name.endswith(".tif"))
process = subprocess.Popen([birefit, "view", "inner/" + image, "--threads", "1"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
host, token = process.stdout.readline().strip().removeprefix("http://").rstrip("/").split("/")
for region in ([-5, -5, 40, 40], [0, 0, 300, 300], [20, 20, 20, 30], [30, 30, 10, 10]):
    status, data, _ = ask("grow", {"kind": "droplet", "circle": None, "region": region, "numbers": {}, "pixel_um": 0.1}, prefix="/" + token + "/")
    check(status == 400 and b"region" in data, f"region {region}: {status} {data[:200]}")
check(process.poll() is None, "a region that is none ends the program")
process.terminate()
process.wait(30)
print(f"{len(failures)} failures" if failures else "all as required")
sys.exit(bool(failures))
