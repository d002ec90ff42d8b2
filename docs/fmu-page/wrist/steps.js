// The steps of the guide. Each sentence is true at every value that a reader can set, or depends on the values.

/** Numbers in the paragraphs. */
const [ALONE, ANGLE, FREQUENCY, SOFTNESS, PITCH_GOAL, ROLL_GOAL] = [
  { name: "alone", label: "Angle of motor 1", low: 5, high: 60, step: 1, unit: "\u00b0" },
  { name: "angle", label: "Angle of the motors", low: 5, high: 60, step: 1, unit: "\u00b0" },
  { name: "frequency", label: "Frequency", low: 0.5, high: 15, step: 0.05, unit: "Hz" },
  { name: "k2", label: "Stiffness k2", low: 0.1, high: 2, step: 0.02, unit: "N\u00b7m/\u00b0" },
  { name: "pitch_goal", label: "Pitch wanted", low: -30, high: 30, step: 1, unit: "\u00b0" },
  { name: "roll_goal", label: "Roll wanted", low: -60, high: 60, step: 1, unit: "\u00b0" },
];
const DIALS = [ALONE, ANGLE, FREQUENCY, SOFTNESS, PITCH_GOAL, ROLL_GOAL];

/** An angle in degrees with at most one decimal. @param {number} value */
function degrees(value) {
  return quantity(Math.round(10 * value) / 10 || 0, "deg");
}

/** A ratio of two integers: "7/4", or "2". @param {number} top @param {number} bottom */
function fraction(top, bottom) {
  let [divisor, rest] = [top, bottom];
  while (rest) {
    [divisor, rest] = [rest, divisor % rest];
  }
  return bottom === divisor ? String(top / divisor) : `${top / divisor}/${bottom / divisor}`;
}

/** Smallest and largest value of a column between two times, in degrees. @param {Table} table @param {string} name @param {number} from @param {number} to */
function extremes(table, name, from, to) {
  const column = table.column(name).subarray(table.row(from), table.row(to) + 1);
  return [column.reduce((one, other) => Math.min(one, other), Infinity) / DEGREE, column.reduce((one, other) => Math.max(one, other), -Infinity) / DEGREE];
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
    return `Drag the gripper: up and down pitch it, left and right roll it, and the motors follow. For a pitch of ${degrees(pitch)} and a roll of ${degrees(roll)}, motor 1 must turn to ${degrees(theta1)} and motor 2 to ${degrees(theta2)}.`;
  },
];

