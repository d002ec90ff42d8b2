// The testbed on its page: motions of the motors, sliders for them, the wrist.

/** Of pitch, with the parameters of Table 1, 1/s: what the shaper of the last motion knows. */
const PITCH_POLE = { real: -9.683, imaginary: 34.678 };
/** Motors follow the sliders like this, 1/s: critically damped. */
const FOLLOW = 25;

/** Way and speed at a time of a move of length 1 from 0 to `duration`, with the least jerk. @param {number} time @param {number} duration */
function quintic(time, duration) {
  const s = Math.min(1, Math.max(0, time / duration));
  return [s ** 3 * (10 - 15 * s + 6 * s * s), (30 * s * s * (1 - s) ** 2) / duration];
}

/** A motion of both motors. @param {string} id @param {string} title @param {number} length s @param {(time: number) => [number, number, number, number]} motors angles (deg) and rates (deg/s) @returns {Motion} */
function led(id, title, length, motors) {
  return {
    id, title, length,
    inputs: (time, inputs) => {
      const [theta1, theta2, omega1, omega2] = motors(time);
      Object.assign(inputs, { theta1: theta1 * DEGREE, theta2: theta2 * DEGREE, omega1: omega1 * DEGREE, omega2: omega2 * DEGREE });
    },
  };
}

/** Both motors alike, or one against the other. @param {number[]} course angle and rate @param {number} second @returns {[number, number, number, number]} */
function both([theta, omega], second = 1) {
  return [theta, second * theta, omega, second * omega];
}

/** There and back, to both sides. @param {number} time */
function swing(time) {
  const [there, across, back] = [quintic(time, 0.7), quintic(time - 0.7, 1), quintic(time - 1.7, 0.7)];
  return [0, 1].map((k) => 40 * (there[k] - 2 * across[k] + back[k]));
}

/** The course of Fig. 4 (Sec. 4): sin(10 pi t) rad/s. @param {number} time */
function sine(time) {
  const frequency = 10 * Math.PI;
  return [(2 * Math.sin((frequency * time) / 2) ** 2) / frequency / DEGREE, Math.sin(frequency * time) / DEGREE];
}

/** A sine whose frequency rises from 0.5 to 15 Hz within 8 s, from rest. @param {number} time */
function chirp(time) {
  const [low, rise, size] = [0.5, 14.5 / 8, 2];
  const phase = 2 * Math.PI * (low * time + (rise * time * time) / 2);
  return [size * (1 - Math.cos(phase)), size * 2 * Math.PI * (low + rise * time) * Math.sin(phase)];
}

/** 20 degrees in 0.1 s, as fast; or half of it at first and half of it later, so that no vibration is left. @param {number} time @param {boolean} isShaped */
function move(time, isShaped) {
  const later = Math.PI / PITCH_POLE.imaginary;
  const weight = isShaped ? Math.exp(PITCH_POLE.real * later) : 0;
  const [first, second] = [quintic(time - 0.1, 0.1), quintic(time - 0.1 - later, 0.1)];
  return [0, 1].map((k) => (20 * (first[k] + weight * second[k])) / (1 + weight));
}

/** @type {Motion[]} */
const MOTIONS = [
  led("tour", "Both ways: equal motors pitch the wrist, opposite ones roll it", 5.2, (time) => (time < 2.5 ? both(swing(time)) : both(swing(time - 2.6), -1))),
  led("pitch", "Pitch: both motors alike", 2.6, (time) => both(swing(time))),
  led("roll", "Roll: one motor against the other", 2.6, (time) => both(swing(time), -1)),
  led("fig4", "The paper\u2019s Fig. 4: opposite rates, sin(10\u03c0t) rad/s", 2, (time) => both(sine(time), -1)),
  led("fig4-equal", "The same with equal rates", 2, (time) => both(sine(time))),
  led("step", "A step: motor 1 turns by 20\u00b0 in 20 ms, motor 2 stands", 1, (time) => {
    const [theta, omega] = quintic(time - 0.1, 0.02);
    return [20 * theta, 0, 20 * omega, 0];
  }),
  led("chirp", "A chirp: 0.5 to 15 Hz", 8, (time) => both(chirp(time))),
  led("move", "A move by 20\u00b0 in 0.1 s", 1, (time) => both(move(time, false))),
  led("shaped", "The same move with an input shaper, for the k\u2081 and k\u2082 that are built in", 1, (time) => both(move(time, true))),
];

