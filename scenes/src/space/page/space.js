// A room in 3-D: WebGL 2, drawn when something changes. What is in the room is the page's own, its scene:
//
//   marks(flat)  draws on the floor, into Triangles
//   bodies()     people, { x, y, radius, height, color, opacity }
//   labels()     texts in the air, { text, place, background, ink }

import { Triangles, capsule, cross, lookAt, minus, perspective, product, rgb, transformed, unit } from "/solids.js";

const FOV = 0.7;
const HEADER_BYTES = 28;
const DISC_BYTES = 12;
const RADIUS_BYTE = 8; // of a disc
const RADIUS_STEP_M = 0.002;
const MOST_PITCH = 1.5;
const KEYS = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] };

const DISCS = [`#version 300 es
  layout(location = 0) in vec3 steps; layout(location = 1) in vec2 folded; layout(location = 2) in float radius; layout(location = 3) in vec3 color;
  uniform mat4 view, projection; uniform vec3 low, step_m, eye; uniform float height_px;
  out vec3 tint; out vec3 normal;
  void main() {
    vec3 place = low + steps * step_m;
    vec3 n = vec3(folded, 1.0 - abs(folded.x) - abs(folded.y));
    float fold = max(-n.z, 0.0);
    n.xy -= vec2(n.x >= 0.0 ? fold : -fold, n.y >= 0.0 ? fold : -fold);
    n = normalize(n);
    vec4 seen = view * vec4(place, 1.0);
    // Surfaces that turn their back are left out, so that one looks into the room.
    if (dot(n, eye - place) < 0.0) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
    gl_Position = projection * seen;
    gl_PointSize = clamp(radius * 2.3 * projection[1][1] * 0.5 * height_px / gl_Position.w, 1.5, 64.0);
    normal = mat3(view) * n;
    tint = color * (0.78 + 0.22 * abs(dot(n, normalize(vec3(0.3, 0.5, 0.9)))));
  }`, `#version 300 es
  precision mediump float;
  in vec3 tint; in vec3 normal; out vec4 color;
  void main() {
    vec2 p = (gl_PointCoord * 2.0 - 1.0) * vec2(1.0, -1.0);
    float depth = -dot(normal.xy, p) / max(abs(normal.z), 0.25);
    if (dot(p, p) + depth * depth > 1.0) discard;
    color = vec4(tint, 1.0);
  }`];

const BODIES = [`#version 300 es
  layout(location = 0) in vec4 vertex;
  uniform mat4 view, projection; uniform vec2 place; uniform float radius, height;
  out vec3 normal;
  void main() {
    float lift = mix(radius, max(height - radius, radius), vertex.w);
    vec4 seen = view * vec4(vec3(place, lift) + vertex.xyz * radius, 1.0);
    normal = mat3(view) * vertex.xyz;
    gl_Position = projection * seen;
  }`, `#version 300 es
  precision mediump float;
  in vec3 normal; uniform vec4 tint; out vec4 color;
  void main() {
    float light = 0.62 + 0.38 * max(dot(normalize(normal), normalize(vec3(-0.4, 0.6, 0.7))), 0.0);
    color = vec4(tint.rgb * light, 1.0) * tint.a;
  }`];

const MARKS = [`#version 300 es
  layout(location = 0) in vec3 place; layout(location = 1) in vec4 color;
  uniform mat4 view, projection; uniform float lift; out vec4 tint;
  void main() {
    vec4 seen = view * vec4(place, 1.0);
    gl_Position = projection * seen;
    // The discs of the floor stand out of it by up to their radius: what lies on them is as near as if it were lifted.
    vec4 lifted = projection * (seen + vec4(0.0, 0.0, min(lift, -0.5 * seen.z), 0.0));
    gl_Position.z = lifted.z / lifted.w * gl_Position.w;
    tint = color;
  }`, `#version 300 es
  precision mediump float;
  in vec4 tint; out vec4 color;
  void main() { color = vec4(tint.rgb, 1.0) * tint.a; }`];

// A colour of the style sheet, with an opacity.
export function styleColor(name, opacity) {
  return [...rgb(getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim()), opacity];
}

export class Space {
  #pointers = new Map();
  #isDue = false;

  // Fills an element.
  constructor(element, scene) {
    Object.assign(this, { element, scene });
    this.canvas = document.createElement("canvas");
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.canvas.ariaLabel = "Room in 3-D. Drag to turn, wheel or pinch to zoom, right button or two fingers to move.";
    this.labels = document.createElement("div");
    this.labels.className = "labels";
    this.gl = this.canvas.getContext("webgl2", { antialias: true, alpha: true });
    element.classList.add("space");
    element.replaceChildren(this.canvas, this.labels);
    if (!this.gl) {
      const without = document.createElement("p");
      without.textContent = "This browser has no WebGL 2.";
      element.append(without);
      return;
    }
    this.#prepare();
    this.#listen();
    new ResizeObserver(() => this.redraw()).observe(this.canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw());
  }

