// The add-on of the testbed: motions of the motors, the guide, the frequency response, the wrist.

/** Pole of pitch with the parameters of Table 1, 1/s, for the input shaper. */
const PITCH_POLE = { real: -9.683, imaginary: 34.678 };
/** Numbers that the guide changes: angle of the motors (deg) and frequency of the vibration (Hz). */
const NUMBERS = { angle: 40, frequency: 4 };
/** Lowest and highest frequency of the response, Hz. */
const BAND = [0.5, 15];
/** Double pole with which the motors follow the sliders, 1/s. */
const FOLLOW = 25;

/** Position and rate of a minimum-jerk move from 0 to 1 within `duration`. @param {number} time @param {number} duration */
function quintic(time, duration) {
  const s = Math.min(1, Math.max(0, time / duration));
  return [s ** 3 * (10 - 15 * s + 6 * s * s), (30 * s * s * (1 - s) ** 2) / duration];
}

/** A motion with given angles and rates of the motors. @param {string} id @param {string} title @param {number} length s @param {(time: number) => [number, number, number, number]} motors angles (deg) and rates (deg/s) @returns {Motion} */
function motorMotion(id, title, length, motors) {
  return {
    id, title, length,
    inputs: (time, inputs) => {
      const [theta1, theta2, omega1, omega2] = motors(time);
      Object.assign(inputs, { theta1: theta1 * DEGREE, theta2: theta2 * DEGREE, omega1: omega1 * DEGREE, omega2: omega2 * DEGREE });
    },
  };
}

/** The same motion of both motors, or with opposite signs. @param {number[]} motion angle and rate @param {number} second @returns {[number, number, number, number]} */
function both([theta, omega], second = 1) {
  return [theta, second * theta, omega, second * omega];
}

/** To one side, to the other side, and back. @param {number} time */
function swing(time) {
  const [first, second, third] = [quintic(time, 0.7), quintic(time - 0.7, 1), quintic(time - 1.7, 0.7)];
  return [0, 1].map((k) => NUMBERS.angle * (first[k] - 2 * second[k] + third[k]));
}

/** The motion of Fig. 4 (Sec. 4): a rate of sin(10 pi t) rad/s. @param {number} time */
function sine(time) {
  const frequency = 10 * Math.PI;
  return [(2 * Math.sin((frequency * time) / 2) ** 2) / frequency / DEGREE, Math.sin(frequency * time) / DEGREE];
}

/** A vibration from 0 to 4 degrees. Its frequency starts at `low` Hz and increases by `rise` Hz/s. @param {number} time @param {number} low @param {number} rise */
function shaken(time, low, rise) {
  const phase = 2 * Math.PI * (low * time + (rise * time * time) / 2);
  return [2 * (1 - Math.cos(phase)), 4 * Math.PI * (low + rise * time) * Math.sin(phase)];
}

/** A move of 20 degrees in 0.1 s, or two shaped moves that cancel the vibration. @param {number} time @param {boolean} isShaped */
function move(time, isShaped) {
  const later = Math.PI / PITCH_POLE.imaginary;
  const weight = isShaped ? Math.exp(PITCH_POLE.real * later) : 0;
  const [first, second] = [quintic(time - 0.1, 0.1), quintic(time - 0.1 - later, 0.1)];
  return [0, 1].map((k) => (20 * (first[k] + weight * second[k])) / (1 + weight));
}

/** @type {Motion[]} */
const MOTIONS = [
  motorMotion("tour", "Both axes: equal angles pitch, opposite angles roll", 5.2, (time) => (time < 2.5 ? both(swing(time)) : both(swing(time - 2.6), -1))),
  motorMotion("pitch", "Pitch: equal motor angles", 2.6, (time) => both(swing(time))),
  motorMotion("roll", "Roll: opposite motor angles", 2.6, (time) => both(swing(time), -1)),
  motorMotion("fig4", "The paper\u2019s Fig. 4: opposite rates, sin(10\u03c0t) rad/s", 2, (time) => both(sine(time), -1)),
  motorMotion("fig4-equal", "The paper\u2019s Fig. 4 with equal rates", 2, (time) => both(sine(time))),
  motorMotion("step", "A step: motor 1 turns by 20\u00b0 in 20 ms, motor 2 is at rest", 1, (time) => {
    const [theta, omega] = quintic(time - 0.1, 0.02);
    return [20 * theta, 0, 20 * omega, 0];
  }),
  { ...motorMotion("shake", "Vibration at one frequency, equal motor angles", 3, (time) => both(shaken(time, NUMBERS.frequency, 0))), frequency: () => NUMBERS.frequency },
  { ...motorMotion("chirp", "A chirp: 0.5 to 15 Hz", 8, (time) => both(shaken(time, BAND[0], (BAND[1] - BAND[0]) / 8))), frequency: (time) => BAND[0] + ((BAND[1] - BAND[0]) * time) / 8 },
  motorMotion("move", "A move of 20\u00b0 in 0.1 s", 1, (time) => both(move(time, false))),
  { ...motorMotion("shaped", "The move of 20\u00b0 with an input shaper for the default k\u2081 and k\u2082", 1, (time) => both(move(time, true))), before: "move" },
];

