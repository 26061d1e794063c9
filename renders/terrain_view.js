// Draws every 3-D terrain of the page. A view's JSON (renders/terrain_view.py) holds the ground's nodes packed, the other
// traces and the layout as plotly takes them; the theme's colours come from the page.
"use strict";
(() => {
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

  // Node (i, j) stands at (i, j) * step; a cell is cut along (i, j)-(i + 1, j + 1), as the ground is everywhere else.
  const groundTrace = ({ rows, columns, east_km, north_km, low_m, unit_m, heights, colours }) => {
    const packed = new Uint16Array(bytes(heights)), rgb = new Uint8Array(bytes(colours));
    const x = [], y = [], z = [], vertexcolor = [], i = [], j = [], k = [];
    for (let row = 0; row < rows; row++) {
      for (let column = 0; column < columns; column++) {
        const here = row * columns + column;
        x.push((east_km * column) / (columns - 1));
        y.push((north_km * row) / (rows - 1));
        z.push(low_m + unit_m * packed[here]);
        vertexcolor.push(`rgb(${rgb[3 * here]},${rgb[3 * here + 1]},${rgb[3 * here + 2]})`);
        if (row + 1 < rows && column + 1 < columns) {
          const across = here + columns + 1;
          i.push(here, here);
          j.push(here + 1, across);
          k.push(across, here + columns);
        }
      }
    }
    return { type: "mesh3d", name: "ground", x, y, z, i, j, k, vertexcolor };
  };

  const inTheme = (view) => {
    const page = getComputedStyle(document.documentElement);
    const [ink, soft] = ["--ink", "--soft"].map((name) => page.getPropertyValue(name));
    return Plotly.relayout(view, { "font.color": ink, "modebar.color": soft });
  };

  // The wheel scrolls the page until the view has been clicked into, then zooms, evenly, until the pointer leaves.
  const wheelZooms = (view) => {
    let entered = false;
    view.addEventListener("pointerdown", () => { entered = true; });
    view.addEventListener("pointerleave", () => { entered = false; });
    view.addEventListener("wheel", (event) => {
      event.stopPropagation();  // plotly's own zoom is through the mountain in three notches
      if (!entered) return;
      event.preventDefault();
      const { eye, center } = view.layout.scene.camera;
      const factor = Math.exp(0.001 * Math.max(-200, Math.min(200, event.deltaY)));
      const zoomed = Object.fromEntries(["x", "y", "z"].map((axis) => [axis, center[axis] + factor * (eye[axis] - center[axis])]));
      Plotly.relayout(view, { "scene.camera.eye": zoomed });
    }, { capture: true, passive: false });
  };

  // On a telephone the legend stands below the scene, whose labels are smaller: there is no room for both.
  const narrow = ({ legend, margin, scene, ...rest }) => ({
    ...rest,
    legend: { ...legend, orientation: "h", y: 0, yanchor: "top", font: { size: 11 } },
    margin: { ...margin, b: 60 },
    scene: {
      ...scene,
      annotations: scene.annotations.map((each) => ({ ...each, font: { ...each.font, size: 10 }, borderpad: 1 })),
    },
  });

  for (const view of document.querySelectorAll(".view")) {
    const { ground, ground_style, traces, layout } = JSON.parse(view.nextElementSibling.textContent);
    const config = { responsive: true, displaylogo: false, modeBarButtons: [["resetCameraDefault3d", "toImage"]] };
    wheelZooms(view);
    const fitting = matchMedia("(max-width: 600px)").matches ? narrow(layout) : layout;
    Plotly.newPlot(view, [{ ...groundTrace(ground), ...ground_style }, ...traces], fitting, config)
      .then(inTheme)
      .then(() => { view.dataset.drawn = "yes"; });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => inTheme(view));
  }
})();
