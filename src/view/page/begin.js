"use strict";
// `birefit view IMAGE`: which kind of sample it is, where it is in the picture, what the file does not tell; the config
// grows beside. Loaded after app.js, whose ask() and banner() it uses.

self.begin = (() => {
  let told = null;        // what the program says of the image
  let kind = "";
  let circle = null, region = null, numbers = {}, bitmap = null, sight = null;

  const answers = () => ({ kind, circle, region, numbers, pixel_um: Number(at("pixel-um").value) || 0 });
  const tool = () => document.querySelector("[name=draws]:checked").value;

  let turn = 0, growing = Promise.resolve();
  const grow = () => {
    growing = growNow();
  };
  const growNow = async () => {
    if (!kind) return;
    const mine = ++turn;
    try {
      const grown = await (await ask("grow", answers())).json();
      if (mine !== turn) return;  // an answer to what was asked before
      at("grown").value = grown.text;
      const item = (words, name) => Object.assign(document.createElement("li"), { textContent: words, className: name });
      at("told").replaceChildren(...grown.missing.map((w) => item(`missing: ${w}`, "missing")), ...grown.found.map((w) => item(`found: ${w}`, "")));
      showNumbers(grown.numbers);
      at("open").disabled = false;
      banner("");
    } catch (error) {
      banner(error.message);
    }
  };
  let waiting = 0;
  const soon = () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => {
      waiting = 0;
      grow();
    }, 150);
  };

  /** The numbers that nobody has asked the user for, to be looked at. */
  const showNumbers = (list) => {
    const box = at("numbers");
    if (box.dataset.kind === kind && box.children.length === list.length) {
      list.forEach(({ path, value }, i) => {
        const input = box.children[i].querySelector("input");
        if (!(path in numbers) && input !== document.activeElement) input.value = value;
      });
      return;
    }
    box.dataset.kind = kind;
    box.replaceChildren(...list.map(({ path, value }) => {
      const label = document.createElement("label"), input = document.createElement("input");
      const parts = path.split("."), last = parts[parts.length - 1];
      label.textContent = `${parts.length > 2 ? parts[parts.length - 2] + " " : ""}${last}`.replaceAll("_", " ").replace(/ um$/, " (µm)").replace(/ nm$/, " (nm)").replace(/ deg$/, " (°)");
      label.title = path;
      Object.assign(input, { type: "number", step: "any", value });
      input.addEventListener("input", () => {
        if (input.value === "") delete numbers[path];
        else numbers[path] = Number(input.value);
        soon();
      });
      label.append(input);
      return label;
    }));
  };

  const paint = () => {
    if (!bitmap || at("begin").hidden) return;
    const canvas = at("photo"), ratio = Draw.fit(canvas, canvas.clientWidth * Math.min(1.2, sight.height / sight.width));
    canvas.style.height = `${canvas.height / ratio}px`;
    Draw.show(canvas, bitmap, sight);
    const context = canvas.getContext("2d");
    for (const [colour, width] of [["rgba(0,0,0,.65)", 3.5], ["#ffd24a", 1.6]]) {
      context.strokeStyle = colour;
      context.lineWidth = width * ratio;
      context.beginPath();
      if (circle) context.arc(...sight.to(canvas, circle[0], circle[1]), circle[2] * sight.scale(canvas), 0, 2 * Math.PI);
      if (region) {
        const [a, b] = [sight.to(canvas, region[0] - 0.5, region[1] - 0.5), sight.to(canvas, region[2] - 0.5, region[3] - 0.5)];
        context.rect(a[0], a[1], b[0] - a[0], b[1] - a[1]);
      }
      context.stroke();
    }
    at("circle-text").textContent = (circle ? `circle: column ${circle[0].toFixed(0)}, row ${circle[1].toFixed(0)}, radius ${circle[2].toFixed(0)} px. ` : "") +
      (region ? `region: ${region.join(", ")}` : "");
  };

  const listen = () => {
    const canvas = at("photo");
    let from = null;
    const here = (event) => {
      const box = canvas.getBoundingClientRect(), ratio = canvas.width / box.width;
      const [x, y] = sight.from(canvas, (event.clientX - box.left) * ratio, (event.clientY - box.top) * ratio);
      return [Math.min(sight.width - 1, Math.max(0, x)), Math.min(sight.height - 1, Math.max(0, y))];
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      from = here(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      const to = here(event);
      if (tool() === "circle") circle = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2, Math.hypot(to[0] - from[0], to[1] - from[1]) / 2];
      else region = [Math.min(from[0], to[0]), Math.min(from[1], to[1]), Math.max(from[0], to[0]) + 1, Math.max(from[1], to[1]) + 1].map(Math.round);
      paint();
    });
    const end = () => {
      if (from && circle && circle[2] < 3) circle = null;
      if (from && region && (region[2] - region[0] < 8 || region[3] - region[1] < 8)) region = null;
      from = null;
      paint();
      soon();
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("keydown", (event) => {
      const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key], by = event.shiftKey ? 10 : 1;
      if (!arrow && event.key !== "+" && event.key !== "-") return;
      event.preventDefault();
      if (!circle) circle = [(sight.width - 1) / 2, (sight.height - 1) / 2, Math.min(sight.width, sight.height) / 4];
      else if (arrow) circle = [circle[0] + by * arrow[0], circle[1] + by * arrow[1], circle[2]];
      else circle = [circle[0], circle[1], Math.max(3, circle[2] + (event.key === "+" ? by : -by))];
      paint();
      soon();
    });
    at("pixel-um").addEventListener("input", soon);
    at("nothing-drawn").addEventListener("click", () => {
      circle = region = null;
      paint();
      soon();
    });
    at("open").addEventListener("click", async () => {
      at("open").disabled = true;
      try {
        if (waiting) {
          clearTimeout(waiting);
          waiting = 0;
          grow();
        }
        await growing;
        await ask("open", { text: at("grown").value });
        await describe();
      } catch (error) {
        banner(error.message);
      }
      at("open").disabled = false;
    });
    addEventListener("resize", paint);
  };

  const makeKinds = () => {
    at("kinds").append(...told.kinds.map(({ name, words }) => {
      const label = document.createElement("label"), radio = document.createElement("input"), canvas = document.createElement("canvas");
      const text = document.createElement("span"), bold = document.createElement("b");
      Object.assign(radio, { type: "radio", name: "kind", value: name });
      canvas.width = canvas.height = told.thumbnail;
      bold.textContent = name;
      text.append(bold, ` ${words}`);
      label.append(radio, canvas, text);
      radio.addEventListener("change", () => {
        kind = name;
        numbers = {};
        grow();
      });
      return label;
    }));
    // One after the other: the program makes them.
    (async () => {
      for (const label of [...at("kinds").querySelectorAll("label")]) {
        const canvas = label.querySelector("canvas"), bytes = new Uint8Array(await (await ask("thumbnail", { kind: label.querySelector("input").value })).arrayBuffer());
        if (!bytes.length) {
          canvas.classList.add("none");
          continue;
        }
        const picture = new Draw.Bitmap(told.thumbnail, told.thumbnail);
        picture.fill(bytes, 0, 255, Draw.grey);
        canvas.getContext("2d").drawImage(picture.canvas, 0, 0);
      }
    })().catch(() => {});  // the words have to do
  };

  const show = async (is) => {
    at("begin").hidden = !is;
    at("figures").hidden = is;
    if (!is || told) return;
    try {
      told = await (await ask("beginning")).json();
    } catch {
      // `birefit watch --view`: there will be something to show.
      at("begin").hidden = true;
      banner("waiting for the first image …");
      return;
    }
    at("file").textContent = told.file;
    document.title = `${told.file} – birefit view`;
    if (told.pixel_um > 0) at("pixel-um").value = told.pixel_um;
    const values = new Float32Array(await (await ask("picture", {})).arrayBuffer());
    bitmap = new Draw.Bitmap(told.width, told.height);
    sight = new Draw.Sight(told.width, told.height);
    const [low, high] = rangeOf(values, values);
    bitmap.fill(values, low, high, Draw.grey);
    listen();
    makeKinds();
    paint();
  };
  return { show, get text() { return at("grown").value; } };
})();