/** The numbers in the paragraphs of the guide. */
const [ANGLE, FREQUENCY, SOFTNESS] = [
  { name: "angle", label: "Angle of the motors", low: 5, high: 60, step: 1, unit: "\u00b0" },
  { name: "frequency", label: "Frequency", low: 0.5, high: 15, step: 0.1, unit: "Hz" },
  { name: "k2", label: "Stiffness k2", low: 0.1, high: 2, step: 0.02, unit: "N\u00b7m/deg" },
];
/** @type {Chapter[]} */
const GUIDE = [
  { title: "Pitch", settings: { motion: "pitch" }, parts: ["Both motors turn by ", ANGLE, " to either side. The ring turns with them, so the wrist pitches by the same angle. Drag the underlined number."] },
  { title: "Roll", settings: { motion: "roll" }, parts: ["The motors turn by ", ANGLE, " in opposite directions. The ring is at rest, and the gripper rolls by N/M\u00a0=\u00a07/4 of that angle."] },
  { title: "Shake", settings: { motion: "shake", k2: String(0.3 / DEGREE) }, parts: ["Both motors vibrate at ", FREQUENCY, ", and k\u2082 is reduced to ", SOFTNESS, ". The first plot shows the response at all frequencies, in grey with the default k\u2082. Drag the frequency to the peak."] },
  { title: "Shape", settings: { motion: "shaped" }, parts: ["A move in 0.1\u00a0s makes the wrist vibrate (grey curve). Two half moves, half a period apart, end without vibration. Drag k\u2082 away from ", SOFTNESS, ": the shaper no longer cancels the vibration."] },
];

/** Inputs and outputs of the controller. */
const [SET_POINTS, MEASURED, MOTORS] = [["pitch_ref", "roll_ref"], ["pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2"], ["theta1", "theta2", "omega1", "omega2"]];

/** Frequency response of pitch to equal motor angles, measured with a pulse on a second instance of the FMU. */
class Resonance {
  /** @param {Package} own @param {(frequency: number) => void} choose */
  constructor(own, choose) {
    this.fmu = new Fmu(own);
    const find = (/** @type {string} */ name) => /** @type {Variable} */ (own.description.byName.get(name));
    this.motors = this.fmu.group(MOTORS.map(find));
    this.pitch = this.fmu.group([find("pitch")]);
    this.plots = new Plots([{ title: "Response: pitch for 1\u00b0 of both motors", unit: "", curves: [{ name: "gain", label: "at the cursor", colour: "curve-3", factor: 1 }] }], choose, "frequency (Hz)");
    this.element = this.plots.element;
    this.key = "";
    /** Responses with the default parameters and with the current parameters. @type {(Table | undefined)[]} */
    this.measured = [];
    this.defaults = new Map([[find("use_omega"), 1]]);
  }

  /** @param {Motion | null} motion @param {number} time @param {Map<Variable, number | string>} start */
  draw(motion, time, start) {
    this.element.hidden = !motion?.frequency;
    if (!motion?.frequency) {
      return;
    }
    const key = [...start].map(([{ name }, value]) => `${name}=${value}`).join();
    if (key !== this.key) {
      this.key = key;
      try {
        this.measured = [this.measured[0] ?? this.measure(this.defaults), this.measure(start)];
      } catch {
        // The run shows the message of the FMU.
        this.measured.length = 1;
      }
    }
    const [reference, measured] = this.measured;
    if (measured) {
      this.plots.draw(measured, motion.frequency(time), BAND[0], BAND[1], reference);
    }
  }

