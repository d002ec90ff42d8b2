// The steps of the guide. Each sentence is true at every value that a reader can set, or depends on the values.

/** Numbers in the paragraphs. */
const [ALONE, ANGLE, FREQUENCY, SOFTNESS, PITCH_GOAL, ROLL_GOAL, SLIP] = [
  { name: "alone", label: "Angle of motor 1", low: 5, high: 60, step: 1, unit: "\u00b0" },
  { name: "angle", label: "Angle of the motors", low: 5, high: 60, step: 1, unit: "\u00b0" },
  { name: "frequency", label: "Frequency", low: 0.5, high: 15, step: 0.05, unit: "Hz" },
  { name: "k2", label: "Stiffness k2", low: 0.1, high: 2, step: 0.02, unit: "N\u00b7m/\u00b0" },
  { name: "pitch_goal", label: "Pitch wanted", low: -30, high: 30, step: 1, unit: "\u00b0" },
  { name: "roll_goal", label: "Roll wanted", low: -60, high: 60, step: 1, unit: "\u00b0" },
  { name: "slip", label: "Slip of motor 2", low: -10, high: 10, step: 1, unit: "\u00b0" },
];
const DIALS = [ALONE, ANGLE, FREQUENCY, SOFTNESS, PITCH_GOAL, ROLL_GOAL, SLIP];

/** An angle in degrees with at most one decimal. @param {number} value */
function degrees(value) {
  return quantity(Math.round(10 * value) / 10 || 0, "deg");
}

/** An angle in degrees with exactly one decimal, so that it keeps its width while it moves. @param {number} value */
function tenths(value) {
  return `${format(value, 10)}\u00b0`;
}

/** The sum of two angles as it is written: 8.9° − 3.0°. @param {number} one @param {number} other */
function sum(one, other) {
  return `${tenths(one)} ${other < 0 ? "\u2212" : "+"} ${tenths(Math.abs(other))}`;
}

/** A ratio of two integers: "7/4", or "2". @param {number} top @param {number} bottom */
function fraction(top, bottom) {
  let [divisor, rest] = [top, bottom];
  while (rest) {
    [divisor, rest] = [rest, divisor % rest];
  }
  return bottom === divisor ? String(top / divisor) : `${top / divisor}/${bottom / divisor}`;
}

/** The motor angles that hold pitch and roll, by the inverse of eq. (1). @param {Facts} facts @param {number} pitch @param {number} roll */
function motorsFor({ value }, pitch, roll) {
  const half = (value("M") / value("N")) * roll;
  return [pitch + half, pitch - half];
}

/** Whether a parameter has its value from the FMU. @param {Facts} facts @param {string} name */
function isPreset({ value, preset }, name) {
  return Math.abs(value(name) - preset(name)) <= 1e-6 * Math.abs(preset(name));
}

/** The paragraph of runs outside of the steps. @type {Part[]} */
const LEAD = [
  (facts) => {
    if (facts.motion) {
      return `${facts.motion.title}. The steps above explain the machine; any other motion is in the list below.`;
    }
    const [theta1, theta2] = [facts.value("theta1"), facts.value("theta2")];
    const [pitch, roll] = [(theta1 + theta2) / 2, (facts.value("N") / facts.value("M")) * ((theta1 - theta2) / 2)];
    const [isFirst, isSecond] = [theta1, theta2].map((angle) => Math.abs(angle) > REACH / DEGREE - 1e-6);
    const end = isFirst && isSecond ? " Both motors are at their ends." : isFirst || isSecond ? ` Motor ${isFirst ? 1 : 2} is at its end, so the wrist stops where it would have to go on.` : "";
    return `Drag the gripper: up and down pitch it, left and right roll it, and the motors follow. For a pitch of ${degrees(pitch)} and a roll of ${degrees(roll)}, motor 1 must turn to ${degrees(theta1)} and motor 2 to ${degrees(theta2)}.${end}`;
  },
];

