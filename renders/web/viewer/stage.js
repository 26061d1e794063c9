// The scene drawn by WebGL 2: surfaces, shadows on a level floor, lines of a width in pixels.
const SURFACE = {
  vertex: `#version 300 es
    uniform mat4 uView, uFrame; uniform float uTall, uLow; uniform vec4 uFlat; uniform vec4 uBox;
    in vec3 aPlace; in vec3 aNormal; out vec3 vPlace, vNormal; out vec2 vPicture;
    void main() {
      vec4 world = uFrame * vec4(aPlace, 1.0);
      vPicture = (world.xy - uBox.xy) / (uBox.zw - uBox.xy);
      world.z = uLow + uTall * (world.z - uLow);
      if (uFlat.w > 0.0) { world.xy += uFlat.xy * (world.z - uFlat.z); world.z = uFlat.z; }
      vPlace = world.xyz; vNormal = mat3(uFrame) * aNormal;
      gl_Position = uView * world;
    }`,
  fragment: `#version 300 es
    precision highp float;
    uniform vec4 uColour; uniform vec3 uEye, uSun; uniform float uGlow, uChecker; uniform bool uSmooth, uPictured; uniform sampler2D uPicture;
    in vec3 vPlace, vNormal; in vec2 vPicture; out vec4 colour;
    void main() {
      vec3 normal = uSmooth ? normalize(vNormal) : normalize(cross(dFdx(vPlace), dFdy(vPlace)));
      vec3 sight = normalize(uEye - vPlace);
      if (dot(normal, sight) < 0.0) normal = -normal;
      float light = mix(0.50 + 0.14 * normal.z + 0.42 * max(dot(normal, uSun), 0.0), 1.0, uGlow);
      vec3 own = uPictured ? texture(uPicture, vPicture).rgb : uColour.rgb;
      if (uChecker > 0.0) {
        vec2 square = vPlace.xy / uChecker, width = fwidth(square);
        vec2 odd = clamp((abs(fract(square * 0.5) - 0.5) - 0.25) / max(width, 1e-6) * 2.0, -0.5, 0.5);
        float fine = clamp(1.0 - max(width.x, width.y), 0.0, 1.0);
        own *= 1.0 + 0.10 * fine * (odd.x * odd.y) * 2.0;
      }
      colour = vec4(own * light, uColour.a);
    }`,
};
const LINE = {
  vertex: `#version 300 es
    uniform mat4 uView; uniform vec2 uSize; uniform float uTall, uLow, uWidth, uNearer;
    in vec2 aCorner; in vec4 aFrom, aTo; in float aOpacity; out vec2 vAlong; out float vLength, vPixels, vOpacity, vDistance;
    void main() {
      vec4 a = uView * vec4(aFrom.xy, uLow + uTall * (aFrom.z - uLow), 1.0), b = uView * vec4(aTo.xy, uLow + uTall * (aTo.z - uLow), 1.0);
      float least = 1e-4;
      if (a.w < least && b.w < least) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
      if (a.w < least) a = mix(a, b, (least - a.w) / (b.w - a.w)); else if (b.w < least) b = mix(b, a, (least - b.w) / (a.w - b.w));
      vec2 p = a.xy / a.w * uSize * 0.5, q = b.xy / b.w * uSize * 0.5, along = q - p;
      vLength = length(along); along = vLength > 1e-4 ? along / vLength : vec2(1.0, 0.0);
      vec2 across = vec2(-along.y, along.x); float reach = 0.5 * uWidth + 1.0;
      vec4 end = aCorner.x < 0.5 ? a : b;
      vec2 place = (aCorner.x < 0.5 ? p - along * reach : q + along * reach) + across * reach * aCorner.y;
      vAlong = vec2(dot(place - p, along), reach * aCorner.y); vPixels = uWidth; vOpacity = aOpacity;
      vDistance = mix(aFrom.w, aTo.w, aCorner.x);
      gl_Position = vec4(place / uSize * 2.0 * end.w, end.z - uNearer * end.w, end.w);
    }`,
  fragment: `#version 300 es
    precision highp float;
    uniform vec4 uColour; uniform float uDash;
    in vec2 vAlong; in float vLength, vPixels, vOpacity, vDistance; out vec4 colour;
    void main() {
      float past = max(max(-vAlong.x, vAlong.x - vLength), 0.0), edge = 0.5 * vPixels - length(vec2(past, vAlong.y)) + 0.5;
      if (edge <= 0.0 || (uDash > 0.0 && fract(vDistance / uDash) > 0.55)) discard;
      colour = vec4(uColour.rgb, uColour.a * vOpacity * clamp(edge, 0.0, 1.0));
    }`,
};
const SKY = {
  vertex: `#version 300 es
    in vec2 aCorner; out float vUp; void main() { vUp = 0.5 * aCorner.y + 0.5; gl_Position = vec4(aCorner, 0.999999, 1.0); }`,
  fragment: `#version 300 es
    precision highp float; uniform vec3 uHorizon, uZenith; in float vUp; out vec4 colour;
    void main() { colour = vec4(mix(uHorizon, uZenith, 0.75 * vUp * vUp), 1.0); }`,
};
const SUN = unit([-0.45, -0.35, 0.82]);
const STRIDE = 9; // numbers of a segment of a line: from, to (place and length so far), opacity

