// The wrist in three dimensions, built from wrist.json, and the panels of its plots.

/**
 * A face of a body: indices of its corners, its colour, and whether only its outside is visible.
 * @typedef {{corners: number[], colour: number[], isClosed: boolean}} Face
 * A body: the angle that turns it, the part of the machine, the torque that colours it in the close view, and whether the close view is cut open there.
 * `side` is the side of a part that only motor 1 (-1) or motor 2 (1) has.
 * @typedef {{points: number[], faces: Face[], turn: string, part: string, torque?: string, isCut?: boolean, side?: number}} Solid
 * @typedef {{part: string, turns?: string | null, lathe?: number[][], box?: number[][], colours: string[], lobes?: number}} Shape
 * What the image shows: the machine; the cam with its rollers from close by, with or without the colours of their torques; or the couplings of motor 1.
 * @typedef {"" | "torques" | "cam" | "coupling"} Focus
 * A body on the graphics card: corners and normals of its triangles, and the number of corners.
 * @typedef {{buffer: WebGLBuffer, count: number, body: Solid}} Mesh
 */

/** @typedef {{
 *   colours: Record<string, string>, side: Shape[], output: Shape[], couplings: {from: string, to: string, x: number[]}[],
 *   coupling: {strands: number, radius: number, width: number},
 *   rollers: {count: number, axis: number[], radius: number[], inner: number, colour: string},
 *   ring: {radius: number, section: number[][], colour: string},
 *   round: number, piece: number, shown_twist: number, most_twisted: number, azimuth: number, elevation: number, lamp: number[],
 * }} Parts */

/** Content of wrist.json; set when the page is built. @type {Parts} */
let WRIST;

/** The angles that the image shows. */
const SHOWN = ["theta1", "theta2", "theta3", "theta4", "theta5", "theta6", "pitch", "roll"];
const SHAFTS = [
  { side: -1, colour: "blue", motor: "theta1", middle: "theta3", carrier: "theta5", torque: "tau1" },
  { side: 1, colour: "vermilion", motor: "theta2", middle: "theta4", carrier: "theta6", torque: "tau2" },
];
/** The parts of the machine, with their labels. */
const PARTS_SHOWN = { motors: "motors", couplings: "couplings", carriers: "carriers with rollers", cam: "cam", ring: "ring", gripper: "gripper" };
/** The parts in the close views. The ring is cut open: without its upper arc. */
const CLOSE = { torques: ["carriers", "cam", "ring"], cam: ["carriers", "cam"], coupling: ["couplings"] };
/** Azimuth and elevation of the close views, deg. */
const ANGLES = { torques: [18, 38], cam: [18, 30], coupling: [34, 24] };
/** Position of the coupling next to the wrist, of motor 1. */
const COUPLING = -2.2;
const DEGREE = Math.PI / 180;

/** @type {Panel[]} */
const WRIST_PANELS = [
  { title: "Motors", unit: "\u00b0", curves: [{ name: "theta1", label: "\u03b8\u2081", colour: "curve-1", factor: 1 / DEGREE }, { name: "theta2", label: "\u03b8\u2082", colour: "curve-2", factor: 1 / DEGREE }] },
  { title: "Wrist", unit: "\u00b0", isNoted: true, curves: [{ name: "pitch", label: "pitch", colour: "curve-3", factor: 1 / DEGREE }, { name: "roll", label: "roll", colour: "curve-4", factor: 1 / DEGREE }] },
  { title: "Torques", unit: "N\u00b7m", curves: [{ name: "tau1", label: "\u03c4\u2081", colour: "curve-1", factor: 1 }, { name: "tau2", label: "\u03c4\u2082", colour: "curve-2", factor: 1 }] },
];

/** Red, green and blue of a colour such as #12ab9f, from 0 to 255. @param {string} colour */
function channels(colour) {
  return [1, 3, 5].map((start) => parseInt(colour.slice(start, start + 2), 16));
}

