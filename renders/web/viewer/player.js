// The page: unpacks the scene, keeps the time, and draws when something has changed.
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50];
const speedsWith = (wanted) => [...new Set([...SPEEDS, ...(wanted === null ? [] : [wanted])])].sort((a, b) => a - b);
const HELD = 4; // [s of the reader] that an event is shown
const KINDS = { f4: Float32Array, u4: Uint32Array, u1: Uint8Array };
const $ = (id) => document.getElementById(id);

const unpacked = async (text) => {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
};
// Values that were packed as differences from those `stride` before them.
const summed = (values, stride) => { if (stride) for (let k = stride; k < values.length; k++) values[k] += values[k - stride]; return values; };
// Every reference to the block becomes the array that it refers to.
const withArrays = (value, buffer) => {
  if (Array.isArray(value)) return value.map((each) => withArrays(each, buffer));
  if (value === null || typeof value !== "object") return value;
  if ("kind" in value && "at" in value) return summed(new KINDS[value.kind](buffer, value.at, value.count), value.stride);
  return Object.fromEntries(Object.entries(value).map(([name, each]) => [name, withArrays(each, buffer)]));
};

const css = (colour) => `rgb(${colour.map((share) => Math.round(255 * share)).join(", ")})`;

const poseAt = (motion, t) => {
  if (!motion.shown.some(([begin, end]) => t >= begin - 1e-6 && t <= end + 1e-6)) return null;
  const { t: times, pos, quat, ground } = motion, k = clamp(lastAt(times, t), 0, times.length - 1), next = Math.min(k + 1, times.length - 1);
  const s = next > k ? clamp((t - times[k]) / (times[next] - times[k]), 0, 1) : 0, mixed = (a, i, j) => a[i] + s * (a[j] - a[i]);
  const found = { pos: [0, 1, 2].map((i) => mixed(pos, 3 * k + i, 3 * next + i)), quat: [1, 0, 0, 0], ground: ground ? mixed(ground, k, next) : null };
  if (quat) {
    let sign = 0;
    for (let i = 0; i < 4; i++) sign += quat[4 * k + i] * quat[4 * next + i];
    const q = [0, 1, 2, 3].map((i) => (1 - s) * quat[4 * k + i] + (sign < 0 ? -s : s) * quat[4 * next + i]), n = Math.hypot(...q) || 1;
    found.quat = q.map((x) => x / n);
  }
  return found;
};

// The polylines of some lines at a time, cut at the present.
const polylinesAt = (lines, t) => {
  const k = lines.frames ? lastAt(lines.starts, t) : 0;
  if (k < 0 || t > lines.end + 1e-6) return [];
  const [begin, end] = lines.frames ? [lines.frames[k], lines.frames[k + 1]] : [0, lines.offsets.length - 1], found = [];
  for (let p = begin; p < end; p++) {
    const opacity = lines.opacities ? lines.opacities[p] : 1, [first, after] = [lines.offsets[p], lines.offsets[p + 1]];
    if (!lines.cut) { found.push({ points: lines.points.subarray(3 * first, 3 * after), opacity }); continue; }
    const times = lines.times.subarray(first, after), i = lastAt(times, t), points = lines.points;
    if (lines.cut === "past" ? i < 0 : i >= times.length - 1) continue;
    const here = () => {
      if (i < 0) return [];
      const a = first + i, b = Math.min(a + 1, after - 1), s = b > a ? clamp((t - lines.times[a]) / (lines.times[b] - lines.times[a]), 0, 1) : 0;
      return [0, 1, 2].map((j) => points[3 * a + j] + s * (points[3 * b + j] - points[3 * a + j]));
    };
    const from = lines.cut === "past" ? first + Math.max(lastAt(times, t - lines.trail), 0) : 0;
    found.push({ points: lines.cut === "past" ? [...points.subarray(3 * from, 3 * (first + i + 1)), ...here()] : [...here(), ...points.subarray(3 * (first + i + 1), 3 * after)], opacity });
  }
  return found;
};

