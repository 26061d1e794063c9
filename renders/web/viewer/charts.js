// Charts over time on canvases: axes with round numbers, a line at the present; a click goes to that time, the pointer
// reads the values, and a drag with Shift zooms all charts to a stretch of time.
const PATTERNS = [[], [6, 4], [1.5, 3], [8, 3, 1.5, 3]]; // of dashes [pixels]
const roundStep = (span, most) => {
  const rough = span / most, power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= rough * (1 - 1e-9));
};
const written = (value, step) => {
  if (value === 0) return "0";
  if (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3) return value.toExponential(0).replace("e+", "e").replace("-", "−");
  return value.toFixed(clamp(-Math.floor(Math.log10(step) + 1e-9), 0, 6)).replace("-", "−");
};

class TimeChart {
  constructor(chart, duration, seek, zoom) {
    this.chart = chart; this.duration = duration; this.begin = 0; this.end = duration; this.pointed = null; this.selected = null;
    this.figure = document.createElement("figure");
    const caption = document.createElement("figcaption"), names = document.createElement("span");
    caption.append(chart.title + (chart.unit ? ` [${chart.unit}]` : ""), names);
    this.values = chart.series.map((own) => {
      const name = document.createElement("b"), value = document.createElement("output"); name.textContent = own.name;
      if (own.name) { name.style.setProperty("--colour", own.colour); name.dataset.pattern = own.pattern ?? 0; }
      name.append(value); names.append(name);
      return value;
    });
    this.canvas = document.createElement("canvas"); this.canvas.setAttribute("role", "img"); this.canvas.setAttribute("aria-label", `${chart.title} over time`);
    this.figure.append(caption, this.canvas);
    const at = (event) => { const box = this.canvas.getBoundingClientRect(); seek(this.timeAt(event.clientX - box.left)); };
    const time = (event) => this.timeAt(event.clientX - this.canvas.getBoundingClientRect().left);
    this.canvas.addEventListener("pointerdown", (event) => { this.canvas.setPointerCapture(event.pointerId); if (event.shiftKey) this.selected = [time(event), time(event)]; else at(event); });
    this.canvas.addEventListener("pointermove", (event) => { this.pointed = time(event); if (this.selected) this.selected[1] = this.pointed; else if (event.buttons & 1) at(event); this.again?.(); });
    this.canvas.addEventListener("pointerleave", () => { this.pointed = null; this.again?.(); });
    this.canvas.addEventListener("pointerup", () => {
      if (!this.selected) return;
      const [first, last] = this.selected.toSorted((a, b) => a - b); this.selected = null;
      if (last - first > 0.01 * (this.end - this.begin)) zoom(first, last); else this.again?.();
    });
    this.canvas.addEventListener("dblclick", () => zoom(0, this.duration));
    this.still = document.createElement("canvas");
  }
  // Limits that hold all but the wildest hundredth of the values, and three quarters of a band.
  limits() {
    const values = [], positive = this.chart.logarithmic, whole = this.begin <= 0 && this.end >= this.duration;
    for (const own of this.chart.series) {
      const kept = Array.from(own.y).filter((y, k) => (whole || (own.t[k] >= this.begin && own.t[k] <= this.end)) && Number.isFinite(y) && (!positive || y > 0)).sort((a, b) => a - b);
      const widths = own.band ? Array.from(own.band).filter(Number.isFinite).sort((a, b) => a - b) : [], half = widths.length ? widths[Math.floor(0.75 * (widths.length - 1))] : 0;
      if (kept.length) values.push(kept[Math.floor(0.003 * (kept.length - 1))] - half, kept[Math.ceil(0.997 * (kept.length - 1))] + half);
    }
    if (!values.length) return [0.1, 1];
    let low = Math.min(...values), high = Math.max(...values);
    for (const bound of this.chart.bounds) { low = Math.min(low, bound); high = Math.max(high, bound); }
    if (positive) return [Math.max(low, 1e-9) * 0.8, Math.max(high, 1e-9) * 1.25];
    const margin = 0.08 * (high - low) || 0.5 * Math.abs(high) || 1;
    return [low - margin, high + margin];
  }
  scale(y) { return this.chart.logarithmic ? Math.log10(Math.max(y, 1e-12)) : y; }
  timeAt(x) { return this.begin + clamp((x - this.left) / (this.right - this.left), 0, 1) * (this.end - this.begin); }
  x(t) { return this.left + (this.right - this.left) * (t - this.begin) / (this.end - this.begin || 1); }
  // The value of a curve at a time, between its samples; nothing where it has none.
  valueAt({ t, y, step }, at) {
    const k = lastAt(t, at);
    if (k < 0 || at > t[t.length - 1] + 1e-6) return NaN;
    if (step || k + 1 >= t.length) return y[k];
    return y[k] + (y[k + 1] - y[k]) * (at - t[k]) / (t[k + 1] - t[k]);
  }
  // Values at the pointer, or at the present, behind the names of the curves.
  read(at) {
    for (const [k, own] of this.chart.series.entries()) {
      const value = this.valueAt(own, at), words = Number.isFinite(value) ? Number(value.toPrecision(4)).toString().replace("-", "−") : "–";
      if (this.values[k].textContent !== words) this.values[k].textContent = words;
    }
  }
  y(value) { const [low, high] = this.range; return this.bottom - (this.bottom - this.top) * (this.scale(value) - low) / (high - low); }
  ticks([low, high]) {
    if (!this.chart.logarithmic) {
      const step = roundStep(high - low, 4), found = [];
      for (let k = Math.ceil(low / step); k * step <= high; k++) found.push([k * step, written(k * step, step)]);
      return found;
    }
    const found = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++) for (const factor of high / low > 50 ? [1] : [1, 2, 5]) {
      const value = factor * 10 ** power;
      if (value >= low && value <= high) found.push([value, written(value, 10 ** power)]);
    }
    return found;
  }
  // All but the line at the present, on a canvas of its own.
  prepare() {
    const { canvas, still, chart } = this, ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !height) return false;
    for (const each of [canvas, still]) { each.width = Math.round(width * ratio); each.height = Math.round(height * ratio); }
    const page = getComputedStyle($("app")), [ink, soft, grid, bound] = ["--ink", "--soft", "--grid", "--bound"].map((name) => page.getPropertyValue(name));
    const pen = still.getContext("2d"); pen.setTransform(ratio, 0, 0, ratio, 0, 0); pen.font = '11px system-ui, "DejaVu Sans", sans-serif'; pen.lineJoin = "round";
    const [low, high] = this.limits(), ticks = this.ticks([low, high]);
    this.range = [this.scale(low), this.scale(high)];
    this.left = 10 + Math.max(24, ...ticks.map(([, words]) => pen.measureText(words).width)); this.right = width - 8; this.top = 5; this.bottom = height - 17;
    pen.strokeStyle = grid; pen.fillStyle = soft; pen.lineWidth = 1; pen.textAlign = "right"; pen.textBaseline = "middle";
    for (const [value, words] of ticks) { const y = Math.round(this.y(value)) + 0.5; pen.beginPath(); pen.moveTo(this.left, y); pen.lineTo(this.right, y); pen.stroke(); pen.fillText(words, this.left - 5, y); }
    pen.textAlign = "center"; pen.textBaseline = "top";
    const step = roundStep(this.end - this.begin, 5);
    for (let k = Math.ceil(this.begin / step - 1e-9); k * step <= this.end * (1 + 1e-9); k++) { const t = k * step, x = this.x(t), words = written(t, step) + (t + step > this.end ? " s" : ""); pen.fillText(words, Math.min(x, this.right - 8), this.bottom + 4); }
    pen.save(); pen.beginPath(); pen.rect(this.left, 0, this.right - this.left + 1, this.bottom + 1); pen.clip();
    pen.strokeStyle = bound; pen.setLineDash([2, 3]);
    for (const value of chart.bounds) { pen.beginPath(); pen.moveTo(this.left, this.y(value)); pen.lineTo(this.right, this.y(value)); pen.stroke(); }
    for (const own of chart.series) if (own.band) this.band(pen, own);
    for (const [k, own] of chart.series.entries()) this.curve(pen, own, chart.series[0].name !== "truth" ? 1.6 : k ? 1.3 : 3);
    pen.restore(); this.ink = ink; this.ratio = ratio;
    return true;
  }
  // What lies within half the height of a band about a curve, stretch by stretch of known values.
  band(pen, { t, y, band, colour }) {
    pen.fillStyle = colour; pen.globalAlpha = 0.18;
    const known = (k) => Number.isFinite(y[k]) && Number.isFinite(band[k]);
    for (let first = 0; first < t.length; first++) {
      if (!known(first)) continue;
      let after = first;
      while (after < t.length && known(after)) after++;
      pen.beginPath();
      for (let k = first; k < after; k++) pen.lineTo(this.x(t[k]), this.y(y[k] + band[k]));
      for (let k = after - 1; k >= first; k--) pen.lineTo(this.x(t[k]), this.y(y[k] - band[k]));
      pen.fill(); first = after;
    }
    pen.globalAlpha = 1;
  }
  curve(pen, { t, y, colour, step, pattern }, width) {
    pen.strokeStyle = colour; pen.lineWidth = width; pen.setLineDash(PATTERNS[pattern ?? 0]); pen.beginPath();
    let drawing = false, before = 0;
    for (let k = 0; k < t.length; k++) {
      if (!Number.isFinite(y[k])) { drawing = false; continue; }
      const x = this.x(t[k]), height = this.y(y[k]);
      if (!drawing) pen.moveTo(x, height); else { if (step) pen.lineTo(x, before); pen.lineTo(x, height); }
      drawing = true; before = height;
    }
    pen.stroke();
  }
  draw(t, stale) {
    if (stale || !this.ratio) if (!this.prepare()) return;
    const pen = this.canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0); pen.clearRect(0, 0, this.canvas.width, this.canvas.height); pen.drawImage(this.still, 0, 0);
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0); pen.strokeStyle = this.ink; pen.lineWidth = 1.2;
    const x = this.x(t), line = (at) => { pen.beginPath(); pen.moveTo(at, this.top); pen.lineTo(at, this.bottom); pen.stroke(); };
    if (t >= this.begin && t <= this.end) line(x);
    this.read(this.pointed ?? t);
    if (this.pointed === null) return;
    if (this.selected) { const [from, to] = this.selected.map((each) => this.x(each)); pen.globalAlpha = 0.15; pen.fillStyle = this.ink; pen.fillRect(Math.min(from, to), this.top, Math.abs(to - from), this.bottom - this.top); pen.globalAlpha = 1; }
    pen.setLineDash([2, 2]); pen.lineWidth = 0.8; const there = this.x(this.pointed); line(there);
    const words = `${this.pointed.toFixed(this.duration < 20 ? 3 : 2)} s`, left = there > 0.7 * (this.left + this.right);
    pen.setLineDash([]); pen.font = '11px system-ui, "DejaVu Sans", sans-serif'; pen.fillStyle = this.ink; pen.textAlign = left ? "right" : "left"; pen.textBaseline = "top"; pen.fillText(words, there + (left ? -4 : 4), this.top);
  }
}