/** The bodies of the wrist, with a number of cam lobes. @param {Parts} parts @param {number} waves @returns {Solid[]} */
function bodies(parts, waves) {
  const rgb = (/** @type {string} */ name) => channels(parts.colours[name]);
  // At least six corners per lobe.
  const round = parts.round * Math.max(1, Math.ceil((6 * waves) / parts.round));

  /** A solid of revolution about X from points (x, radius), in stripes of the colours. @param {Shape} shape @param {string} own @returns {Solid} */
  const lathe = ({ lathe: profile = [], colours, lobes = 0, turns, part }, own) => {
    const points = [profile[0]];
    for (let k = 1; k < profile.length; k++) {
      const [begin, end] = [profile[k - 1], profile[k]];
      const pieces = Math.max(Math.round(Math.abs(end[0] - begin[0]) / parts.piece), 1);
      for (let piece = 1; piece <= pieces; piece++) {
        points.push(begin.map((value, axis) => value + ((end[axis] - value) * piece) / pieces));
      }
    }
    const made = points.flatMap(([x, radius]) =>
      Array.from({ length: round }, (_, k) => {
        const [angle, wave] = [(2 * Math.PI * k) / round, 1 + lobes * Math.cos((2 * Math.PI * waves * k) / round)];
        return [x, radius * wave * Math.cos(angle), radius * wave * Math.sin(angle)];
      }).flat(),
    );
    const colourOf = (/** @type {number} */ k) => rgb(((name) => (name === "side" ? own : name))(colours[Math.floor((k * colours.length) / round)]));
    /** @type {Face[]} */
    const faces = [];
    const isClosed = profile[profile.length - 1][1] === 0;
    for (let ring = 0; ring + 1 < points.length; ring++) {
      // A flat ring has one face per stripe.
      const width = points[ring][0] === points[ring + 1][0] ? round / Math.max(colours.length, 2) : 1;
      for (let k = 0; k < round; k += width) {
        const arc = Array.from({ length: width + 1 }, (_, step) => (k + step) % round);
        const inner = points[ring][1] === 0 ? [arc[0]] : arc;
        const outer = points[ring + 1][1] === 0 ? [arc[0]] : arc;
        faces.push({ corners: [...inner.map((corner) => ring * round + corner), ...outer.map((corner) => (ring + 1) * round + corner).reverse()], colour: colourOf(k), isClosed });
      }
    }
    return outward({ points: made, faces, turn: turns ?? "", part });
  };

  /** @param {Shape} shape @returns {Solid} */
  const box = ({ box: corners = [], colours, turns, part }) => {
    const points = Array.from({ length: 8 }, (_, number) => [0, 1, 2].map((axis) => corners[(number >> axis) & 1][axis])).flat();
    const sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    return outward({ points, faces: sides.map((side) => ({ corners: side, colour: rgb(colours[0]), isClosed: true })), turn: turns ?? "", part });
  };

  /** @type {Solid[]} */
  const all = [];
  for (const shaft of SHAFTS) {
    const turn = (/** @type {string | null | undefined} */ name) => (name ? shaft[/** @type {"motor"} */ (name)] : "");
    for (const shape of parts.side) {
      const mirrored = { ...shape, turns: turn(shape.turns), lathe: shape.lathe?.map(([x, radius]) => [shaft.side * x, radius]) };
      all.push({ ...lathe(mirrored, shaft.colour), torque: shape.part === "carriers" ? shaft.torque : undefined, side: shaft.side });
    }
    all.push({ ...rollers(parts, shaft.side, rgb(parts.rollers.colour)), turn: shaft.carrier, part: "carriers", torque: shaft.torque });
  }
  all.push(...[false, true].map((isUpper) => ring(parts, rgb(parts.ring.colour), isUpper)));
  for (const shape of parts.output) {
    const body = shape.box ? box(shape) : lathe(shape, "");
    if (shape.lathe) {
      // Turns the axis from X to Y.
      const { points } = body;
      for (let k = 0; k < points.length; k += 3) {
        [points[k], points[k + 1], points[k + 2]] = [points[k + 1], points[k], -points[k + 2]];
      }
    }
    all.push({ ...body, turn: "output" });
  }
  return all;
}

/** Orders the corners of all faces so that normals point outwards, by the sign of the volume. @param {Solid} body */
function outward(body) {
  const at = (/** @type {number} */ index) => body.points.slice(3 * index, 3 * index + 3);
  let volume = 0;
  for (const { corners } of body.faces) {
    const first = at(corners[0]);
    for (let k = 2; k < corners.length; k++) {
      const [second, third] = [at(corners[k - 1]), at(corners[k])];
      volume += first[0] * (second[1] * third[2] - second[2] * third[1]) + first[1] * (second[2] * third[0] - second[0] * third[2]) + first[2] * (second[0] * third[1] - second[1] * third[0]);
    }
  }
  if (volume < 0) {
    body.faces.forEach((face) => face.corners.reverse());
  }
  return body;
}

/** The conical rollers of one side. Their axes meet in the centre. @param {Parts} parts @param {number} side @param {number[]} colour */
function rollers({ rollers: shape }, side, colour) {
  /** @type {number[]} */
  const points = [];
  /** @type {Face[]} */
  const faces = [];
  const [axis, length] = [[side * shape.axis[0], shape.axis[1]], Math.hypot(shape.axis[0], shape.axis[1])];
  const across = [axis[1] / length, -axis[0] / length];
  for (let number = 0; number < shape.count; number++) {
    const [cos, sin] = [Math.cos((2 * Math.PI * number) / shape.count), Math.sin((2 * Math.PI * number) / shape.count)];
    const first = points.length / 3;
    for (const [share, radius] of [[1, shape.radius[0]], [shape.inner, shape.radius[1]]]) {
      for (let k = 0; k < 6; k++) {
        const [c, s] = [radius * Math.cos((Math.PI * k) / 3), radius * Math.sin((Math.PI * k) / 3)];
        const [x, y, z] = [share * axis[0] + c * across[0], share * axis[1] + c * across[1], s];
        points.push(x, cos * y - sin * z, sin * y + cos * z);
      }
    }
    for (let k = 0; k < 6; k++) {
      const next = (k + 1) % 6;
      faces.push({ corners: [first + k, first + next, first + 6 + next, first + 6 + k], colour, isClosed: false });
    }
    faces.push({ corners: [6, 7, 8, 9, 10, 11].map((corner) => first + corner), colour, isClosed: false });
  }
  return { points, faces };
}

/** The upper arc of the central ring, which the close view leaves out, or the rest. The ring pitches; its section is a rectangle and its axis is Z. @param {Parts} parts @param {number[]} colour @param {boolean} isUpper @returns {Solid} */
function ring({ ring: shape, round }, colour, isUpper) {
  const sectors = 2 * round;
  const isUpperAt = (/** @type {number} */ sector) => Math.sin((2 * Math.PI * (sector + 0.5)) / sectors) > 0.45;
  const points = Array.from({ length: sectors }, (_, k) => {
    const angle = (2 * Math.PI * k) / sectors;
    return shape.section.flatMap(([radius, z]) => [shape.radius * radius * Math.cos(angle), shape.radius * radius * Math.sin(angle), z]);
  }).flat();
  /** @type {Face[]} */
  const faces = [];
  for (let k = 0; k < sectors; k++) {
    if (isUpperAt(k) !== isUpper) {
      continue;
    }
    for (let edge = 0; edge < 4; edge++) {
      const [here, next] = [4 * k, 4 * ((k + 1) % sectors)];
      faces.push({ corners: [here + edge, next + edge, next + ((edge + 1) % 4), here + ((edge + 1) % 4)], colour, isClosed: true });
    }
    for (const end of [0, 1].filter((side) => isUpperAt(k + 2 * side - 1) !== isUpper)) {
      faces.push({ corners: [0, 1, 2, 3].map((corner) => 4 * ((k + end) % sectors) + corner), colour, isClosed: false });
    }
  }
  return outward({ points, faces, turn: "pitch", part: "ring", isCut: isUpper });
}

