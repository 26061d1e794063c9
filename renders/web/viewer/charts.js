// Charts over time on canvases: axes with round numbers, a line at the present; a click goes to that time.
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
  constructor(chart, duration, seek) {
    this.chart = chart; this.duration = duration;
    this.figure = document.createElement("figure");
    const caption = document.createElement("figcaption"), names = document.createElement("span");
    caption.append(chart.title + (chart.unit ? ` [${chart.unit}]` : ""), names);
    if (chart.series.some((own) => own.name)) for (const own of chart.series) {
      const name = document.createElement("b"); name.textContent = own.name; name.style.setProperty("--colour", own.colour); names.append(name);
    }
    this.canvas = document.createElement("canvas"); this.canvas.setAttribute("role", "img"); this.canvas.setAttribute("aria-label", `${chart.title} over time`);
    this.figure.append(caption, this.canvas);
    const at = (event) => { const box = this.canvas.getBoundingClientRect(); seek(this.timeAt(event.clientX - box.left)); };
    this.canvas.addEventListener("pointerdown", (event) => { this.canvas.setPointerCapture(event.pointerId); at(event); });
    this.canvas.addEventListener("pointermove", (event) => { if (event.buttons & 1) at(event); });
    this.still = document.createElement("canvas");
  }
  // Limits that hold all but the wildest hundredth of the values, and three quarters of a band.
  limits() {
    const values = [], positive = this.chart.logarithmic;
    for (const own of this.chart.series) {
      const kept = Array.from(own.y).filter((y) => Number.isFinite(y) && (!positive || y > 0)).sort((a, b) => a - b);
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
  timeAt(x) { return clamp((x - this.left) / (this.right - this.left), 0, 1) * this.duration; }
  x(t) { return this.left + (this.right - this.left) * t / this.duration; }
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
    const step = roundStep(this.duration, 5);
    for (let t = 0; t <= this.duration * (1 + 1e-9); t += step) { const x = this.x(t), words = written(t, step) + (t + step > this.duration ? " s" : ""); pen.fillText(words, Math.min(x, this.right - 8), this.bottom + 4); }
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
  curve(pen, { t, y, colour, step, dashed }, width) {
    pen.strokeStyle = colour; pen.lineWidth = width; pen.setLineDash(dashed ? [5, 4] : []); pen.beginPath();
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
    const x = this.x(t); pen.beginPath(); pen.moveTo(x, this.top); pen.lineTo(x, this.bottom); pen.stroke();
  }
}