class Player {
  constructor(scene) {
    this.scene = scene; this.t = scene.embedded ? scene.duration : 0; this.playing = false; this.stale = true; this.drawn = 0;
    this.hidden = new Set(scene.layers.flatMap((layer, k) => (layer.shown ? [] : [k])));
    this.orbit = new Orbit(); this.camera = scene.cameras[0]; this.heading = null;
    scene.extent = this.extent();
    for (const each of [...scene.layers, ...scene.marks, ...scene.charts.flatMap((chart) => chart.series)]) each.colour = css(each.colour);
    $("title").textContent = scene.title; $("note").textContent = scene.note;
    for (const [name, value] of scene.facts) {
      const pair = document.createElement("div"), term = document.createElement("dt"), words = document.createElement("dd");
      term.textContent = name; words.textContent = value; pair.append(term, words); $("facts").append(pair);
    }
    this.charts = scene.charts.map((chart) => new TimeChart(chart, scene.duration, (t) => this.seek(t), (begin, end) => this.zoom(begin, end)));
    for (const chart of this.charts) chart.again = () => this.change();
    $("whole").addEventListener("click", () => this.zoom(0, scene.duration));
    $("charts").append(...this.charts.map((chart) => chart.figure));
    if (scene.cameras.length) this.setStage(); else $("app").classList.add("flat");
    this.setBar(); this.setLegend(); this.setChoice();
    if (scene.live) this.live = new Live(this, scene.live);
    new ResizeObserver(() => this.change(true)).observe($("app"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.change(true));
    requestAnimationFrame((clock) => this.tick(clock));
  }
  extent() {
    let low = Infinity, high = -Infinity;
    for (const { pos } of Object.values(this.scene.motions)) for (let k = 0; k < pos.length; k++) { low = Math.min(low, pos[k]); high = Math.max(high, pos[k]); }
    for (const { vertices, motion, checker } of this.scene.surfaces) if (motion === null && !checker) for (let k = 0; k < vertices.length; k += 7) { low = Math.min(low, vertices[k]); high = Math.max(high, vertices[k]); }
    return high > low ? high - low : 1;
  }
  setStage() {
    try {
      this.stage = new Stage($("canvas"), this.scene);
    } catch (error) { $("problem").textContent = error.message; $("problem").hidden = false; return; }
    this.labels = new Labels($("labels"), this.scene.marks);
    for (const [k, camera] of this.scene.cameras.entries()) $("camera").add(new Option(camera.name, k));
    $("camera").addEventListener("change", () => { this.choose(this.scene.cameras[$("camera").value]); });
    this.choose(this.camera);
    this.stage.waiting?.then(() => this.change());
    const canvas = $("canvas"), held = new Map();
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    let entered = !this.scene.embedded; // the wheel moves the report until the scene has been clicked into
    canvas.addEventListener("pointerleave", () => { entered = !this.scene.embedded; });
    canvas.addEventListener("pointerdown", (event) => { entered = true; canvas.setPointerCapture(event.pointerId); held.set(event.pointerId, [event.clientX, event.clientY]); });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (event) => held.delete(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before || !this.view) return;
      const across = event.clientX - before[0], along = event.clientY - before[1], metres = 2 * this.view.tangent * (this.view.away ?? this.orbit.distance) / canvas.clientHeight;
      if (held.size === 2) {
        const [other] = [...held].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
        this.orbit.zoom(Math.hypot(other[0] - before[0], other[1] - before[1]) / Math.max(1, Math.hypot(other[0] - event.clientX, other[1] - event.clientY)));
      } else if (event.buttons & 2 || event.shiftKey) this.orbit.move(this.view, across * metres, along * metres);
      else this.orbit.turn(0.006 * across, 0.006 * along);
      held.set(event.pointerId, [event.clientX, event.clientY]); this.change();
    });
    canvas.addEventListener("wheel", (event) => { if (!entered) return; event.preventDefault(); this.orbit.zoom(Math.exp(0.0012 * clamp(event.deltaY, -300, 300))); this.change(); }, { passive: false });
  }
  choose(camera) { this.camera = camera; this.orbit.take(camera); this.heading = null; this.change(); }
  setBar() {
    const speeds = speedsWith(this.scene.speed);
    for (const speed of speeds) $("speed").add(new Option(`${speed} ×`, speed));
    $("play").addEventListener("click", () => this.play(!this.playing));
    $("scrub").max = this.scene.duration; $("scrub").addEventListener("input", () => this.seek(Number($("scrub").value)));
    (this.scene.embedded ? $("app") : window).addEventListener("keydown", (event) => {
      if (["SELECT", "INPUT", "BUTTON", "SUMMARY"].includes(event.target.tagName) && event.key !== "Escape") return;
      if (event.key === " ") { event.preventDefault(); this.play(!this.playing); }
      if (event.key === "ArrowRight" || event.key === "ArrowLeft") this.seek(this.t + (event.key === "ArrowRight" ? 0.02 : -0.02) * this.scene.duration);
    });
    const wanted = this.scene.speed ?? Math.max(1, this.scene.duration / 30); // half a minute for the whole run
    $("speed").value = speeds.find((each) => each >= wanted - 1e-9) ?? speeds.at(-1);
    this.setTicks(); $("bar").hidden = !this.scene.duration;
  }
  setTicks() {
    $("ticks").replaceChildren(...this.scene.events.map(([t, words, alarm]) => {
      const tick = document.createElement("i"); tick.style.left = `${100 * t / this.scene.duration}%`; tick.title = words; tick.className = alarm ? "alarm" : ""; return tick;
    }));
  }
  setLegend() {
    const list = $("legend").querySelector("ul");
    for (const [k, layer] of this.scene.layers.entries()) {
      const label = document.createElement("label"), box = document.createElement("input"), item = document.createElement("li");
      box.type = "checkbox"; box.checked = layer.shown;
      box.addEventListener("change", () => { if (box.checked) this.hidden.delete(k); else this.hidden.add(k); this.change(); });
      const swatch = document.createElementNS("http://www.w3.org/2000/svg", "svg"), line = document.createElementNS("http://www.w3.org/2000/svg", "line");
      for (const [name, value] of Object.entries({ x1: 1, x2: 21, y1: 5, y2: 5, stroke: layer.colour, "stroke-width": 4, "stroke-dasharray": layer.dashed ? "5 3" : "none" })) line.setAttribute(name, value);
      swatch.append(line); label.append(box, swatch, layer.name); item.append(label); list.append(item);
    }
    $("legend").hidden = !this.scene.layers.length;
    if (innerWidth < 700) $("legend").open = false;
  }
  // The charts that the reader has chosen, by name, stay in the address: a link to it, or the page of another run with
  // the same end of its address, shows the same ones.
  setChoice() {
    const { charts } = this.scene, list = $("chosen").querySelector("ul"), names = charts.map(({ title, unit }) => (unit ? `${title} [${unit}]` : title));
    const boxes = names.map((name) => {
      const label = document.createElement("label"), box = document.createElement("input"), item = document.createElement("li");
      box.type = "checkbox"; label.append(box, name); item.append(label); list.append(item);
      return box;
    });
    const show = () => { boxes.forEach((box, k) => { this.charts[k].figure.hidden = !box.checked; }); this.change(true); };
    const read = () => {
      const wanted = new Set(new URLSearchParams(location.hash.slice(1)).getAll("chart")), some = names.some((name) => wanted.has(name));
      boxes.forEach((box, k) => { box.checked = !some || wanted.has(names[k]); });
      show();
    };
    list.addEventListener("change", () => {
      const kept = names.filter((name, k) => boxes[k].checked);
      if (!kept.length) boxes.forEach((box) => { box.checked = true; }); // of none there would be nothing to see
      const chosen = kept.length && kept.length < names.length ? kept : [];
      location.replace(`#${new URLSearchParams(chosen.map((name) => ["chart", name]))}`); show();
    });
    addEventListener("hashchange", read);
    $("chosen").hidden = charts.length < 2 || this.scene.embedded; if (!$("chosen").hidden) read();
  }
  play(playing) {
    if (this.live?.plays(playing)) return;
    if (playing && this.t >= this.scene.duration - 1e-9) this.t = 0;
    this.playing = playing; this.clock = null;
    $("play").setAttribute("aria-label", playing ? "pause" : "play"); this.change();
  }
  // Let all charts show a stretch of time.
  zoom(begin, end) {
    for (const chart of this.charts) { chart.begin = begin; chart.end = end; }
    $("whole").hidden = begin <= 0 && end >= this.scene.duration; this.change(true);
  }
  seek(t) { if (this.live) this.live.following = false; this.t = clamp(t, 0, this.scene.duration); this.change(); }
  change(stale = false) { this.stale ||= stale; this.changed = true; }
  tick(clock) {
    if (this.live?.following) this.live.keepUp(clock);
    else if (this.playing) {
      if (this.clock !== null) this.t += Math.min(clock - this.clock, 250) / 1000 * Number($("speed").value);
      this.clock = clock; this.changed = true;
      if (this.t >= this.scene.duration) { this.t = this.scene.duration; this.play(false); }
    }
    if (this.changed) { this.changed = false; this.draw(); }
    requestAnimationFrame((next) => this.tick(next));
  }
  draw() {
    const { t, scene } = this;
    for (const chart of this.charts) chart.draw(t, this.stale);
    this.stale = false;
    $("scrub").value = t; $("time").textContent = `${t.toFixed(scene.duration < 20 ? 2 : 1)} of ${scene.duration.toFixed(scene.duration < 20 ? 2 : 1)} s`;
    const held = HELD * Math.max(Number($("speed").value), scene.duration / 200), recent = scene.events.filter(([at]) => at <= t + 1e-6 && at > t - held);
    const shown = recent.findLast(([, , alarm]) => alarm) ?? recent.at(-1); // an alarm stays over the routine after it
    $("event").textContent = shown ? `${shown[0].toFixed(1)} s: ${shown[1]}` : ""; $("event").className = shown?.[2] ? "alarm" : "";
    if (this.stage) this.drawStage();
    document.body.dataset.drawn = ++this.drawn;
  }
  drawStage() {
    const { t, scene, camera } = this, size = this.stage.resize(), canvas = $("canvas");
    const tall = camera.tall, raised = (p) => [p[0], p[1], scene.low + tall * (p[2] - scene.low)];
    const poses = Object.fromEntries(Object.entries(scene.motions).map(([name, motion]) => [name, poseAt(motion, t)]));
    const leader = camera.follow ? poses[camera.follow] : null;
    if (leader) this.leader = leader; else if (!camera.follow) this.leader = null;
    const about = camera.follow && this.leader ? raised(this.leader.pos) : [0, 0, 0];
    this.view = camera.mounted
      ? mountedView(camera, leader ?? this.leader ?? { pos: [0, 0, 0], quat: [1, 0, 0, 0] }, size.width / size.height, 0.002 * scene.extent, 8 * scene.extent)
      : this.orbit.view(about, camera.behind && camera.follow ? this.course(camera, t) : 0, size.width / size.height, 6 * scene.extent, camera.framed ?? 0);
    const shows = (layer) => !this.hidden.has(layer), lines = [];
    for (const own of scene.lines) if (shows(own.layer)) lines.push({ ...own, polylines: polylinesAt(own.motion ? { ...own, points: scene.motions[own.motion].pos, times: scene.motions[own.motion].t, offsets: [0, scene.motions[own.motion].t.length] } : own, t) });
    for (const pose of Object.values(poses)) if (pose?.ground != null) lines.push({ colour: [1, 1, 1], width: 1.5, dashed: false, polylines: [{ points: [pose.pos[0], pose.pos[1], pose.ground, ...pose.pos], opacity: 0.8 }] });
    for (const mark of scene.marks) if (mark.foot !== null && mark.place && shows(mark.layer)) lines.push({ colour: [1, 1, 1], width: 1.5, dashed: false, polylines: [{ points: [mark.place[0], mark.place[1], mark.foot, ...mark.place], opacity: 0.9 }] });
    const pixel = 2 * this.view.tangent * (this.view.away ?? this.orbit.distance) / size.height; // [m] at the middle
    const now = { size, canvas, view: this.view, tall, raised, poses, shows, lines, pixel, span: camera.span };
    this.stage.draw(now); this.labels.draw(now); this.drawScale(now);
  }
  // A bar of a round length in the middle of the picture, north, and by how much heights are exaggerated.
  drawScale({ view, tall, canvas }) {
    $("scale").hidden = Boolean(this.camera.mounted) || this.scene.extent <= 0;
    if ($("scale").hidden) return;
    const metres = 2 * view.tangent * view.away / canvas.clientHeight, most = 0.22 * Math.min(canvas.clientWidth, 500) * metres, long = roundStep(most / 2, 1);
    const words = long >= 1000 ? `${long / 1000} km` : long >= 1 ? `${long} m` : long >= 0.01 ? `${Math.round(100 * long)} cm` : `${+(1000 * long).toPrecision(1)} mm`;
    const [bar, length, arrow, high] = $("scale").children;
    bar.style.width = `${(long / metres).toFixed(1)}px`; length.textContent = words; high.textContent = tall === 1 ? "" : `heights × ${tall}`;
    arrow.style.display = this.scene.floor === null ? "" : "none"; // on a floor y is no north
    arrow.style.rotate = `${Math.atan2(view.right[1], view.forward[1] / Math.hypot(view.forward[0], view.forward[1]))}rad`;
  }
  // The direction of flight, averaged over `behind` seconds before and after.
  course(camera, t) {
    const motion = this.scene.motions[camera.follow], at = (s) => poseAt({ ...motion, shown: [[-1e30, 1e30]] }, s).pos;
    const a = at(t - camera.behind), b = at(t + camera.behind);
    if (Math.hypot(b[0] - a[0], b[1] - a[1]) > 1e-6 * this.scene.extent) this.heading = Math.atan2(b[1] - a[1], b[0] - a[0]);
    return this.heading ?? 0;
  }
}