/** The strands of a coupling between two discs: straight without torque, twisted with torque. @param {Parts} parts @param {number[]} x @param {number} outer @param {number} inner @param {number} twist */
function strands({ coupling: shape }, x, outer, inner, twist) {
  const points = [];
  for (let k = 0; k < shape.strands; k++) {
    const begin = (2 * Math.PI * k) / shape.strands + outer;
    const end = begin + twist * (inner - outer);
    for (const [axial, angle] of [[x[0], begin - shape.width], [x[0], begin + shape.width], [x[1], end + shape.width], [x[1], end - shape.width]]) {
      points.push(axial, shape.radius * Math.cos(angle), shape.radius * Math.sin(angle));
    }
  }
  return points;
}

/** Factor that makes the twist visible: 1, 2 or 5 times a power of ten. @param {Parts} parts @param {Table} table */
function enlargement(parts, table) {
  let most = 1e-6;
  for (const { motor, middle, carrier } of SHAFTS) {
    for (const [outer, inner] of [[motor, middle], [middle, carrier]].map((pair) => pair.map((name) => table.column(name)))) {
      for (let row = 0; row < table.count; row++) {
        most = Math.max(most, Math.abs(outer[row] - inner[row]));
      }
    }
  }
  const factor = Math.max(1, Math.min(parts.shown_twist / most, parts.most_twisted));
  const power = 10 ** Math.floor(Math.log10(factor));
  return power * (factor >= 5 * power ? 5 : factor >= 2 * power ? 2 : 1);
}

/** Rotation matrices (3, 3) by the name of the angle. @param {(name: string) => number} angle @returns {Record<string, number[]>} */
function rotations(angle) {
  /** @type {Record<string, number[]>} */
  const all = { "": [1, 0, 0, 0, 1, 0, 0, 0, 1] };
  for (const name of SHOWN) {
    const [c, s] = [Math.cos(angle(name)), Math.sin(angle(name))];
    all[name] = [1, 0, 0, 0, c, -s, 0, s, c];
  }
  const [c, s] = [Math.cos(angle("roll")), Math.sin(angle("roll"))];
  all.output = multiplied(all.pitch, [c, 0, s, 0, 1, 0, -s, 0, c]);
  return all;
}

/** A matrix (3, 3) times a vector. @param {number[]} m @param {number[]} v */
function transformed(m, v) {
  return [0, 3, 6].map((row) => m[row] * v[0] + m[row + 1] * v[1] + m[row + 2] * v[2]);
}

/** @param {number[]} a @param {number[]} b */
function multiplied(a, b) {
  return [0, 1, 2].flatMap((row) => [0, 1, 2].map((column) => a[3 * row] * b[column] + a[3 * row + 1] * b[3 + column] + a[3 * row + 2] * b[6 + column]));
}

/**
 * The wrist on a canvas. `move` turns a motor (theta1, theta2) or the wrist (pitch, roll) by angles, rad. `handles` are the parts that can be dragged.
 * @typedef {(increments: Record<string, number>) => void} Move
 */
class Wrist {
  /** @param {Parts} parts @param {Move | null} move @param {("motors" | "gripper")[]} handles */
  constructor(parts, move, handles = ["motors", "gripper"]) {
    this.parts = parts;
    /** @type {Solid[]} */
    this.bodies = [];
    this.handles = move ? handles : [];
    /** Whether the hint that a part can be dragged is shown. */
    this.isHinting = move !== null;
    /** Parts that are switched off. @type {Set<string>} */
    this.off = new Set();
    /** @type {Focus} */
    this.focus = "";
    /** Stiffness of the couplings next to the wrist, N.m/rad. */
    this.stiffness = 0;
    /** A line above the machine. */
    this.caption = "";
    this.shaded = Shaded.make();
    this.azimuth = parts.azimuth + 90;
    this.elevation = parts.elevation;
    this.twist = 0;
    /** The table and the time of the last image. @type {[Table, number] | null} */
    this.last = null;
    this.turns = rotations(() => 0);
    const hint = this.handles.length ? `; ${this.handles.join(" and ")} can be dragged, and the sliders below do the same` : "";
    this.element = element("canvas", { class: "live-scene", role: "img", tabindex: "0", "aria-label": `The wrist in three dimensions. Arrow keys turn the view${hint}.` });
    this.listen(move);
    this.settled = { key: "", factor: 1 };
    /** The largest torque of a run, N.m. */
    this.hottest = { key: "", most: 1 };
    /** The largest torque of a spring or damper in a run, N.m. */
    this.pushed = { key: "", most: 1 };
    this.count(LOBES, parts.rollers.count);
  }

  /** Sets the number of cam lobes and rollers of each side, at most 24. @param {number} lobes @param {number} rollers */
  count(lobes, rollers) {
    const limited = (/** @type {number} */ number) => Math.min(Math.max(Math.round(number) || 1, 1), 24);
    this.bodies = bodies({ ...this.parts, rollers: { ...this.parts.rollers, count: limited(rollers) } }, limited(lobes));
    this.shaded?.load(this.bodies);
    this.turn(0, 0);
  }