const normalsOf = (vertices, faces) => {
  const normals = new Float32Array(vertices.length), at = (k) => [vertices[3 * k], vertices[3 * k + 1], vertices[3 * k + 2]];
  for (let f = 0; f < faces.length; f += 3) {
    const corner = [faces[f], faces[f + 1], faces[f + 2]], [a, b, c] = corner.map(at), n = cross(add(b, a, -1), add(c, a, -1));
    for (const k of corner) for (let i = 0; i < 3; i++) normals[3 * k + i] += n[i];
  }
  return normals;
};

class Stage {
  constructor(canvas, scene) {
    this.canvas = canvas; this.scene = scene;
    const gl = this.gl = canvas.getContext("webgl2", { antialias: true, stencil: true, alpha: false, preserveDrawingBuffer: scene.embedded });
    if (!gl) throw new Error("this browser has no WebGL 2, which the scene needs; the charts are beside it");
    this.programs = { surface: this.program(SURFACE), line: this.program(LINE), sky: this.program(SKY) };
    this.sky = this.skyArray();
    this.surfaces = scene.surfaces.map((surface) => this.surface(surface));
    this.segments = gl.createBuffer();
    this.lineArray = this.linesArray();
    this.scratch = new Float32Array(1024 * STRIDE);
  }
  program({ vertex, fragment }) {
    const gl = this.gl, made = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source); gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    const uniforms = {}, count = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS);
    for (let k = 0; k < count; k++) { const { name } = gl.getActiveUniform(made, k); uniforms[name] = gl.getUniformLocation(made, name); }
    return { made, uniforms, attribute: (name) => gl.getAttribLocation(made, name) };
  }
  buffered(program, attributes) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    for (const [name, values, size] of attributes) {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer()); gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
      const at = program.attribute(name);
      if (at >= 0) { gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, size, gl.FLOAT, false, 0, 0); }
    }
    return array;
  }
  skyArray() { return this.buffered(this.programs.sky, [["aCorner", new Float32Array([-1, -1, 3, -1, -1, 3]), 2]]); }
  surface(own) {
    const gl = this.gl, array = this.buffered(this.programs.surface, [["aPlace", own.vertices, 3], ["aNormal", normalsOf(own.vertices, own.faces), 3]]);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer()); gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, own.faces, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    const texture = own.picture ? this.texture(own.picture, own.tiled) : null;
    return { ...own, array, texture, count: own.faces.length };
  }
  texture(bytes, tiled) {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array([150, 150, 145, 255]));
    this.waiting = (this.waiting ?? Promise.resolve()).then(async () => {
      const picture = await createImageBitmap(new Blob([bytes]), { imageOrientation: "flipY" });
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
      gl.generateMipmap(gl.TEXTURE_2D);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, tiled ? gl.REPEAT : gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, tiled ? gl.REPEAT : gl.CLAMP_TO_EDGE);
      const sharp = gl.getExtension("EXT_texture_filter_anisotropic");
      if (sharp) gl.texParameterf(gl.TEXTURE_2D, sharp.TEXTURE_MAX_ANISOTROPY_EXT, 8);
    });
    return texture;
  }
  linesArray() {
    const gl = this.gl, program = this.programs.line;
    const array = this.buffered(program, [["aCorner", new Float32Array([0, -1, 1, -1, 0, 1, 1, 1]), 2]]);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.segments);
    for (const [name, size, first] of [["aFrom", 4, 0], ["aTo", 4, 4], ["aOpacity", 1, 8]]) {
      const at = program.attribute(name);
      gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, size, gl.FLOAT, false, 4 * STRIDE, 4 * first); gl.vertexAttribDivisor(at, 1);
    }
    gl.bindVertexArray(null);
    return array;
  }
  resize() {
    const ratio = Math.min(devicePixelRatio || 1, 2), { canvas } = this;
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
    return { width, height, ratio };
  }
  // Draw the scene as `now` has it: view, tall, span [m] by distance, poses of motions, layers that are shown, lines.
  draw(now) {
    const gl = this.gl, { width, height } = now.size;
    gl.viewport(0, 0, width, height); gl.disable(gl.BLEND); gl.disable(gl.STENCIL_TEST); gl.depthMask(true); gl.colorMask(true, true, true, true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    const { made, uniforms } = this.programs.sky;
    gl.disable(gl.DEPTH_TEST); gl.useProgram(made); gl.uniform3fv(uniforms.uHorizon, this.scene.sky[0]); gl.uniform3fv(uniforms.uZenith, this.scene.sky[1]);
    gl.bindVertexArray(this.sky); gl.drawArrays(gl.TRIANGLES, 0, 3); gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LEQUAL);

    const shown = this.surfaces.filter((own) => now.shows(own.layer) && (own.motion === null || now.poses[own.motion]));
    const clear = shown.filter((own) => own.opacity < 1);
    this.beginSurfaces(now);
    for (const own of shown) if (own.opacity >= 1) this.drawSurface(own, now);
    if (this.scene.floor !== null) this.drawShadows(shown.filter((own) => own.shadow), now);
    gl.enable(gl.BLEND); gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.drawLines(now);
    this.beginSurfaces(now); gl.enable(gl.BLEND);
    gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(1, 2);
    for (const own of clear) {
      gl.colorMask(false, false, false, false); gl.depthMask(true); this.drawSurface(own, now);
      gl.colorMask(true, true, true, true); this.drawSurface(own, now);
    }
    gl.disable(gl.POLYGON_OFFSET_FILL); gl.bindVertexArray(null);
  }
  beginSurfaces(now) {
    const gl = this.gl, { made, uniforms } = this.programs.surface;
    gl.useProgram(made); gl.uniformMatrix4fv(uniforms.uView, false, now.view.matrix); gl.uniform3fv(uniforms.uEye, now.view.eye);
    gl.uniform3fv(uniforms.uSun, SUN); gl.uniform1f(uniforms.uLow, this.scene.low); gl.uniform4f(uniforms.uFlat, 0, 0, 0, 0); gl.uniform1i(uniforms.uPicture, 0);
  }
  drawSurface(own, now, colour) {
    const gl = this.gl, { uniforms } = this.programs.surface, pose = own.motion === null ? null : now.poses[own.motion];
    let matrix = WORLD;
    if (pose) {
      const place = now.raised(pose.pos);
      let scale = 1, at = own.tall ? pose.pos : place;
      if (own.span > 0) {
        const sight = add(now.view.eye, place, -1), distance = Math.max(-dot(sight, now.view.forward), 1e-6), wanted = now.span * 2 * now.view.tangent * distance;
        if (wanted > own.span) { // drawn so large it would stick in the ground: it is drawn nearer to the eye, and smaller
          const nearer = Math.min(wanted / distance, 0.5);
          at = add(place, sight, nearer); scale = (1 - nearer) * wanted / own.span;
        }
      }
      matrix = frame(at, pose.quat, scale);
    }
    gl.uniformMatrix4fv(uniforms.uFrame, false, matrix);
    gl.uniform1f(uniforms.uTall, own.tall ? now.tall : 1);
    gl.uniform4fv(uniforms.uColour, colour ?? [...own.colour, own.opacity]);
    gl.uniform1f(uniforms.uGlow, own.glow); gl.uniform1f(uniforms.uChecker, own.tiled ? 0 : own.checker); gl.uniform1i(uniforms.uSmooth, own.smooth ? 1 : 0);
    gl.uniform1i(uniforms.uPictured, own.texture ? 1 : 0); gl.uniform4fv(uniforms.uBox, own.picture_box);
    if (own.texture) { gl.activeTexture(gl.TEXTURE0); gl.bindTexture(gl.TEXTURE_2D, own.texture); }
    gl.bindVertexArray(own.array); gl.drawElements(gl.TRIANGLES, own.count, gl.UNSIGNED_INT, 0);
  }
  // What casts a shadow is drawn once more, flat on the floor; the stencil darkens every pixel once.
  drawShadows(surfaces, now) {
    const gl = this.gl, { uniforms } = this.programs.surface, away = [-SUN[0] / SUN[2], -SUN[1] / SUN[2]];
    gl.uniform4f(uniforms.uFlat, away[0], away[1], this.scene.floor + 1e-4 * this.scene.extent, 1);
    gl.enable(gl.STENCIL_TEST); gl.stencilFunc(gl.EQUAL, 0, 0xff); gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    gl.enable(gl.BLEND); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA); gl.depthMask(false);
    gl.enable(gl.POLYGON_OFFSET_FILL); gl.polygonOffset(-1, -4);
    for (const own of surfaces) this.drawSurface({ ...own, smooth: true, glow: 1 }, now, [0.05, 0.08, 0.14, 0.22]);
    gl.disable(gl.POLYGON_OFFSET_FILL); gl.disable(gl.STENCIL_TEST); gl.depthMask(true); gl.uniform4f(uniforms.uFlat, 0, 0, 0, 0);
  }
  drawLines(now) {
    const gl = this.gl, { made, uniforms } = this.programs.line, { width, height, ratio } = now.size;
    gl.useProgram(made); gl.bindVertexArray(this.lineArray); gl.depthMask(false);
    gl.uniformMatrix4fv(uniforms.uView, false, now.view.matrix); gl.uniform2f(uniforms.uSize, width, height);
    gl.uniform1f(uniforms.uTall, now.tall); gl.uniform1f(uniforms.uLow, this.scene.low);
    for (const lines of now.lines) {
      const count = this.gather(lines.polylines);
      if (count === 0) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, this.segments); gl.bufferData(gl.ARRAY_BUFFER, this.scratch.subarray(0, STRIDE * count), gl.DYNAMIC_DRAW);
      gl.uniform4f(uniforms.uColour, ...lines.colour, 1); gl.uniform1f(uniforms.uWidth, lines.width * ratio); gl.uniform1f(uniforms.uNearer, 2e-4);
      gl.uniform1f(uniforms.uDash, lines.dashed ? 22 * ratio * now.pixel : 0);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    }
    gl.bindVertexArray(null); gl.depthMask(true);
  }
  gather(polylines) {
    let count = 0;
    for (const { points } of polylines) count += Math.max(0, points.length / 3 - 1);
    if (this.scratch.length < STRIDE * count) this.scratch = new Float32Array(2 * STRIDE * count);
    let at = 0;
    for (const { points, opacity } of polylines) {
      let length = 0;
      for (let k = 3; k < points.length; k += 3) {
        const step = Math.hypot(points[k] - points[k - 3], points[k + 1] - points[k - 2], points[k + 2] - points[k - 1]), s = this.scratch;
        s[at] = points[k - 3]; s[at + 1] = points[k - 2]; s[at + 2] = points[k - 1]; s[at + 3] = length; length += step;
        s[at + 4] = points[k]; s[at + 5] = points[k + 1]; s[at + 6] = points[k + 2]; s[at + 7] = length; s[at + 8] = opacity; at += STRIDE;
      }
    }
    return count;
  }
}