/** @type {Part[]} */
const WHAT_ONE = [
  "Motor 1 turns by ", ALONE, ", while motor 2 stands still. Which way will the gripper turn? ",
  ({ value }) => `Two ways at once: the green ring tilts by ${degrees(value("alone") / 2)} (pitch), and the purple gripper spins about its own axis by ${degrees((value("N") / value("M") / 2) * value("alone"))} (roll).`,
];
/** @type {Part[]} */
const WHY_ONE = [
  "The cam is held between the two sides, like a pencil between two palms. If only one side moves, the cam rolls along the other one, and its axis moves half as far as the moving side: the axis carries the ring along (pitch), and the rolling turns the gripper (roll). ",
  ({ table }) => {
    const [tau1, tau2] = table ? ["tau1", "tau2"].map((name) => table.at(name, FASTEST)) : [0, 0];
    if (!(tau1 < 0)) {
      return "";
    }
    const way = tau2 > 0 ? ["positive", "forward"] : ["negative", "back"];
    const held = Math.abs(tau2) > 0.01 * Math.abs(tau1) ? `; \u03c4\u2082 is ${way[0]} although motor 2 stands still, because the cam pushes its side ${way[1]} and the motor holds it` : "";
    return `A torque is what the wrist does to its motor: \u03c4\u2081 is negative while motor 1 speeds up, because the wrist resists${held}.`;
  },
];
/** @type {Part[]} */
const WHAT_BOTH = [
  ({ value }) => `Pitch is the mean of the two motor angles, and roll is ${fraction(value("N"), 2 * value("M"))} times their difference. What happens if both turn by `, ANGLE,
  ({ value }) => ` together, and then against each other? Together, the difference is zero, and the wrist only pitches. Against each other, the mean is zero, and it only rolls, by ${degrees((value("N") / value("M")) * value("angle"))}. Eq. (1), with the angles of the two discs now:`,
  { line: ({ value }) => `pitch = (${sum(value("theta5"), value("theta6"))}) / 2 = ${tenths((value("theta5") + value("theta6")) / 2)}` },
  { line: ({ value }) => `roll = ${fraction(value("N"), 2 * value("M"))} (${sum(value("theta5"), -value("theta6"))}) = ${tenths((value("N") / 2 / value("M")) * (value("theta5") - value("theta6")))}` },
];
/** @type {Part[]} */
const WHY_BOTH = [
  "Hold a pencil upright between your palms: palms that move together carry it along; palms that move against each other roll it. In the machine the cam is the pencil, and the palms are two discs ",
  ({ value }) => `with ${value("N")} ${value("N") === 1 ? "roller" : "rollers"} each, which push the ${value("M")} ${value("M") === 1 ? "lobe" : "lobes"} of the cam as the teeth of gears do. `,
  "\u201cLook inside\u201d shows them.",
];

/** The peak of the response as a sentence. @param {number[]} peak */
function peakAt([frequency, gain]) {
  return `${gain.toFixed(2)} times as far, at ${frequency.toFixed(2)}\u00a0Hz`;
}

/** @type {Part[]} */
const WHAT_SHAKE = [
  "Both motors shake to and fro by 4\u00b0 at ", FREQUENCY, ". At which frequency does the wrist swing farthest? ",
  ({ value, response }) => {
    const [gain, peaks] = [response?.at(value("frequency")) ?? NaN, response?.peaks()];
    if (!peaks || !(gain > 0)) {
      return "";
    }
    const far = `The wrist swings ${gain.toFixed(2)} times as far as the motors. `;
    if (peaks.now[1] < 1.02) {
      return `${far}No frequency makes it swing noticeably farther than the motors. `;
    }
    return Math.abs(value("frequency") - peaks.now[0]) < BAND[2] / 2 ? `${far}This is the peak: the resonance. ` : `${far}Drag the number to the peak in the first plot, or click there. `;
  },
  "Then change the stiffness of the couplings next to the wrist: k\u2082\u00a0= ", SOFTNESS, ". ",
  ({ response }) => {
    const peaks = response?.peaks();
    if (!peaks || peaks.now[1] < 1.02) {
      return "";
    }
    const isOther = Math.abs(peaks.now[1] - peaks.preset[1]) > 0.005 || Math.abs(peaks.now[0] - peaks.preset[0]) > 0.01;
    return `At the peak the wrist swings ${peakAt(peaks.now)}${isOther ? `; with the FMU\u2019s own values ${peakAt(peaks.preset)}` : ""}.`;
  },
];
/** @type {Part[]} */
const WHY_SHAKE = [
  "The couplings between motors and wrist are springs, each with a damper next to it. A wrist on springs has a rhythm of its own, like a child on a swing: pushes in that rhythm add up, so a machine should not be moved in it, or only with the trick of the next step. ",
  (facts) => {
    const peaks = facts.response?.peaks();
    const names = ["J2", "H3", "k1", "c1", "c2", "c3"];
    if (!peaks || isPreset(facts, "k2") || !names.every((name) => isPreset(facts, name))) {
      return "";
    }
    if (facts.value("k2") < facts.preset("k2") && peaks.now[1] < peaks.preset[1]) {
      return "A softer spring yields more under the same load, so the damper next to it moves farther and takes more out of the swing: the peak is lower, and at a lower frequency.";
    }
    return facts.value("k2") > facts.preset("k2") && peaks.now[1] > peaks.preset[1] ? "A stiffer spring yields less under the same load, so the damper next to it hardly moves and takes less out of the swing: the peak is higher, and at a higher frequency." : "";
  },
];