  /** Shows a part from close by, or the whole machine. @param {Focus} focus */
  look(focus) {
    this.focus = focus;
    [this.azimuth, this.elevation] = focus ? ANGLES[focus] : [this.parts.azimuth + 90, this.parts.elevation];
    this.turn(0, 0);
  }

  /** Switches a part on or off. @param {string} part @param {boolean} isOn */
  show(part, isOn) {
    this.off[isOn ? "delete" : "add"](part);
    this.turn(0, 0);
  }

  /** Whether a body is in the image. @param {Solid} body */
  isShown({ part, isCut, side }) {
    return !this.off.has(part) && (!this.focus || (CLOSE[this.focus].includes(part) && !isCut && (this.focus !== "coupling" || side === -1)));
  }

  /** What the pointer would grab at a position on the canvas: a motor, the gripper, or nothing. @param {number} x @param {number} y @returns {typeof SHAFTS[number] | "gripper" | null} */
  grabbed(x, y) {
    const near = (/** @type {number[]} */ centre, /** @type {number[]} */ edge) => {
      const [a, b] = [this.project(centre), this.project(edge)];
      return Math.hypot(x - a[0], y - a[1]) < Math.max(24, Math.hypot(b[0] - a[0], b[1] - a[1]));
    };
    if (this.handles.includes("gripper") && this.isShown({ part: "gripper", points: [], faces: [], turn: "" })) {
      const [centre, edge] = [[0, 1.9, 0], [0, 2.45, 0]].map((point) => transformed(this.turns.output, point));
      if (near(centre, edge)) {
        return "gripper";
      }
    }
    const isMotor = this.handles.includes("motors") && this.isShown({ part: "motors", points: [], faces: [], turn: "" });
    return (isMotor && SHAFTS.find(({ side }) => near([side * 4.1, 0, 0], [side * 4.1, 0.8, 0]))) || null;
  }

