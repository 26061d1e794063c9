// A run that is being simulated, or a page without: asks the server what is new, and sends what its reader changes.
const EVERY = 250; // [ms] between questions
const VIEW = "view"; // under which a page that is loaded anew finds how it was looked at

class Live {
  constructor(player, { controls, generation }) {
    this.player = player; this.generation = generation; this.next = 0; this.following = true; this.paused = false; this.latest = 0;
    this.token = new URLSearchParams(location.search).get("token");
    this.setControls(controls); this.restoreView();
    addEventListener("pagehide", () => { const { orbit, camera } = player; sessionStorage.setItem(VIEW, JSON.stringify({ name: camera.name, orbit })); });
    $("speed").parentElement.hidden = true; $("play").setAttribute("aria-label", "pause");
    this.ask();
  }
  url(path, more = {}) { const query = new URLSearchParams({ ...more, ...(this.token ? { token: this.token } : {}) }); return `${path}?${query}`; }
  restoreView() {
    const kept = JSON.parse(sessionStorage.getItem(VIEW) ?? "null"), k = this.player.scene.cameras.findIndex((camera) => camera.name === kept?.name);
    if (k < 0) return;
    $("camera").value = k; this.player.choose(this.player.scene.cameras[k]); Object.assign(this.player.orbit, kept.orbit);
  }
  setControls(controls) {
    const form = $("controls"), title = document.createElement("h2");
    title.textContent = "this run"; form.append(title); form.hidden = false;
    this.state = document.createElement("p"); this.state.id = "state"; form.append(this.state);
    for (const { name, label, low, high, step, value, unit } of controls) {
      const row = document.createElement("label"), slider = document.createElement("input"), shown = document.createElement("output");
      Object.assign(slider, { type: "range", min: low, max: high, step, value, name }); slider.dataset.control = name;
      const show = () => { shown.textContent = `${Number(slider.value)} ${unit}`; };
      slider.addEventListener("input", show); slider.addEventListener("change", () => this.send({ [name]: Number(slider.value) })); show();
      row.append(label, slider, shown); form.append(row);
    }
  }
  async send(change) {
    const answer = await fetch(this.url("change"), { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(change) });
    if (!answer.ok) this.state.textContent = await answer.text();
  }
  // The button pauses the simulation; where the reader has gone back in time, it returns to the present.
  plays(playing) {
    if (!this.following) { this.following = true; this.player.change(); return true; }
    this.paused = !this.paused; this.send({ paused: this.paused });
    $("play").setAttribute("aria-label", this.paused ? "play" : "pause");
    return true;
  }
  async ask() {
    try {
      const answer = await fetch(this.url("news", { since: this.next }));
      if (!answer.ok) throw new Error(await answer.text());
      const news = await answer.json();
      if (news.generation !== this.generation || news.ended) { location.reload(); return; }
      this.take(news);
      setTimeout(() => this.ask(), EVERY);
    } catch (error) { this.state.textContent = "the simulation has ended, or its server cannot be reached"; this.player.playing = false; }
  }
  take(news) {
    const { scene } = this.player;
    this.state.textContent = news.state;
    if (!news.t.length) return;
    const first = this.next === 0, appended = (a, b) => { const c = new Float32Array((first ? 0 : a.length) + b.length); if (!first) c.set(a); c.set(b, c.length - b.length); return c; };
    this.next = news.next; this.latest = news.t.at(-1);
    for (const [name, [pos, quat]] of Object.entries(news.motions)) {
      const motion = scene.motions[name];
      motion.t = appended(motion.t, news.t); motion.pos = appended(motion.pos, pos); motion.quat = appended(motion.quat, quat);
    }
    for (const [k, chart] of scene.charts.entries()) for (const [j, own] of chart.series.entries()) {
      own.t = appended(own.t, news.t); own.y = appended(own.y, news.charts.map((values) => values[k][j] ?? NaN));
    }
    for (const lines of scene.lines) {
      const fresh = lines.plan && news.plans[lines.plan];
      if (!fresh) continue;
      lines.points = Float32Array.from(fresh.points); lines.times = Float32Array.from(fresh.times); lines.offsets = fresh.offsets;
    }
    scene.events = news.events; scene.duration = Math.max(this.latest, 1e-3);
    for (const chart of this.player.charts) { if (chart.end >= chart.duration) chart.end = scene.duration; chart.duration = scene.duration; }
    $("scrub").max = scene.duration; this.player.setTicks(); this.player.change(true);
  }
  // The present moves on evenly between two answers of the server.
  keepUp(clock) {
    const player = this.player, step = (this.latest - player.t) * (this.clock === undefined ? 1 : Math.min(1, (clock - this.clock) / (1.2 * EVERY)));
    this.clock = clock;
    if (this.latest - player.t > 1e-6) { player.t = this.latest - player.t < 1e-3 ? this.latest : player.t + step; player.changed = true; }
    if (player.t > this.latest) { player.t = this.latest; player.changed = true; }
  }
}

const packedScene = JSON.parse($("scene").textContent);
unpacked(packedScene.block).then((buffer) => { delete packedScene.block; window.player = new Player(withArrays(packedScene, buffer)); });
