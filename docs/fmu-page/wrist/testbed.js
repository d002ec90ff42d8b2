// The add-on of the testbed: motions of the motors, the frequency response, the closed loop. steps.js has the guide.

/** Pole of pitch with the parameters of Table 1, 1/s, for the input shaper. */
const PITCH_POLE = { real: -9.683, imaginary: 34.678 };
/** Numbers that the guide changes: angles of the motors (deg), frequency of the vibration (Hz), goals of the controller and slip of motor 2 (deg). */
const NUMBERS = { cam: 40, alone: 20, angle: 40, frequency: 1, pitch_goal: 25, roll_goal: 50, slip: 8 };
/** Angle of the fast move, deg, its duration, and the times at which it begins: in one go, and in two parts, s. */
const FAST = { angle: 20, duration: 0.1, begin: 0.1, again: 1.9 };
/** Time between the two parts of the shaped move: half a swing, s. Share of the second part. */
const [HALF_SWING, SECOND_SHARE] = shaper();
/** Lowest and highest frequency of the response, and the distance of its points, Hz. */
const BAND = [0.5, 15, 0.05];
/** Largest angle of a motor that is moved by hand, rad. */
const REACH = Math.PI / 2;
/** Times at which motor 1, alone, begins to turn and stops, s. */
const ALONE_MOVES = [0.2, 0.9];
/** Time at which motor 2 slips, and time at which the errors of the loop are stated, s. */
const [SLIPS, LATE] = [1.5, 3.3];
/** Integral gain of the controller in the loop, 1/s. With its own gain, 3, a visitor would wait long for the end of a correction. */
const GAIN = 20;
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