  /** @param {Move | null} move */
  listen(move) {
    const canvas = this.element;
    /** @type {typeof SHAFTS[number] | "gripper" | null} */
    let dragged = null;
    let last = [0, 0];
    /** Signs with which the gripper follows the pointer: pitch up and down, roll left and right. */
    let signs = [1, 1];
    canvas.addEventListener("pointerdown", (event) => {
      dragged = this.grabbed(event.offsetX, event.offsetY);
      last = [event.clientX, event.clientY];
      signs = this.gripperSigns();
      canvas.setPointerCapture(event.pointerId);
    });
    // A finger on a motor or on the gripper moves it. Elsewhere, a vertical swipe scrolls the page.
    canvas.addEventListener("touchstart", (event) => {
      const box = canvas.getBoundingClientRect();
      const [touch] = event.touches;
      if (this.grabbed(touch.clientX - box.left, touch.clientY - box.top)) {
        event.preventDefault();
      }
    }, { passive: false });
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) {
        const over = this.grabbed(event.offsetX, event.offsetY);
        canvas.style.cursor = over === "gripper" ? "move" : over ? "ns-resize" : "grab";
        return;
      }
      // In Safari, movementX and movementY of touch events are 0.
      const [right, down] = [event.clientX - last[0], event.clientY - last[1]];
      last = [event.clientX, event.clientY];
      this.isHinting &&= !dragged;
      if (dragged === "gripper") {
        const { scale } = this.camera();
        move?.({ pitch: (signs[0] * down) / this.climb(), roll: (signs[1] * right) / (0.5 * scale) });
      } else if (dragged) {
        const box = canvas.getBoundingClientRect();
        move?.({ [dragged.motor]: this.angleOf(dragged.side, [event.clientX - box.left, event.clientY - box.top], [right, down]) });
      } else {
        this.turn(-0.4 * right, 0.4 * down);
      }
    });
    canvas.addEventListener("keydown", (event) => {
      const steps = /** @type {Record<string, number[]>} */ ({ ArrowLeft: [5, 0], ArrowRight: [-5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] })[event.key];
      if (steps) {
        event.preventDefault();
        this.turn(steps[0], steps[1]);
      }
    });
  }

  /** The signs of pitch for a movement down and of roll for a movement to the right, so that the side of the gripper that faces the viewer follows the pointer. */
  gripperSigns() {
    const { rotation } = this.camera();
    const [, axisY, axisZ] = transformed(this.turns.output, [0, 1, 0]);
    // Pitch moves the gripper along (0, -z, y); the pointer's y axis points down.
    const down = rotation[4] * axisZ - rotation[5] * axisY;
    const axis = transformed(rotation, transformed(this.turns.output, [0, 1, 0]));
    return [down < 0 ? -1 : 1, axis[1] < 0 ? -1 : 1];
  }

  /** How far the gripper moves down or up on the canvas for each radian of pitch, px. Where that is hardly far, the pointer is faster. */
  climb() {
    const tip = transformed(this.turns.output, [0, 2, 0]);
    const [c, s] = [Math.cos(0.01), Math.sin(0.01)];
    const pitched = [tip[0], c * tip[1] - s * tip[2], s * tip[1] + c * tip[2]];
    return Math.max(0.9 * this.camera().scale, Math.abs(this.project(pitched)[1] - this.project(tip)[1]) / 0.01);
  }

  /**
   * The angle by which a motor turns when its surface follows the pointer, rad.
   * @param {number} side @param {number[]} pointer position, px @param {number[]} movement of the pointer, px
   */
  angleOf(side, pointer, movement) {
    const { rotation, scale } = this.camera();
    const [nearX, nearY, nearZ] = rotation.slice(6);
    const across = Math.hypot(nearY, nearZ);
    const centre = this.project([side * 4.1, 0, 0]);
    if (across < 0.5) {
      // The view is along the axis: the motor turns about its centre.
      const [x, y] = [pointer[0] - centre[0], pointer[1] - centre[1]];
      return (-Math.sign(nearX) * (x * movement[1] - y * movement[0])) / Math.max(x * x + y * y, 100);
    }
    // Velocity of the nearest surface point on the screen.
    const [y, z] = [-nearZ / across, nearY / across];
    const [right, down] = [rotation[1] * y + rotation[2] * z, -(rotation[4] * y + rotation[5] * z)];
    return (right * movement[0] + down * movement[1]) / (0.66 * scale * (right * right + down * down));
  }

  /** @param {number} azimuth deg @param {number} elevation deg */
  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.max(-89, Math.min(89, this.elevation + elevation));
    if (this.last) {
      this.draw(...this.last);
    }
  }

  /** @param {number} twist factor of the couplings' twist; 0 selects it automatically */
  enlarge(twist) {
    this.twist = twist;
    this.turn(0, 0);
  }

  /** The factor of the twist: the user's or the automatic one. @param {Table} table */
  factor(table) {
    const key = `${table.count} ${table.column("theta3")[table.count - 1]}`;
    if (key !== this.settled.key && !this.twist) {
      this.settled = { key, factor: enlargement(this.parts, table) };
    }
    return this.twist || this.settled.factor;
  }

  /** Position of a point on the canvas, and its distance towards the viewer. @param {number[]} point */
  project([x, y, z]) {
    const { rotation, scale, centre } = this.camera();
    const near = rotation[6] * x + rotation[7] * y + rotation[8] * z;
    const size = (scale * DISTANCE) / (DISTANCE - near);
    return [centre[0] + size * (rotation[0] * x + rotation[1] * y + rotation[2] * z), centre[1] - size * (rotation[3] * x + rotation[4] * y + rotation[5] * z), near];
  }

  camera() {
    const [azimuth, elevation] = [this.azimuth * DEGREE, this.elevation * DEGREE];
    const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
    const rotation = multiplied([1, 0, 0, 0, ce, -se, 0, se, ce], [ca, 0, -sa, 0, 1, 0, sa, 0, ca]);
    const { width, height } = sizeOf(this.element);
    if (this.focus === "coupling") {
      const [scale, size] = [Math.min(width / 3, height / 2.1), DISTANCE / (DISTANCE - rotation[6] * COUPLING)];
      return { rotation, scale, centre: [0.5 * width - size * scale * rotation[0] * COUPLING, 0.56 * height + size * scale * rotation[3] * COUPLING] };
    }
    if (this.focus) {
      const scale = this.focus === "cam" ? Math.min(width / 4.2, height / 2.7) : Math.min(width / 3.4, height / 2.2);
      return { rotation, scale, centre: [0.5 * width, 0.5 * height + 0.42 * scale * ce] };
    }
    return { rotation, scale: Math.min(width / 10.3, height / 5.2), centre: [0.47 * width, 0.53 * height] };
  }

  /** @param {Table} table @param {number} time */
  draw(table, time) {
    this.last = [table, time];
    const { pen, width, height } = clear(this.element);
    const { rotation, scale, centre } = this.camera();
    const angle = (/** @type {string} */ name) => table.at(name, time);
    const turns = this.turns = rotations(angle);
    const twist = this.factor(table);
    const couplings = this.couplings(angle, twist).filter((body) => this.isShown(body));
    const isShown = (/** @type {Solid} */ body) => this.isShown(body);
    const warmth = this.focus === "torques" ? this.warmth(table, time) : () => 0;
    const image = this.shaded?.draw({ width, height, rotation, scale, centre, turns, lamp: this.parts.lamp }, couplings, isShown, warmth);
    if (image) {
      pen.drawImage(image, 0, 0, width, height);
    } else {
      this.paint(pen, { rotation, scale, centre }, turns, [...this.bodies.filter(isShown), ...couplings], warmth);
    }
    if (this.focus === "coupling") {
      this.arcs(pen, table, time);
    }
    this.label(pen, width, height, twist, (name) => table.at(name, time));
  }

  /** The torques that the spring and the damper of the coupling transmit, N.m. The shaft before it has no inertia, so their sum is the sensor's torque, eq. (9). @param {(name: string) => number} at */
  torques(at) {
    const spring = this.stiffness * (at("theta3") - at("theta5"));
    return [spring, -at("tau1") - spring];
  }

  /** Draws these torques as arrows around the coupling, in relation to the largest one of the run. @param {CanvasRenderingContext2D} pen @param {Table} table @param {number} time */
  arcs(pen, table, time) {
    const key = `${table.count} ${table.column("tau1")[table.count - 1]} ${this.stiffness}`;
    if (key !== this.pushed.key) {
      let most = 1e-6;
      for (let row = 0; row < table.count; row++) {
        most = Math.max(most, ...this.torques((name) => table.column(name)[row]).map(Math.abs));
      }
      this.pushed = { key, most };
    }
    this.torques((name) => table.at(name, time)).forEach((torque, index) => {
      const [radius, turn] = [0.62 + 0.2 * index, (2.6 * torque) / this.pushed.most];
      const at = (/** @type {number} */ angle, /** @type {number} */ far) => this.project([COUPLING, far * Math.cos(angle), far * Math.sin(angle)]);
      const steps = Array.from({ length: 25 }, (_, step) => at((turn * step) / 24, radius));
      pen.strokeStyle = pen.fillStyle = colourAt(this.element, FORCES[index].colour);
      pen.lineWidth = 5;
      pen.beginPath();
      steps.forEach(([x, y]) => pen.lineTo(x, y));
      pen.stroke();
      if (Math.abs(turn) > 0.05) {
        const [tip, inner, outer] = [at(turn + 0.14 * Math.sign(turn), radius), at(turn, radius - 0.07), at(turn, radius + 0.07)];
        pen.beginPath();
        [tip, inner, outer].forEach(([x, y]) => pen.lineTo(x, y));
        pen.fill();
      }
    });
  }

  /** The share of the warm colour in a body: its torque, in relation to the largest one of the run. @param {Table} table @param {number} time @returns {(body: Solid) => number} */
  warmth(table, time) {
    const key = `${table.count} ${table.column("tau1")[table.count - 1]}`;
    if (key !== this.hottest.key) {
      let most = 1e-6;
      for (const { torque } of SHAFTS) {
        const column = table.column(torque);
        for (let row = 0; row < table.count; row++) {
          most = Math.max(most, Math.abs(column[row]));
        }
      }
      this.hottest = { key, most };
    }
    return ({ torque }) => (torque ? Math.min(1, Math.abs(table.at(torque, time)) / this.hottest.most) : 0);
  }

  /** The strands of all couplings. @param {(name: string) => number} angle @param {number} twist @returns {Solid[]} */
  couplings(angle, twist) {
    return SHAFTS.flatMap((shaft) =>
      this.parts.couplings.map(({ from, to, x }) => {
        const [outer, inner] = [angle(shaft[/** @type {"motor"} */ (from)]), angle(shaft[/** @type {"motor"} */ (to)])];
        const points = strands(this.parts, x.map((axial) => shaft.side * axial), outer, inner, twist);
        const colour = channels(this.parts.colours[shaft.colour]);
        const faces = Array.from({ length: points.length / 12 }, (_, k) => ({ corners: [0, 1, 2, 3].map((corner) => 4 * k + corner), colour, isClosed: false }));
        return { points, faces, turn: "", part: "couplings", side: shaft.side };
      }),
    );
  }

  /**
   * Paints the faces from the farthest to the nearest, for browsers without WebGL.
   * @param {CanvasRenderingContext2D} pen @param {{rotation: number[], scale: number, centre: number[]}} camera
   * @param {Record<string, number[]>} turns @param {Solid[]} bodies @param {(body: Solid) => number} warmth
   */
  paint(pen, { rotation, scale, centre }, turns, bodies, warmth) {
    /** @type {{near: number, points: number[], corners: number[], colour: number[], light: number, isReversed: boolean}[]} */
    const visible = [];
    const lamp = this.parts.lamp;
    /** @param {Solid} body */
    const add = (body) => {
      const turned = multiplied(rotation, turns[body.turn]);
      const { points } = body;
      const placed = new Array(points.length);
      for (let k = 0; k < points.length; k += 3) {
        const [x, y, z] = [points[k], points[k + 1], points[k + 2]];
        const near = turned[6] * x + turned[7] * y + turned[8] * z;
        const size = (scale * DISTANCE) / (DISTANCE - near);
        placed[k] = centre[0] + size * (turned[0] * x + turned[1] * y + turned[2] * z);
        placed[k + 1] = centre[1] - size * (turned[3] * x + turned[4] * y + turned[5] * z);
        placed[k + 2] = near;
      }
      const warm = 0.9 * warmth(body);
      for (const { corners, colour: own, isClosed } of body.faces) {
        const colour = warm ? own.map((part, index) => part + warm * (WARM[index] - part)) : own;
        let [area, near] = [0, 0];
        for (let k = 0, before = corners[corners.length - 1]; k < corners.length; before = corners[k++]) {
          const [a, b] = [3 * before, 3 * corners[k]];
          area += placed[a] * placed[b + 1] - placed[b] * placed[a + 1];
          near += placed[b + 2];
        }
        if (isClosed && area > 0) {
          continue;
        }
        const [x, y, z] = normal(points, corners);
        const sign = area > 0 ? -1 : 1;
        const turn = turns[body.turn];
        const light = sign * (lamp[0] * (turn[0] * x + turn[1] * y + turn[2] * z) + lamp[1] * (turn[3] * x + turn[4] * y + turn[5] * z) + lamp[2] * (turn[6] * x + turn[7] * y + turn[8] * z));
        visible.push({ near: near / corners.length, points: placed, corners, colour, light, isReversed: area > 0 });
      }
    };
    bodies.forEach(add);
    visible.sort((one, other) => one.near - other.near);
    let shade = "";
    pen.beginPath();
    for (const { points, corners, colour, light, isReversed } of visible) {
      const bright = 0.62 + 0.38 * Math.max(0, light);
      const own = `rgb(${Math.round(bright * colour[0])},${Math.round(bright * colour[1])},${Math.round(bright * colour[2])})`;
      // Consecutive faces of one shade are filled together; all have the same orientation.
      if (own !== shade) {
        pen.fill();
        pen.beginPath();
        pen.fillStyle = shade = own;
      }
      // Faces are enlarged by 0.6 px, so that the background is not visible between them. Strokes would take much longer.
      let [x, y] = [0, 0];
      for (const corner of corners) {
        x += points[3 * corner] / corners.length;
        y += points[3 * corner + 1] / corners.length;
      }
      for (let k = 0; k < corners.length; k++) {
        const corner = 3 * corners[isReversed ? corners.length - 1 - k : k];
        const [dx, dy] = [points[corner] - x, points[corner + 1] - y];
        const larger = 1 + 0.6 / (Math.hypot(dx, dy) || 1);
        if (k) {
          pen.lineTo(x + larger * dx, y + larger * dy);
        } else {
          pen.moveTo(x + larger * dx, y + larger * dy);
        }
      }
      pen.closePath();
    }
    pen.fill();
  }

  /** @param {CanvasRenderingContext2D} pen @param {number} width @param {number} height @param {number} twist @param {(name: string) => number} at */
  label(pen, width, height, twist, at) {
    pen.font = "13px system-ui, sans-serif";
    pen.textBaseline = "alphabetic";
    pen.lineWidth = 3;
    pen.lineJoin = "round";
    pen.strokeStyle = colourAt(this.element, "tint");
    const label = (/** @type {string} */ text, /** @type {number[]} */ [x, y], /** @type {string} */ colour, /** @type {CanvasTextAlign} */ align) => {
      pen.textAlign = align;
      pen.fillStyle = colourAt(this.element, colour);
      const half = align === "center" ? pen.measureText(text).width / 2 + 4 : 0;
      const left = align === "left" ? Math.min(x, width - pen.measureText(text).width - 4) : Math.min(Math.max(x, half), width - half);
      pen.strokeText(text, left, y);
      pen.fillText(text, left, y);
    };
    const isOn = (/** @type {string} */ part) => !this.off.has(part);
    if (this.focus === "coupling") {
      this.torques(at).forEach((torque, index) => label(`${FORCES[index].name} ${format(torque, this.pushed.most)} N\u00b7m`, [8, 20 + 18 * index], FORCES[index].colour, "left"));
      label("to motor 1", this.project([-3.3, -0.75, 0]), "text-1", "center");
      label("to the wrist", this.project([-1.75, -0.62, 0]), "soft", "center");
    } else if (this.focus) {
      const torques = SHAFTS.map(({ torque }) => `${format(at(torque), this.hottest.most)}`);
      if (this.focus === "torques") {
        label(`the redder, the more torque: motor 1 ${torques[0]}, motor 2 ${torques[1]} N\u00b7m`, [8, 20], "soft", "left");
      }
      if (isOn("carriers")) {
        SHAFTS.forEach(({ side }, index) => label(`rollers of motor ${index + 1}`, this.project([side * 1.4, 1.15, 0]), `text-${index + 1}`, "center"));
      }
      if (isOn("cam")) {
        label("cam of the gripper", this.project([0.35, 1.65, 0]), "text-4", "left");
      }
    } else {
      if (isOn("motors")) {
        label("motor 1", this.project([-4.1, 0.95, 0]), "text-1", "center");
        label("motor 2", this.project([4.1, 0.95, 0]), "text-2", "center");
      }
      if (isOn("ring")) {
        label("ring: pitch", this.project(transformed(this.turns.pitch, [1.2, -1.35, 0])), "text-3", "left");
      }
      if (isOn("gripper")) {
        label("gripper: roll", this.project(transformed(this.turns.output, [0, 2, 0])).map((value, axis) => value + (axis ? 0 : 0.75 * this.camera().scale)), "text-4", "left");
      }
      if (isOn("couplings")) {
        label(`couplings\u2019 twist drawn \u00d7 ${twist}`, [8, 20], "soft", "left");
      }
    }
    pen.font = "600 15px system-ui, sans-serif";
    if (this.caption) {
      label(this.caption, [8, height - 12], "ink", "left");
    }
    // In a narrow image, the caption takes the space of the hint.
    if (this.isHinting && !this.focus && this.handles.length && !(this.caption && width < 480)) {
      label(this.handles.length > 1 ? "Drag the gripper or a motor" : `Drag the ${this.handles[0]}`, [this.caption ? width - 10 : width / 2, height - 12], "ink", this.caption ? "right" : "center");
    }
  }
}