  // `bounds` are the smallest and the largest corner of the shown floor, `cameras` have name, center and frustum, and
  // `surfaces` is the address of the room's surfaces, null without any.
  async load({ bounds: [low, high], cameras, surfaces }) {
    if (!this.cameras) {
      this.target = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, 0.6];
      this.whole = Math.hypot(high[0] - low[0], high[1] - low[1]);
      Object.assign(this, { yaw: -2.1, pitch: 0.85, distance: this.whole * 1.15 });
    }
    this.cameras = cameras;
    if (!this.gl) return;
    this.redraw();
    const response = surfaces && await fetch(surfaces);
    if (response?.ok) this.#take(await response.arrayBuffer());
    this.redraw();
  }

  redraw() {
    if (this.#isDue || !this.gl || !this.cameras || this.element.hidden) return;
    this.#isDue = true;
    requestAnimationFrame(() => {
      this.#isDue = false;
      this.#draw();
    });
  }

  #program([vertex, fragment]) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const places = new Map();
    return { program, at: (name) => places.get(name) ?? places.set(name, gl.getUniformLocation(program, name)).get(name) };
  }

  #array(data, attributes, stride) {
    const { gl } = this;
    const [array, buffer] = [gl.createVertexArray(), gl.createBuffer()];
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    if (data) gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    attributes.forEach(([size, type, isNormalised, offset], i) => {
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, type, isNormalised, stride, offset);
    });
    return { array, buffer };
  }

  #prepare() {
    const { gl } = this;
    Object.assign(this, { discs: this.#program(DISCS), bodies: this.#program(BODIES), marks: this.#program(MARKS) });
    this.body = capsule();
    this.bodyArray = this.#array(this.body, [[4, gl.FLOAT, false, 0]], 16);
    this.markArray = this.#array(null, [[3, gl.FLOAT, false, 0], [4, gl.FLOAT, false, 12]], 28);
    this.count = 0;
    this.lift = 0.01;
  }

  #take(bytes) {
    const { gl } = this;
    const header = new DataView(bytes);
    this.count = header.getUint32(0, true);
    const floats = (at) => [0, 4, 8].map((i) => header.getFloat32(at + i, true));
    Object.assign(this, { low: floats(4), step: floats(16) });
    let sum = 0;
    for (let i = 0; i < this.count; i += 1) sum += header.getUint8(HEADER_BYTES + DISC_BYTES * i + RADIUS_BYTE);
    this.canvas.dataset.discs = this.count;
    this.lift = Math.max((2 * RADIUS_STEP_M * sum) / Math.max(this.count, 1), 0.01);
    this.discArray = this.#array(new Uint8Array(bytes, HEADER_BYTES), [
      [3, gl.UNSIGNED_SHORT, false, 0], [2, gl.BYTE, true, 6], [1, gl.UNSIGNED_BYTE, false, 8], [3, gl.UNSIGNED_BYTE, true, 9],
    ], DISC_BYTES);
  }

  get eye() {
    const across = this.distance * Math.cos(this.pitch);
    return [this.target[0] + across * Math.cos(this.yaw), this.target[1] + across * Math.sin(this.yaw), this.target[2] + this.distance * Math.sin(this.pitch)];
  }

  #draw() {
    const { gl, canvas } = this;
    const scale = Math.min(devicePixelRatio, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((size) => Math.max(Math.round(size * scale), 1));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const { eye } = this;
    const view = lookAt(eye, this.target);
    const projection = perspective(FOV, width / height, 0.05 * this.distance, this.distance + 4 * this.whole);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    const use = ({ program, at }) => {
      gl.useProgram(program);
      gl.uniformMatrix4fv(at("view"), false, view);
      gl.uniformMatrix4fv(at("projection"), false, projection);
      return at;
    };
    if (this.count > 0) {
      const at = use(this.discs);
      gl.uniform3fv(at("low"), this.low);
      gl.uniform3fv(at("step_m"), this.step);
      gl.uniform3fv(at("eye"), eye);
      gl.uniform1f(at("height_px"), height * RADIUS_STEP_M);
      gl.bindVertexArray(this.discArray.array);
      gl.drawArrays(gl.POINTS, 0, this.count);
    }
    this.#drawBodies(use);
    this.#drawMarks(use);
    this.#placeLabels(product(projection, view));
  }

  #drawBodies(use) {
    const { gl } = this;
    const at = use(this.bodies);
    gl.bindVertexArray(this.bodyArray.array);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    for (const { x, y, radius, height, color, opacity } of this.scene.bodies()) {
      gl.uniform4f(at("tint"), ...rgb(color), 1);
      gl.uniform2f(at("place"), x, y);
      gl.uniform1f(at("radius"), radius);
      gl.uniform1f(at("height"), height);
      gl.blendColor(0, 0, 0, opacity);
      gl.drawArrays(gl.TRIANGLES, 0, this.body.length / 4);
    }
  }

  // On the floor, which is uneven, so that they are drawn over it; and the cameras.
  #drawMarks(use) {
    const { gl } = this;
    const flat = new Triangles();
    this.scene.marks(flat);
    gl.uniform1f(use(this.marks)("lift"), this.lift);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindVertexArray(this.markArray.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.markArray.buffer);
    gl.depthMask(false);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(flat.data), gl.STREAM_DRAW);
    gl.drawArrays(gl.TRIANGLES, 0, flat.data.length / 7);
    gl.depthMask(true);
    this.#drawCameras(styleColor("camera", 1));
  }

  #drawCameras(tint) {
    const { gl } = this;
    const lines = [];
    for (const { center, frustum } of this.cameras) {
      frustum.forEach((corner, i) => {
        for (const p of [center, corner, corner, frustum[(i + 1) % frustum.length]]) lines.push(...p, ...tint);
      });
    }
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(lines), gl.STREAM_DRAW);
    gl.drawArrays(gl.LINES, 0, lines.length / 7);
  }

  #placeLabels(clip_from_world) {
    const all = this.cameras.map(({ name, center }) => ({ text: name, place: center })).concat(this.scene.labels());
    while (this.labels.children.length > all.length) this.labels.lastChild.remove();
    all.forEach(({ text, place, background, ink }, i) => {
      const label = this.labels.children[i] ?? this.labels.appendChild(document.createElement("span"));
      const [x, y, , w] = transformed(clip_from_world, place);
      label.hidden = w <= 0;
      label.textContent = text;
      label.className = background ? "" : "camera";
      label.style.background = background ?? "";
      label.style.color = ink ?? "";
      const [u, v] = [(0.5 + (0.5 * x) / w) * this.canvas.clientWidth, (0.5 - (0.5 * y) / w) * this.canvas.clientHeight];
      label.style.transform = `translate(${u.toFixed(1)}px, ${v.toFixed(1)}px) translate(-50%, -50%)`;
    });
  }

  #turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(Math.max(this.pitch + pitch, -0.2), MOST_PITCH);
    this.redraw();
  }

  #zoom(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, 0.08 * this.whole), 3 * this.whole);
    this.redraw();
  }

  // Moves the target in the plane of the screen, pixels.
  #move(dx, dy) {
    const back = unit(minus(this.eye, this.target));
    const right = unit(cross([0, 0, 1], back));
    const up = cross(back, right);
    const scale = (2 * this.distance * Math.tan(FOV / 2)) / Math.max(this.canvas.clientHeight, 1);
    this.target = this.target.map((c, i) => c - scale * (dx * right[i] - dy * up[i]));
    this.redraw();
  }

  #listen() {
    const { canvas } = this;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.#pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    for (const kind of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(kind, (event) => this.#pointers.delete(event.pointerId));
    }
    canvas.addEventListener("pointermove", (event) => this.#drag(event));
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.#zoom(Math.exp(event.deltaY * 0.0012));
    }, { passive: false });
    // The whole room again.
    canvas.addEventListener("dblclick", () => {
      Object.assign(this, { distance: this.whole * 1.15 });
      this.redraw();
    });
    canvas.addEventListener("keydown", (event) => {
      if (event.key === "+" || event.key === "-") this.#zoom(event.key === "+" ? 0.87 : 1.15);
      else if (KEYS[event.key]) this.#turn(...KEYS[event.key]);
      else return;
      event.preventDefault();
      event.stopPropagation();
    });
  }

  // One finger or the left button turns; two fingers zoom and move; another button moves.
  #drag(event) {
    const before = this.#pointers.get(event.pointerId);
    if (!before || !this.cameras) return;
    const now = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    this.#pointers.set(event.pointerId, now);
    if (other) {
      const length = ([x, y]) => Math.max(Math.hypot(x - other[0], y - other[1]), 1);
      this.#zoom(length(before) / length(now));
      this.#move(dx / 2, dy / 2);
    } else if ((event.buttons & ~1) !== 0 || event.shiftKey) {
      this.#move(dx, dy);
    } else {
      this.#turn(-dx * 0.007, dy * 0.006);
    }
  }
}
