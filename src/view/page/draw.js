"use strict";
// Pictures and curves on canvases. Knows nothing of the server or of parameters.

const Draw = (() => {
  let inks = {};
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { inks = {}; });
  const ink = (name) => inks[name] || (inks[name] = getComputedStyle(document.documentElement).getPropertyValue(name).trim());

  /** 256 colours as 0xAABBGGRR. */
  const table = (colour) => {
    const words = new Uint32Array(256);
    for (let i = 0; i < 256; ++i) {
      const [r, g, b] = colour(i / 255);
      words[i] = (255 << 24) | (b << 16) | (g << 8) | r;
    }
    return words;
  };
  const between = (stops) => (t) => {
    const at = Math.min(t * (stops.length - 1), stops.length - 1.000001), i = Math.floor(at), f = at - i;
    return stops[i].map((c, k) => Math.round(c + f * (stops[i + 1][k] - c)));
  };
  const kGrey = table((t) => [0, 0, 0].map(() => Math.round(255 * t)));
  // Blue to red through white (ColorBrewer RdBu): no sign is lost on the colour-blind.
  const kDiverging = table(between([[5, 48, 97], [67, 147, 195], [247, 247, 247], [214, 96, 77], [103, 0, 31]]));
  const kNone = 0x00000000;

  /** Values as a bitmap: what is no number is transparent. */
  class Bitmap {
    constructor(width, height) {
      this.canvas = document.createElement("canvas");
      this.canvas.width = width;
      this.canvas.height = height;
      this.context = this.canvas.getContext("2d");
      this.data = this.context.createImageData(width, height);
      this.words = new Uint32Array(this.data.data.buffer);
    }
    fill(values, low, high, colours) {
      const words = this.words, scale = 255 / (high > low ? high - low : 1), n = words.length;
      for (let i = 0; i < n; ++i) {
        const v = (values[i] - low) * scale;
        words[i] = v !== v ? kNone : colours[v <= 0 ? 0 : v >= 255 ? 255 : (v + 0.5) | 0];
      }
      this.context.putImageData(this.data, 0, 0);
    }
  }

  /** Makes a canvas as fine as the screen; says whether its size changed. */
  const fit = (canvas, height) => {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth;
    const w = Math.max(1, Math.round(width * ratio)), h = Math.max(1, Math.round(height * ratio));
    if (canvas.width !== w || canvas.height !== h) {
      canvas.width = w;
      canvas.height = h;
    }
    return ratio;
  };

  /** What part of a picture is seen: its middle (px) and how many times the smallest whole it is. */
  class Sight {
    constructor(width, height) {
      this.width = width;
      this.height = height;
      this.reset();
    }
    reset() {
      this.x = (this.width - 1) / 2;
      this.y = (this.height - 1) / 2;
      this.times = 1;
    }
    scale(canvas) { return this.times * Math.min(canvas.width / this.width, canvas.height / this.height); }
    /** Canvas place of a picture place. */
    to(canvas, x, y) {
      const s = this.scale(canvas);
      return [canvas.width / 2 + (x - this.x) * s, canvas.height / 2 + (y - this.y) * s];
    }
    from(canvas, u, v) {
      const s = this.scale(canvas);
      return [this.x + (u - canvas.width / 2) / s, this.y + (v - canvas.height / 2) / s];
    }
    zoom(by, x = this.x, y = this.y) {
      const before = this.times;
      this.times = Math.min(64, Math.max(1, this.times * by));
      const k = before / this.times;
      this.x = x + (this.x - x) * k;
      this.y = y + (this.y - y) * k;
      this.keep();
    }
    move(dx, dy) {
      this.x += dx;
      this.y += dy;
      this.keep();
    }
    keep() {
      const half = (size) => (size / this.times) / 2, clamp = (v, size) =>
        Math.min(size - 0.5 - half(size), Math.max(half(size) - 0.5, v));
      this.x = clamp(this.x, this.width);
      this.y = clamp(this.y, this.height);
    }
  }

  const show = (canvas, bitmap, sight) => {
    const context = canvas.getContext("2d"), s = sight.scale(canvas);
    const [u, v] = sight.to(canvas, -0.5, -0.5);
    context.imageSmoothingEnabled = s < 1;
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.drawImage(bitmap.canvas, u, v, bitmap.canvas.width * s, bitmap.canvas.height * s);
  };

  /** The profile's line, and a cross where the model has its centre. */
  const marks = (canvas, sight, line, centre, ratio) => {
    const context = canvas.getContext("2d");
    const stroke = (path) => {
      for (const [colour, width] of [["rgba(0,0,0,.5)", 2.4], ["#ffd24a", 1.1]]) {
        context.strokeStyle = colour;
        context.lineWidth = width * ratio;
        context.beginPath();
        path();
        context.stroke();
      }
    };
    if (line) {
      const a = sight.to(canvas, line.x0, line.y0), b = sight.to(canvas, line.x1, line.y1);
      stroke(() => {
        context.moveTo(...a);
        context.lineTo(...b);
      });
      for (const [u, v] of [a, b]) stroke(() => context.arc(u, v, 3.5 * ratio, 0, 7));
    }
    if (centre) {
      const [u, v] = sight.to(canvas, centre[0], centre[1]), r = 6 * ratio;
      stroke(() => {
        context.moveTo(u - r, v);
        context.lineTo(u + r, v);
        context.moveTo(u, v - r);
        context.lineTo(u, v + r);
      });
    }
  };

  /** A bar of a round length in the lower right corner. */
  const scaleBar = (canvas, sight, pixelUm, ratio) => {
    if (!(pixelUm > 0)) return;
    const s = sight.scale(canvas), most = 0.3 * canvas.width / s * pixelUm;
    const ten = 10 ** Math.floor(Math.log10(most)), length = [5, 2, 1].find((k) => k * ten <= most) * ten;
    const context = canvas.getContext("2d"), w = length / pixelUm * s, margin = 10 * ratio;
    const x = canvas.width - margin - w, y = canvas.height - margin;
    context.font = `${12 * ratio}px sans-serif`;
    context.textAlign = "center";
    const text = `${Number(length.toPrecision(2))} µm`;
    context.fillStyle = "rgba(0,0,0,.55)";
    const wide = Math.max(w, context.measureText(text).width) + 10 * ratio;
    context.fillRect(x + w / 2 - wide / 2, y - 21 * ratio, wide, 27 * ratio);
    context.fillStyle = "#fff";
    context.fillRect(x, y - 2.5 * ratio, w, 2.5 * ratio);
    context.fillText(text, x + w / 2, y - 7 * ratio);
  };

  const nice = (span, most) => {
    const raw = span / Math.max(1, most), ten = 10 ** Math.floor(Math.log10(raw));
    return ten * [1, 2, 5, 10].find((k) => k * ten >= raw);
  };
  const ticks = (low, high, most) => {
    const step = nice(high - low, most), list = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) list.push(k * step);
    return list;
  };
  const label = (value) => {
    const v = Math.abs(value) < 1e-12 ? 0 : value;
    return Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3) ? v.toExponential(1) : String(Number(v.toPrecision(5)));
  };
  const ends = (lists) => {
    let low = Infinity, high = -Infinity;
    for (const list of lists)
      for (const v of list)
        if (v === v) {
          if (v < low) low = v;
          if (v > high) high = v;
        }
    if (!(low < high)) [low, high] = low === high ? [low - 1, high + 1] : [0, 1];
    const room = 0.06 * (high - low);
    return [low - room, high + room];
  };

  /** Curves: {x, measured, model, residual, sigma, xLabel, points} in two panels on one axis. */
  const chart = (canvas, data) => {
    const ratio = fit(canvas, canvas.clientHeight), c = canvas.getContext("2d");
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    const width = canvas.width / ratio, height = canvas.height / ratio;
    c.clearRect(0, 0, width, height);
    if (!data || data.x.length < 2) return;
    const left = 62, right = 12, bottom = 36, gap = 14, top = 6;
    const upper = (height - bottom - gap - top) * 0.68;
    const [x0, x1] = [Math.min(...data.x), Math.max(...data.x)], X = (x) => left + (x - x0) / (x1 - x0 || 1) * (width - left - right);
    c.font = "11.5px sans-serif";
    const panel = (y, h, range, title) => {
      const Y = (v) => y + h - (v - range[0]) / (range[1] - range[0]) * h;
      c.strokeStyle = ink("--grid");
      c.fillStyle = ink("--soft");
      c.lineWidth = 1;
      c.textAlign = "right";
      c.textBaseline = "middle";
      for (const v of ticks(range[0], range[1], Math.max(4, h / 30))) {
        c.beginPath();
        c.moveTo(left, Y(v));
        c.lineTo(width - right, Y(v));
        c.stroke();
        c.fillText(label(v).replace("-", "−"), left - 7, Y(v));
      }
      c.save();
      c.translate(11, y + h / 2);
      c.rotate(-Math.PI / 2);
      c.textAlign = "center";
      c.fillText(title, 0, 0);
      c.restore();
      return Y;
    };
    const curve = (list, Y, colour, wide) => {
      c.strokeStyle = colour;
      c.lineWidth = wide;
      c.lineJoin = "round";
      c.beginPath();
      let on = false;
      for (let i = 0; i < list.length; ++i) {
        if (list[i] !== list[i]) { on = false; continue; }
        if (on) c.lineTo(X(data.x[i]), Y(list[i]));
        else c.moveTo(X(data.x[i]), Y(list[i]));
        on = true;
      }
      c.stroke();
    };
    const Y = panel(top, upper, ends([data.measured, data.model]), data.yLabel || "value");
    if (data.points) {
      c.fillStyle = c.strokeStyle = ink("--measured");
      c.lineWidth = 1.2;
      for (let i = 0; i < data.x.length; ++i) {
        const x = X(data.x[i]), s = data.sigma[i];
        if (s > 0) {
          c.beginPath();
          c.moveTo(x, Y(data.measured[i] - s));
          c.lineTo(x, Y(data.measured[i] + s));
          c.stroke();
        }
        c.beginPath();
        c.arc(x, Y(data.measured[i]), 2.6, 0, 7);
        c.fill();
      }
    } else {
      curve(data.measured, Y, ink("--measured"), 1.4);
    }
    curve(data.model, Y, ink("--model"), 1.8);
    const below = top + upper + gap, h = height - bottom - below;
    let most = data.inValues ? 0 : 3;
    for (const v of data.residual) if (Math.abs(v) > most) most = Math.abs(v);
    const R = panel(below, h, [-1.08 * (most || 1), 1.08 * (most || 1)], data.inValues ? "residual" : "residual (σ)");
    c.strokeStyle = ink("--soft");
    c.beginPath();
    c.moveTo(left, R(0));
    c.lineTo(width - right, R(0));
    c.stroke();
    curve(data.residual, R, ink("--residual"), 1.2);
    c.fillStyle = ink("--soft");
    c.textAlign = "center";
    c.textBaseline = "top";
    for (const v of ticks(x0, x1, width / 90)) c.fillText(label(v), X(v), height - bottom + 7);
    c.fillText(data.xLabel, (left + width - right) / 2, height - 14);
  };

  return { Bitmap, Sight, show, marks, scaleBar, chart, fit, grey: kGrey, diverging: kDiverging, label, nice };
})();