/** Draws bodies with a depth buffer on a separate canvas. */
class Shaded {
  /** Returns `null` if the browser has no WebGL, or only in software, or rejects the shaders. @returns {Shaded | null} */
  static make() {
    const gl = element("canvas").getContext("webgl", { antialias: true, preserveDrawingBuffer: true, failIfMajorPerformanceCaveat: true });
    const made = gl && new Shaded(gl);
    return made?.isLinked ? made : null;
  }

  /** @param {WebGLRenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    /** @type {Mesh[]} */
    this.meshes = [];
    const program = /** @type {WebGLProgram} */ (gl.createProgram());
    for (const [type, source] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, CORNERS], [gl.FRAGMENT_SHADER, PIXELS]])) {
      const shader = /** @type {WebGLShader} */ (gl.createShader(type));
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    this.isLinked = Boolean(gl.getProgramParameter(program, gl.LINK_STATUS));
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    const locations = ["camera", "turn", "scale", "centre", "lamp", "warm"].map((name) => [name, gl.getUniformLocation(program, name)]);
    /** @type {Record<string, WebGLUniformLocation | null>} */
    this.uniforms = Object.fromEntries(locations);
    this.attributes = ["position", "normal", "colour"].map((name) => gl.getAttribLocation(program, name));
    this.attributes.forEach((attribute) => gl.enableVertexAttribArray(attribute));
    this.strands = /** @type {WebGLBuffer} */ (gl.createBuffer());
  }

  /** Loads these bodies to the graphics card. @param {Solid[]} bodies */
  load(bodies) {
    const { gl } = this;
    this.meshes.forEach(({ buffer }) => gl.deleteBuffer(buffer));
    this.meshes = bodies.map((body) => {
      const [buffer, corners] = [/** @type {WebGLBuffer} */ (gl.createBuffer()), triangles(body)];
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, corners, gl.STATIC_DRAW);
      return { buffer, count: corners.length / 9, body };
    });
  }

  /**
   * Draws the bodies and the couplings and returns the canvas, or `null` if the WebGL context is lost.
   * @param {{width: number, height: number, rotation: number[], scale: number, centre: number[], turns: Record<string, number[]>, lamp: number[]}} view
   * @param {Solid[]} couplings @param {(body: Solid) => boolean} isShown @param {(body: Solid) => number} warmth
   */
  draw({ width, height, rotation, scale, centre, turns, lamp }, couplings, isShown, warmth) {
    const { gl } = this;
    const canvas = /** @type {HTMLCanvasElement} */ (gl.canvas);
    const ratio = window.devicePixelRatio || 1;
    const [pixelWidth, pixelHeight] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (gl.isContextLost() || !pixelWidth || !pixelHeight) {
      return null;
    }
    if (canvas.width !== pixelWidth || canvas.height !== pixelHeight) {
      [canvas.width, canvas.height] = [pixelWidth, pixelHeight];
    }
    gl.viewport(0, 0, pixelWidth, pixelHeight);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix3fv(this.uniforms.camera, false, columns(rotation));
    gl.uniform2f(this.uniforms.scale, (2 * scale) / width, (2 * scale) / height);
    gl.uniform2f(this.uniforms.centre, (2 * centre[0]) / width - 1, 1 - (2 * centre[1]) / height);
    gl.uniform3f(this.uniforms.lamp, lamp[0], lamp[1], lamp[2]);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.strands);
    const corners = Float32Array.from(couplings.flatMap((body) => [...triangles(body)]));
    gl.bufferData(gl.ARRAY_BUFFER, corners, gl.DYNAMIC_DRAW);
    const strands = { buffer: this.strands, count: corners.length / 9, body: { points: [], faces: [], turn: "", part: "couplings" } };
    for (const { buffer, count, body } of [...this.meshes.filter((mesh) => isShown(mesh.body)), strands]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      this.attributes.forEach((attribute, index) => gl.vertexAttribPointer(attribute, 3, gl.FLOAT, false, 36, 12 * index));
      gl.uniformMatrix3fv(this.uniforms.turn, false, columns(turns[body.turn]));
      gl.uniform4f(this.uniforms.warm, WARM[0] / 255, WARM[1] / 255, WARM[2] / 255, 0.9 * warmth(body));
      gl.drawArrays(gl.TRIANGLES, 0, count);
    }
    return canvas;
  }
}