/** To one side, to the other side, and back. @param {number} time @param {number} angle deg */
function swing(time, angle = NUMBERS.angle) {
  const [first, second, third] = [quintic(time, 0.7), quintic(time - 0.7, 1), quintic(time - 1.7, 0.7)];
  return [0, 1].map((k) => angle * (first[k] - 2 * second[k] + third[k]));
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

/** The time between the parts of the shaped move, and the share of the second part: they cancel the vibration with the pole of pitch. */
function shaper() {
  const later = Math.PI / PITCH_POLE.imaginary;
  const weight = Math.exp(PITCH_POLE.real * later);
  return [later, weight / (1 + weight)];
}

/** A fast move, in one go or in two parts. @param {number} time since it begins @param {boolean} isShaped */
function move(time, isShaped) {
  const share = isShaped ? SECOND_SHARE : 0;
  const [first, second] = [quintic(time, FAST.duration), quintic(time - HALF_SWING, FAST.duration)];
  return [0, 1].map((k) => FAST.angle * ((1 - share) * first[k] + share * second[k]));
}

/** The fast move in one go, slowly back, and the same move in two parts. @param {number} time */
function stops(time) {
  const [fast, back, shaped] = [move(time - FAST.begin, false), quintic(time - 1.1, 0.6), move(time - FAST.again, true)];
  return [0, 1].map((k) => fast[k] - FAST.angle * back[k] + shaped[k]);
}

/** Motor 1 turns, stays, and turns back. @param {number} time */
function alone(time) {
  const [begin, end] = ALONE_MOVES;
  const [there, back] = [quintic(time - begin, end - begin), quintic(time - 2, end - begin)];
  return [0, 1].map((k) => NUMBERS.alone * (there[k] - back[k]));
}

/** Both discs turn together, and then against each other. @param {number} time @param {number} angle deg @returns {[number, number, number, number]} */
function tour(time, angle) {
  return time < 2.5 ? both(swing(time, angle)) : both(swing(time - 2.6, angle), -1);
}

/** @type {Motion[]} */
const MOTIONS = [
  { ...motorMotion("cam", "The cam: both discs the same way, then against each other", 5.2, (time) => tour(time, NUMBERS.cam)), notes: [[1.2, "same way: pitch"], [3.8, "against: roll"]] },
  motorMotion("one", "Motor 1 turns, motor 2 stands still", 3, (time) => {
    const [theta, omega] = alone(time);
    return [theta, 0, omega, 0];
  }),
  { ...motorMotion("tour", "Both motors: equal angles pitch, opposite angles roll", 5.2, (time) => tour(time, NUMBERS.angle)), notes: [[1.2, "together: pitch"], [3.8, "against: roll"]] },
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
  { ...motorMotion("stop", "Stop dead: a move of 20\u00b0 in one go, then in two parts", 2.9, (time) => both(stops(time))), notes: [[0.55, "in one go"], [2.3, "in two parts"]] },
  motorMotion("move", "A move of 20\u00b0 in 0.1 s, in one go", 1, (time) => both(move(time - FAST.begin, false))),
  { ...motorMotion("shaped", "A move of 20\u00b0 in two parts (an input shaper for the default k\u2081 and k\u2082)", 1, (time) => both(move(time - FAST.begin, true))), other: { id: "move", label: "in one go" } },
];

/** Inputs of the controller, columns with the slip of motor 2, and more inputs and the outputs of the controller. */
const [SET_POINTS, SLIPPED, MEASURED, MOTORS] = [["pitch_ref", "roll_ref"], ["slip", "slip_rate"], ["pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2"], ["theta1", "theta2", "omega1", "omega2"]];

/** Frequency response of pitch to equal motor angles, measured with a pulse on a second instance of the FMU. */
class Resonance {
  /** @param {Package} own @param {(frequency: number) => void} choose */
  constructor(own, choose) {
    this.fmu = new Fmu(own);
    const find = (/** @type {string} */ name) => /** @type {Variable} */ (own.description.byName.get(name));
    this.motors = this.fmu.group(MOTORS.map(find));
    this.pitch = this.fmu.group([find("pitch")]);
    this.plots = new Plots([{ title: "Swing: wrist / motors", unit: "", isNoted: true, curves: [{ name: "gain", label: "at this frequency", colour: "curve-3", factor: 1 }] }], choose, "frequency (Hz)");
    this.element = this.plots.element;
    this.key = "";
    /** Responses with the parameters as the page opens, and with the current parameters. @type {(Table | undefined)[]} */
    this.measured = [];
    this.defaults = new Map([[find("use_omega"), 1]]);
  }

  /** @param {Motion | null} motion @param {number} time @param {Map<Variable, number | string>} start */
  draw(motion, time, start) {
    this.element.hidden = !motion?.frequency;
    if (!motion?.frequency) {
      return;
    }
    this.update(start);
    const [preset, measured] = this.measured;
    const peaks = this.peaks();
    if (measured && preset && peaks) {
      const isOther = peaks.now.join() !== peaks.preset.join();
      const [frequency, gain] = peaks.now;
      this.plots.draw(measured, motion.frequency(time), BAND[0], BAND[1], isOther ? { table: preset, label: "with the FMU\u2019s own values" } : null, gain > 1.02 ? [[frequency, `peak: ${gain.toFixed(2)} at ${frequency.toFixed(2)} Hz`]] : []);
    }
  }

  /** Measures the response with other parameters. @param {Map<Variable, number | string>} start */
  update(start) {
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
  }

  /** The response at a frequency, Hz. @param {number} frequency */
  at(frequency) {
    return this.measured[1] ? this.measured[1].at("gain", frequency) : NaN;
  }

  /** Frequency (Hz) and height of the peak now, and with the parameters as the page opens. */
  peaks() {
    const [preset, now] = this.measured.map((table) => {
      const gains = table ? table.column("gain").subarray(0, table.count) : new Float64Array();
      const top = gains.reduce((best, gain, row) => (gain > gains[best] ? row : best), 0);
      return table ? [table.column("time")[top], gains[top]] : [];
    });
    return preset && now ? { now, preset } : null;
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
    for (let point = 0; BAND[0] + point * BAND[2] <= BAND[1] + 1e-9; point++) {
      const frequency = BAND[0] + point * BAND[2];
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
 * points pitch the wrist and roll it. Then motor 2 slips on its shaft, which the controller does not know.
 * @param {Fmu} fmu the controller @param {string} id @param {string} title @param {Record<string, number>} gains @param {Motion["other"]} [other]
 * @returns {Motion}
 */
function closedLoop(fmu, id, title, gains, other) {
  const [controllerInputs, motors] = [new Float64Array(8), new Float64Array(4)];
  const find = (/** @type {string} */ name) => /** @type {Variable} */ (fmu.description.byName.get(name));
  const [inputGroup, outputGroup] = [[...SET_POINTS, ...MEASURED], MOTORS].map((names) => fmu.group(names.map(find)));
  return {
    id, title, length: 3.4, other,
    begin: () => fmu.begin(new Map(Object.entries(gains).map(([gain, value]) => [find(gain), value]))),
    inputs: (time, inputs, table) => {
      const row = table.count;
      SET_POINTS.forEach((name, axis) => (table.column(name)[row] = DEGREE * (time >= [0.1, 0.9][axis] ? [NUMBERS.pitch_goal, NUMBERS.roll_goal][axis] : 0)));
      if (row > 0) {
        [...SET_POINTS, ...MEASURED].forEach((name, index) => (controllerInputs[index] = table.column(name)[row - 1]));
        fmu.set(inputGroup, controllerInputs);
        fmu.stepTo(time);
      }
      fmu.get(outputGroup, motors);
      const slips = quintic(time - SLIPS, 0.1).map((part) => part * NUMBERS.slip * DEGREE);
      SLIPPED.forEach((name, index) => (table.column(name)[row] = slips[index]));
      MOTORS.forEach((name, index) => (inputs[name] = motors[index] + (index % 2 ? slips[index >> 1] : 0)));
    },
  };
}

addOns.prw_testbed = (own, others) => {
  const goals = SET_POINTS.map((name, axis) => ({ name, label: `${["pitch", "roll"][axis]} wanted`, colour: `curve-${3 + axis}`, factor: 1 / DEGREE, isGoal: true }));
  return {
    lead: LEAD,
    guide: others.length ? GUIDE : GUIDE.filter(({ settings }) => settings.motion !== "closed-loop"),
    numbers: NUMBERS,
    limits: DIALS,
    response: (change) => new Resonance(own, (frequency) => change("frequency", Math.round(frequency / BAND[2]) * BAND[2])),
    near: { k1: "stiffness, motor side", k2: "stiffness, wrist side", c1: "damping, motor side", c2: "damping, wrist side" },
    label: "Motion",
    start: { use_omega: 1 },
    sliders: [
      { name: "theta1", label: "Motor 1", reach: REACH },
      { name: "theta2", label: "Motor 2", reach: REACH },
    ],
    recorded: ["theta5", "theta6"],
    written: [...SET_POINTS, ...SLIPPED],
    isAtRest: true,
    motions: [
      ...MOTIONS,
      ...others.map((one) => new Fmu(one)).flatMap((controller) => [
        closedLoop(controller, "closed-loop", "The controller FMU closes the loop", { Ki: GAIN }, { id: "open-loop", label: "without feedback" }),
        closedLoop(controller, "open-loop", "The controller FMU with gains 0: without feedback", { Kp: 0, Ki: 0, Kd: 0 }),
      ]),
    ],
    panels: WRIST_PANELS.map((panel) => (panel.title === "Wrist" ? { ...panel, curves: [...panel.curves, ...goals] } : panel)),
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
    view: (turn, value, pace) =>
      wristView(({ theta1 = 0, theta2 = 0, pitch = 0, roll = 0 }) => {
        // The inverse of eq. (1): the motor angles of a pitch and a roll angle.
        const half = (value("M") / value("N")) * roll;
        turn(...(theta1 ? [{ theta1 }] : theta2 ? [{ theta2 }] : [{ theta1: pitch, theta2: pitch }, { theta1: half, theta2: -half }]));
      }, ["motors", "gripper"], pace, "k2"),
  };
};
