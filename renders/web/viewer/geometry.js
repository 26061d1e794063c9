// Vectors, quaternions, matrices (column by column) and the camera that turns about a point.
"use strict";
const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const n = Math.hypot(...a) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const radians = (degrees) => degrees * Math.PI / 180;

const multiply = (a, b) => {
  const c = new Float32Array(16);
  for (let j = 0; j < 4; j++) for (let i = 0; i < 4; i++) for (let k = 0; k < 4; k++) c[4 * j + i] += a[4 * k + i] * b[4 * j + k];
  return c;
};
const perspective = (fieldOfView, aspect, near, far) => {
  const f = 1 / Math.tan(fieldOfView / 2), d = 1 / (near - far);
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) * d, -1, 0, 0, 2 * near * far * d, 0]);
};
const lookAlong = (eye, right, up, back) => new Float32Array([
  right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
  -dot(right, eye), -dot(up, eye), -dot(back, eye), 1]);

// A frame at a place, turned by a quaternion, drawn larger.
const frame = (p, q, scale) => {
  const [w, x, y, z] = q, s = scale;
  return new Float32Array([
    s * (1 - 2 * (y * y + z * z)), s * 2 * (x * y + w * z), s * 2 * (x * z - w * y), 0,
    s * 2 * (x * y - w * z), s * (1 - 2 * (x * x + z * z)), s * 2 * (y * z + w * x), 0,
    s * 2 * (x * z + w * y), s * 2 * (y * z - w * x), s * (1 - 2 * (x * x + y * y)), 0,
    p[0], p[1], p[2], 1]);
};
const WORLD = frame([0, 0, 0], [1, 0, 0, 0], 1);

// A vector turned by a quaternion, and the product of two quaternions.
const turnedBy = ([w, x, y, z], p) => { const twice = cross([x, y, z], p).map((each) => 2 * each); return add(add(p, twice, w), cross([x, y, z], twice)); };
const quaternionProduct = ([a, b, c, d], [e, f, g, h]) => [a * e - b * f - c * g - d * h, a * f + b * e + c * h - d * g, a * g - b * h + c * e + d * f, a * h + b * g - c * f + d * e];
// The view of a camera of the model, mounted at a pose in a frame: it looks along its own -z, with y upwards.
const mountedView = (camera, pose, aspect, near, far) => {
  const quat = quaternionProduct(pose.quat, camera.mounted.quat), eye = add(pose.pos, turnedBy(pose.quat, camera.mounted.pos));
  const [right, up, back] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => unit(turnedBy(quat, axis))), angle = radians(camera.field_of_view);
  const matrix = multiply(perspective(angle, aspect, near, far), lookAlong(eye, right, up, back));
  return { eye, forward: back.map((each) => -each), right, up, matrix, tangent: Math.tan(angle / 2) };
};

// Index of the last of the times at or before t; -1 before the first.
const lastAt = (times, t) => {
  let low = 0, high = times.length;
  while (low < high) { const middle = (low + high) >> 1; if (times[middle] <= t + 1e-6) low = middle + 1; else high = middle; }
  return low - 1;
};

// A camera's state: what it looks at, from where; angles in radians.
class Orbit {
  constructor() { this.target = [0, 0, 0]; this.distance = 1; this.azimuth = 0; this.elevation = 0; this.fieldOfView = 1; }
  take(camera) {
    this.target = [...camera.target]; this.distance = camera.distance; this.fieldOfView = radians(camera.field_of_view);
    this.azimuth = radians(camera.azimuth); this.elevation = radians(camera.elevation);
  }
  turn(across, along) { this.azimuth -= across; this.elevation = clamp(this.elevation - along, -1.5706, 1.2); }
  zoom(factor) { this.distance *= factor; }
  // Matrices and axes about a point that it follows; `far` is how far away something may be seen.
  // A camera that frames something does so in a picture of the shape `framed`; in a narrower one it stands further away.
  view(about, turned, aspect, far, framed = 0) {
    const away = this.distance * Math.max(1, framed / aspect);
    const azimuth = this.azimuth + turned, c = Math.cos(this.elevation);
    const forward = [c * Math.cos(azimuth), c * Math.sin(azimuth), Math.sin(this.elevation)];
    const right = [Math.sin(azimuth), -Math.cos(azimuth), 0], up = cross(right, forward);
    const centre = add(about, this.target), eye = add(centre, forward, -away);
    const near = Math.max(away * 0.02, far * 2e-5);
    const matrix = multiply(perspective(this.fieldOfView, aspect, near, far + 2 * away), lookAlong(eye, right, up, forward.map((x) => -x)));
    return { eye, forward, right, up, matrix, tangent: Math.tan(this.fieldOfView / 2), away };
  }
  // Where a drag moves the point in the middle.
  move(view, across, along) { this.target = add(add(this.target, view.right, -across), view.up, along); }
}