  /** Runs a pulse and divides the Fourier transforms of pitch and pulse. @param {Map<Variable, number | string>} start */
  measure(start) {
    const [size, steps, rate] = [0.004, 600, 1];
    const pitch = new Float64Array(steps);
    this.fmu.begin(start);
    for (let step = 0; step < steps; step++) {
      const [theta, omega] = [step === 1 ? rate * size : 0, [rate, -rate][step] ?? 0];
      this.fmu.set(this.motors, [theta, theta, omega, omega]);
      this.fmu.get(this.pitch, pitch.subarray(step, step + 1));
      this.fmu.stepTo((step + 1) * size);
    }
    const table = new Table(["gain"]);
    for (let frequency = BAND[0]; frequency <= BAND[1] + 1e-9; frequency += 0.1) {
      const turn = 2 * Math.PI * frequency * size;
      let [real, imaginary] = [0, 0];
      for (let step = 0; step < steps; step++) {
        real += pitch[step] * Math.cos(turn * step);
        imaginary += pitch[step] * Math.sin(turn * step);
      }
      // Fourier transform of the triangular pulse, divided by the step size.
      const pulse = rate * size * (Math.sin(turn / 2) / (turn / 2)) ** 2;
      table.grow();
      table.column("time")[table.count] = frequency;
      table.column("gain")[table.count++] = Math.hypot(real, imaginary) / pulse;
    }
    return table;
  }
}

/**
 * A motion in which the controller FMU drives the testbed FMU: at each communication point, they exchange their outputs. The set
 * points pitch the wrist, roll it, and return.
 * @param {Fmu} fmu the controller @param {string} id @param {string} title @param {string[]} off gains that are 0
 * @returns {Motion}
 */
function closedLoop(fmu, id, title, off) {
  const [controllerInputs, motors] = [new Float64Array(8), new Float64Array(4)];
  const find = (/** @type {string} */ name) => /** @type {Variable} */ (fmu.description.byName.get(name));
  const [inputGroup, outputGroup] = [[...SET_POINTS, ...MEASURED], MOTORS].map((names) => fmu.group(names.map(find)));
  return {
    id, title, length: 2.6,
    begin: () => fmu.begin(new Map(off.map((gain) => [find(gain), 0]))),
    inputs: (time, inputs, table) => {
      const row = table.count;
      SET_POINTS.forEach((name, axis) => (table.column(name)[row] = DEGREE * (time >= [0.1, 0.9][axis] && time < 1.7 ? [25, 50][axis] : 0)));
      if (row > 0) {
        [...SET_POINTS, ...MEASURED].forEach((name, index) => (controllerInputs[index] = table.column(name)[row - 1]));
        fmu.set(inputGroup, controllerInputs);
        fmu.stepTo(time);
      }
      fmu.get(outputGroup, motors);
      MOTORS.forEach((name, index) => (inputs[name] = motors[index]));
    },
  };
}

addOns.prw_testbed = (own, others) => {
  const goals = SET_POINTS.map((name) => ({ name, label: name.replace("_", " "), colour: "soft", factor: 1 / DEGREE }));
  /** @type {HTMLSelectElement} */
  const twist = element("select", { "aria-label": "Enlargement of the couplings\u2019 twist" }, element("option", { value: "0" }, "twist: automatic"), ...["1", "5", "20", "50", "100"].map((value) => element("option", { value }, `twist \u00d7 ${value}`)));
  return {
    lead: "Two motors move a robotic wrist. Drag a motor, or follow the four steps above.",
    guide: GUIDE,
    numbers: NUMBERS,
    response: (change) => new Resonance(own, (frequency) => change("frequency", Math.round(10 * frequency) / 10)),
    near: { k1: "stiffness, motor side", k2: "stiffness, wrist side", c1: "damping, motor side", c2: "damping, wrist side" },
    label: "Motion",
    start: { use_omega: 1 },
    sliders: [
      { name: "theta1", label: "Motor 1", reach: Math.PI / 2 },
      { name: "theta2", label: "Motor 2", reach: Math.PI / 2 },
    ],
    recorded: ["theta5", "theta6"],
    written: SET_POINTS,
    motions: [
      ...MOTIONS,
      ...others.map((one) => new Fmu(one)).flatMap((controller) => [
        closedLoop(controller, "closed-loop", "The controller FMU closes the loop (grey: set points)", []),
        closedLoop(controller, "open-loop", "The controller FMU with gains 0: open loop (grey: set points)", ["Kp", "Ki", "Kd"]),
      ]),
    ],
    panels: WRIST_PANELS.map((panel) => (panel.title === "Wrist" ? { ...panel, curves: [...goals, ...panel.curves] } : panel)),
    isMinor: (name) => name.endsWith("_start"),
    follow: (inputs, targets, size) => {
      const decay = Math.exp(-FOLLOW * size);
      for (const [theta, omega] of [["theta1", "omega1"], ["theta2", "omega2"]]) {
        const target = targets.get(theta) ?? 0;
        const error = inputs[theta] - target;
        const slope = inputs[omega] + FOLLOW * error;
        inputs[theta] = target + (error + slope * size) * decay;
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