/** @type {Part[]} */
const WHAT_ONE = [
  "Motor 1 turns by ", ALONE, ", while motor 2 stands still. Yet the wrist does two things at once: ",
  ({ value }) => `the green ring tilts by ${degrees(value("alone") / 2)} (pitch), and the purple gripper spins about its own axis by ${degrees((value("N") / value("M") / 2) * value("alone"))} (roll). How does one motor do both?`,
];
/** @type {Part[]} */
const WHY_ONE = [
  "The cam in the middle is held between the two sides, like a pencil between two palms. When one side moves and the other rests, the cam rolls along the side that rests, and its axis moves half as far as the moving side. The axis carries the ring along: that is the pitch. The rolling turns the gripper, which is fixed to the cam: that is the roll.",
];
/** @type {Part[]} */
const WHAT_BOTH = [
  ({ value }) => `Pitch is the mean of the two motor angles, and roll is ${fraction(value("N"), 2 * value("M"))} times their difference. So if both turn by `, ANGLE,
  ({ value }) => ` together, the difference is zero and the wrist only pitches. Against each other, their mean is zero, and the wrist only rolls, by ${degrees((value("N") / value("M")) * value("angle"))}.`,
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
  "Both motors shake to and fro by 4\u00b0 at ", FREQUENCY, ". ",
  ({ value, response }) => {
    const [gain, peaks] = [response?.at(value("frequency")) ?? NaN, response?.peaks()];
    if (!peaks || !(gain > 0)) {
      return "";
    }
    const far = `The wrist swings ${gain.toFixed(2)} times as far as the motors. `;
    if (peaks.now[1] < 1.02) {
      return `${far}No frequency makes it swing noticeably farther than the motors. `;
    }
    return gain > 0.995 * peaks.now[1] ? `${far}This is the peak: the resonance. ` : `${far}Drag the number to the peak in the first plot, or click there. `;
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
/** How far the wrist swings beyond the fast move, in one go and in two parts, deg. @param {Table} table */
function overshoots(table) {
  return [[FAST.begin, 1.1], [FAST.again, 2.9]].map(([from, to]) => extremes(table, "pitch", from, to)[1] - FAST.angle);
}

/** @type {Part[]} */
const WHAT_STOP = [
  ({ table }) => {
    const [first, second] = [(1 - SECOND_SHARE) * FAST.angle, SECOND_SHARE * FAST.angle].map(degrees);
    const move = `Both motors turn by ${degrees(FAST.angle)} in ${FAST.duration}\u00a0s and stop dead.`;
    const parts = `Then they make the same move in two parts, ${first} and, half a swing later, ${second}`;
    if (!table) {
      return `${move} ${parts}. `;
    }
    const [plain, shaped] = overshoots(table);
    const runsOn = plain > 0.05 ? `In one go, the wrist runs on to ${degrees(FAST.angle + plain)} and swings.` : "In one go, the wrist does not run on.";
    const rest = shaped > 0.05 ? `the wrist runs on by ${degrees(shaped)} only` : "the wrist does not run on";
    const ends = shaped < 0.2 * plain ? `: ${rest}, because the second part stops the swing that the first one began. ` : shaped > 0.05 ? `: the wrist runs on to ${degrees(FAST.angle + shaped)}. ` : ". ";
    return `${move} ${runsOn} ${parts}${ends}`;
  },
  "Change the stiffness: k\u2082\u00a0= ", SOFTNESS, ". ",
  (facts) => (["J2", "H3", "k1", "k2", "c1", "c2", "c3"].every((name) => isPreset(facts, name)) ? "The parts fit this stiffness." : "The parts stay those for the FMU\u2019s own values."),
];
/** @type {Part[]} */
const WHY_STOP = [
  `What is it for? A robot must wait until its load has stopped swinging. With the FMU\u2019s own values a swing takes ${(2 * HALF_SWING).toFixed(2)}\u00a0s, so a second push after ${HALF_SWING.toFixed(2)}\u00a0s meets the swing on its way back and cancels it. The second push is smaller because the swing has become smaller meanwhile. Engineers call this input shaping; cranes stop their loads with it.`,
];
/** @type {Part[]} */
const WHAT_LOOP = [
  "A second FMU, a controller, measures the wrist and turns both motors towards a pitch of ", PITCH_GOAL, " and, from 0.9\u00a0s on, a roll of ", ROLL_GOAL, "; from 1.7\u00a0s on, it turns them back. ",
  (facts) => {
    const [theta1, theta2] = motorsFor(facts, facts.value("pitch_goal"), facts.value("roll_goal"));
    const there = facts.table ? ` At 1.65\u00a0s the wrist is at ${degrees(facts.table.at("pitch", 1.65) / DEGREE)} and ${degrees(facts.table.at("roll", 1.65) / DEGREE)}.` : "";
    return `To hold both, motor 1 must turn to ${degrees(theta1)} and motor 2 to ${degrees(theta2)}.${there}`;
  },
];
/** @type {Part[]} */
const WHY_LOOP = [
  "Because each motor acts on pitch and on roll, the controller first asks what pitch and roll need, and then adds and subtracts: the mean of the motors is the pitch, their difference makes the roll. It also measures how fast the wrist moves and moves the motors against the swing. The grey curves are the same run without measurements.",
];

/** @type {Chapter[]} */
const GUIDE = [
  { title: "One motor", settings: { motion: "one" }, parts: WHAT_ONE, why: WHY_ONE },
  { title: "Both motors", settings: { motion: "tour" }, parts: WHAT_BOTH, why: WHY_BOTH },
  { title: "Resonance", settings: { motion: "shake" }, parts: WHAT_SHAKE, why: WHY_SHAKE },
  { title: "Stop dead", settings: { motion: "stop" }, parts: WHAT_STOP, why: WHY_STOP },
  { title: "Controller", settings: { motion: "closed-loop" }, parts: WHAT_LOOP, why: WHY_LOOP },
];