/** The unit normal of a polygon by Newell's method. @param {number[]} points @param {number[]} corners */
function normal(points, corners) {
  let [x, y, z] = [0, 0, 0];
  for (let k = 0, before = corners[corners.length - 1]; k < corners.length; before = corners[k++]) {
    const [a, b] = [3 * before, 3 * corners[k]];
    x += (points[a + 1] - points[b + 1]) * (points[a + 2] + points[b + 2]);
    y += (points[a + 2] - points[b + 2]) * (points[a] + points[b]);
    z += (points[a] - points[b]) * (points[a + 1] + points[b + 1]);
  }
  const length = Math.hypot(x, y, z) || 1;
  return [x / length, y / length, z / length];
}

/** A matrix (3, 3) in the column-major order of WebGL. @param {number[]} m */
function columns(m) {
  return [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];
}

/** Position, normal and colour of each corner of a body's triangles. @param {Solid} body */
function triangles({ points, faces }) {
  const all = [];
  for (const { corners, colour } of faces) {
    const own = [...normal(points, corners), ...colour.map((part) => part / 255)];
    // From both ends to the middle: a face of a ring consists of an outer and an inner arc.
    for (let [first, last] = [0, corners.length - 1]; last - first > 1; first++, last--) {
      const [a, b, c, d] = [corners[first], corners[first + 1], corners[last - 1], corners[last]];
      for (const corner of last - first > 2 ? [a, b, d, b, c, d] : [a, b, d]) {
        all.push(points[3 * corner], points[3 * corner + 1], points[3 * corner + 2], ...own);
      }
    }
  }
  return Float32Array.from(all);
}