/** What the controller is told, and what it says. */
const [SET_POINTS, MEASURED, MOTORS] = [["pitch_ref", "roll_ref"], ["pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2"], ["theta1", "theta2", "omega1", "omega2"]];

/**
 * The controller's FMU drives the testbed's: at each communication point, either is told what the other says there. The wrist is
 * to pitch, to roll, and to come back.
 * @param {Fmu} fmu the controller @param {string} id @param {string} title @param {string[]} off gains that are 0
 * @returns {Motion}
 */
function looped(fmu, id, title, off) {
  const [answers, motors] = [new Float64Array(8), new Float64Array(4)];
  const find = (/** @type {string} */ name) => /** @type {Variable} */ (fmu.description.byName.get(name));
  const [told, says] = [[...SET_POINTS, ...MEASURED], MOTORS].map((names) => fmu.group(names.map(find)));
  return {
    id, title, length: 2.6,
    begin: () => fmu.begin(new Map(off.map((gain) => [find(gain), 0]))),
    inputs: (time, inputs, table) => {
      const row = table.count;
      SET_POINTS.forEach((name, axis) => (table.column(name)[row] = DEGREE * (time >= [0.1, 0.9][axis] && time < 1.7 ? [25, 50][axis] : 0)));
      if (row > 0) {
        [...SET_POINTS, ...MEASURED].forEach((name, place) => (answers[place] = table.column(name)[row - 1]));
        fmu.set(told, answers);
        fmu.stepTo(time);
      }
      fmu.get(says, motors);
      MOTORS.forEach((name, place) => (inputs[name] = motors[place]));
    },
  };
}

addOns.prw_testbed = (_, others) => {
  const goals = SET_POINTS.map((name) => ({ name, label: name.replace("_", " "), colour: "soft", factor: 1 / DEGREE }));
  /** @type {HTMLSelectElement} */
  const twist = element("select", { "aria-label": "Enlargement of the couplings\u2019 twist" }, element("option", { value: "0" }, "twist: automatic"), ...["1", "5", "20", "50", "100"].map((value) => element("option", { value }, `twist \u00d7 ${value}`)));
  return {
    lead: "Two motors move a robotic wrist: drag a motor, or press a button.",
    buttons: [{ label: "Pitch", motion: "pitch" }, { label: "Roll", motion: "roll" }, { label: "Shake it", motion: "chirp" }],
    near: { k1: "stiffness, motor side", k2: "stiffness, wrist side", c1: "damping, motor side", c2: "damping, wrist side" },
    word: "Motion",
    start: { use_omega: 1 },
    sliders: [
      { name: "theta1", label: "Motor 1", reach: Math.PI / 2 },
      { name: "theta2", label: "Motor 2", reach: Math.PI / 2 },
    ],
    recorded: ["theta5", "theta6"],
    written: SET_POINTS,
    motions: [
      ...MOTIONS,
      ...others.map(({ description, module }) => new Fmu(description, module)).flatMap((controller) => [
        looped(controller, "closed-loop", "The controller FMU closes the loop (grey: set points)", []),
        looped(controller, "open-loop", "The same with its gains at 0: nothing is fed back", ["Kp", "Ki", "Kd"]),
      ]),
    ],
    panels: WRIST_PANELS.map((panel) => (panel.title === "Wrist" ? { ...panel, curves: [...goals, ...panel.curves] } : panel)),
    isMinor: (name) => name.endsWith("_start"),
    follow: (inputs, targets, size) => {
      const decay = Math.exp(-FOLLOW * size);
      for (const [theta, omega] of [["theta1", "omega1"], ["theta2", "omega2"]]) {
        const target = targets.get(theta) ?? 0;
        const away = inputs[theta] - target;
        const slope = inputs[omega] + FOLLOW * away;
        inputs[theta] = target + (away + slope * size) * decay;
        inputs[omega] = (inputs[omega] - FOLLOW * slope * size) * decay;
      }
    },
    view: (turn) => {
      const wrist = new Wrist(WRIST, turn);
      twist.addEventListener("change", () => wrist.enlarge(Number(twist.value)));
      return { element: wrist.element, draw: (table, time) => wrist.draw(table, time), set: (parameter) => wrist.count(parameter("M"), parameter("N")), controls: [twist], settings: new Map([["twist", twist]]) };
    },
  };
};