/** Time at which the move in two parts has ended, s. */
const SHAPED_END = FAST.again + HALF_SWING + FAST.duration;
/** How far the wrist swings beyond the fast move, and how far it falls behind it after that, in one go and in two parts, deg. @param {Table} table */
function overshoots(table) {
  return [[FAST.begin, 1.1], [FAST.again, 2.9]].map(([from, to]) => {
    const beyond = [...table.column("pitch").subarray(table.row(from), table.row(to) + 1)].map((pitch) => pitch / DEGREE - FAST.angle);
    const most = Math.max(...beyond);
    return [most, -Math.min(...beyond.slice(beyond.indexOf(most)))];
  });
}

/** @type {Part[]} */
const WHAT_STOP = [
  ({ table }) => {
    const [first, second] = [(1 - SECOND_SHARE) * FAST.angle, SECOND_SHARE * FAST.angle].map(degrees);
    const move = `Both motors turn by ${degrees(FAST.angle)} in ${FAST.duration}\u00a0s and stop dead. Does the wrist stop, too?`;
    const parts = `Then they make the same move in two parts, ${first} and, half a swing later, ${second}`;
    if (!table) {
      return `${move} ${parts}. `;
    }
    const [[plain, under], [shaped]] = overshoots(table);
    const isSwinging = plain > 0.05 && under > 0.05;
    const runsOn = plain > 0.05 ? `In one go, the wrist runs on to ${degrees(FAST.angle + plain)}${isSwinging ? " and swings" : ""}.` : "In one go, the wrist does not run on.";
    const rest = shaped > 0.05 ? `the wrist runs on by ${degrees(shaped)} only` : "the wrist does not run on";
    const ends = shaped < 0.2 * plain ? `: ${rest}${isSwinging ? ", because the second part stops the swing that the first one began" : ""}. ` : shaped > 0.05 ? `: the wrist runs on to ${degrees(FAST.angle + shaped)}. ` : ". ";
    return `${move} ${runsOn} ${parts}${ends}`;
  },
  "Change the stiffness: k\u2082\u00a0= ", SOFTNESS, ". ",
  (facts) => (["J2", "H3", "k1", "k2", "c1", "c2", "c3"].every((name) => isPreset(facts, name)) ? "The parts fit this stiffness." : "The parts stay those for the FMU\u2019s own values."),
];
/** @type {Part[]} */
const WHY_STOP = [
  `A robot must wait until its load has stopped swinging. With the FMU\u2019s own values a swing takes ${(2 * HALF_SWING).toFixed(2)}\u00a0s, so a second push after ${HALF_SWING.toFixed(2)}\u00a0s meets the swing on its way back and cancels it. The second push is smaller because the swing has become smaller meanwhile. Engineers call this input shaping; cranes stop their loads with it.`,
];
/** @type {Part[]} */
const WHAT_LOOP = [
  "A second FMU, a controller, measures the wrist and turns both motors to a pitch of ", PITCH_GOAL, " and, from 0.9\u00a0s on, a roll of ", ROLL_GOAL, ": ",
  (facts) => {
    const [theta1, theta2] = motorsFor(facts, facts.value("pitch_goal"), facts.value("roll_goal"));
    return `motor 1 to ${degrees(theta1)}, motor 2 to ${degrees(theta2)}. `;
  },
  "At 1.5\u00a0s motor 2 slips on its shaft by ", SLIP, ". Does the wrist come back? ",
  ({ value, table, other }) => {
    const errors = (/** @type {Table} */ run) => ["pitch", "roll"].map((name) => degrees(Math.abs(run.at(name, LATE) / DEGREE - value(`${name}_goal`))));
    if (!table || !other) {
      return "";
    }
    const [[pitch, roll], [openPitch, openRoll]] = [table, other].map(errors);
    return `At ${LATE}\u00a0s it misses its pitch by ${pitch} and its roll by ${roll}; without feedback (grey) by ${openPitch} and ${openRoll}.`;
  },
];
/** @type {Part[]} */
const WHY_LOOP = [
  "Because each motor acts on pitch and on roll, the controller first asks what pitch and roll need, and then adds and subtracts: the mean of the motors is the pitch, their difference makes the roll. Without measurements, it would never know of the slip. With them, it adds up what is missing until nothing is, and it moves the motors against the swing of the wrist.",
];

/** @type {Chapter[]} */
const GUIDE = [
  { title: "One motor", settings: { motion: "one" }, parts: WHAT_ONE, question: "How does one motor do both?", why: WHY_ONE },
  { title: "Both motors", settings: { motion: "tour" }, parts: WHAT_BOTH, question: "Why mean and difference?", why: WHY_BOTH },
  { title: "Resonance", settings: { motion: "shake" }, parts: WHAT_SHAKE, question: "Why farther than the motors?", why: WHY_SHAKE },
  { title: "Stop dead", settings: { motion: "stop" }, parts: WHAT_STOP, question: "What is that for?", why: WHY_STOP },
  { title: "Controller", settings: { motion: "closed-loop" }, parts: WHAT_LOOP, question: "How does the controller know?", why: WHY_LOOP },
];