/** The torques of a coupling: names, and the colours of their arrows. */
const FORCES = [{ name: "spring", colour: "text-3" }, { name: "damper", colour: "text-2" }];
/** Colour of the largest torque. */
const WARM = [214, 32, 32];
/** Distance from the viewer to the centre, and the number of cam lobes until the FMU is read. */
const [DISTANCE, LOBES] = [20, 4];

/** The shaders: the perspective of `Wrist.project`, and lighting on both sides of the faces. */
const CORNERS = `
attribute vec3 position, normal, colour;
uniform mat3 camera, turn;
uniform vec2 scale, centre;
varying vec3 own, face;
void main() {
  vec3 seen = camera * (turn * position);
  float far = ${DISTANCE}.0 - seen.z;
  gl_Position = vec4(centre * far + scale * ${DISTANCE}.0 * seen.xy, (far - ${DISTANCE}.0) / 10.0 * far, far);
  own = colour;
  face = turn * normal;
}`;
const PIXELS = `
precision mediump float;
uniform vec3 lamp;
uniform vec4 warm;
varying vec3 own, face;
void main() {
  vec3 normal = normalize(face);
  float light = dot(normal, lamp) * (gl_FrontFacing ? 1.0 : -1.0);
  gl_FragColor = vec4(mix(own, warm.rgb, warm.a) * (0.62 + 0.38 * max(0.0, light)), 1.0);
}`;
