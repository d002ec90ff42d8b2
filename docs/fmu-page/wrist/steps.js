// The steps of the guide. Each sentence is true at every value that a reader can set, or depends on the values.

/** Numbers in the paragraphs. */
const [CAM, ALONE, ANGLE, SPRING, FREQUENCY, SOFTNESS, GIVE, PITCH_GOAL, ROLL_GOAL, SLIP] = [
  { name: "cam", label: "Angle of the discs", low: 5, high: 60, step: 1, unit: "\u00b0" },
  { name: "alone", label: "Angle of motor 1", low: 5, high: 60, step: 1, unit: "\u00b0" },
  { name: "angle", label: "Angle of the motors", low: 5, high: 60, step: 1, unit: "\u00b0" },
  { name: "k2", label: "Stiffness k2", low: 0.1, high: 2, step: 0.02, unit: "N\u00b7m/\u00b0" },
  { name: "frequency", label: "Frequency", low: 0.5, high: 15, step: 0.05, unit: "Hz" },
  { name: "k2", label: "Stiffness k2", low: 0.1, high: 2, step: 0.02, unit: "N\u00b7m/\u00b0" },
  { name: "k2", label: "Stiffness k2", low: 0.1, high: 2, step: 0.02, unit: "N\u00b7m/\u00b0" },
  { name: "pitch_goal", label: "Pitch wanted", low: -30, high: 30, step: 1, unit: "\u00b0" },
  { name: "roll_goal", label: "Roll wanted", low: -60, high: 60, step: 1, unit: "\u00b0" },
  { name: "slip", label: "Slip of motor 2", low: -10, high: 10, step: 1, unit: "\u00b0" },
];
const DIALS = [CAM, ALONE, ANGLE, FREQUENCY, SOFTNESS, PITCH_GOAL, ROLL_GOAL, SLIP];

/** An angle in degrees with at most one decimal. @param {number} value */
function degrees(value) {
  return quantity(Math.round(10 * value) / 10 || 0, "deg");
}

/** An angle in degrees with exactly one decimal, so that it keeps its width while it moves. @param {number} value */
function tenths(value) {
  return `${format(value, 10)}\u00b0`;
}

/** An angle as a term of a sum or a difference: a negative one is in parentheses. @param {number} value */
function term(value) {
  const text = tenths(value);
  return text.startsWith("\u2212") ? `(${text})` : text;
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
  "Drag the gripper or a motor, choose a motion, or change a parameter. ",
  (facts) => {
    if (facts.motion) {
      return `${facts.motion.title}.`;
    }
    const [theta1, theta2] = [facts.value("theta1"), facts.value("theta2")];
    const [pitch, roll] = [(theta1 + theta2) / 2, (facts.value("N") / facts.value("M")) * ((theta1 - theta2) / 2)];
    const [isFirst, isSecond] = [theta1, theta2].map((angle) => Math.abs(angle) > REACH / DEGREE - 1e-6);
    const end = isFirst && isSecond ? " Both motors are at their ends." : isFirst || isSecond ? ` Motor ${isFirst ? 1 : 2} is at its end, so the wrist stops where it would have to go on.` : "";
    return `Up and down pitch the gripper, left and right roll it, and the motors follow. For a pitch of ${degrees(pitch)} and a roll of ${degrees(roll)}, motor 1 must turn to ${degrees(theta1)} and motor 2 to ${degrees(theta2)}.${end}`;
  },
];

/** @type {Part[]} */
const WHAT_CAM = [
  ({ value }) => `This is the whole trick: a cam with ${value("M")} ${value("M") === 1 ? "lobe" : "lobes"} between two discs with ${value("N")} ${value("N") === 1 ? "roller" : "rollers"} each, which push the lobes as the teeth of gears do. One motor turns each disc. Here both discs turn by `, CAM, " the same way, and then against each other.",
];
/** @type {Part[]} */
const WHY_CAM = [
  "Hold a pencil upright between your palms. Palms that move together carry it along: the axis of the cam tilts, and the wrist pitches. Palms that move against each other roll it: the cam turns about its own axis, and the wrist rolls. ",
  ({ value }) => `Because ${value("N") === 1 ? "1 roller meets" : `${value("N")} rollers meet`} ${value("M") === 1 ? "1 lobe" : `${value("M")} lobes`}, it rolls ${fraction(value("N"), value("M"))} times as far as the discs turn: by ${degrees((value("N") / value("M")) * value("cam"))}.`,
];
/** @type {Part[]} */
const WHAT_ONE = [
  "This is the machine around the cam. The axis of the cam is held by the green ring, and carries the purple gripper; two motors turn the discs. Now motor 1 turns by ", ALONE, ", and motor 2 stands still.",
];
/** @type {Part[]} */
const WHY_ONE = [
  ({ value }) => `Both ways at once: the green ring tilts by ${degrees(value("alone") / 2)} (pitch), and the purple gripper spins about its own axis by ${degrees((value("N") / value("M") / 2) * value("alone"))} (roll). `,
  "If only one side moves, the cam rolls along the other one, and its axis moves half as far as the moving side. ",
  (facts) => {
    const found = resistance(facts);
    if (!found) {
      return "";
    }
    const { time, tau1, tau2, share, until } = found;
    const last = until < ALONE_MOVES[1] ? `until ${until.toFixed(2)}\u00a0s, shortly before the motor stops` : "until the motor stops";
    const cause = share > 0 && share < 1 ? `, ${Math.round(100 * share)}\u00a0% of it by damping and the rest by inertia` : "";
    const held = Math.abs(tau2) > 0.01 * Math.abs(tau1) ? ` Then \u03c4\u2082 is ${newtonMetres(tau2)} although motor 2 stands still, because the cam pushes its side ${tau2 > 0 ? "forward" : "back"} and the motor holds it.` : "";
    return `A torque is what the wrist does to its motor. While motor 1 turns, \u03c4\u2081 is negative ${last}, because the wrist resists. At ${time.toFixed(2)}\u00a0s it is largest, ${newtonMetres(tau1)}${cause}.${held}`;
  },
];

/** A torque in a sentence. @param {number} value N.m */
function newtonMetres(value) {
  return `${format(value, 1)}\u00a0N\u00b7m`;
}

/**
 * The largest torque with which the wrist resists motor 1: its time, the torque of motor 2 at that time, the share of the load's damping in it,
 * by eq. (7), and the time at which the torque changes its sign. `null` if the torque changes its sign before, as with light loads on soft springs.
 * @param {Facts} facts
 */
function resistance({ table, value }) {
  const [from, to] = ALONE_MOVES;
  if (!table) {
    return null;
  }
  const tau1 = table.column("tau1");
  const [first, last] = [table.row(from) + 1, table.row(to)];
  let [most, end] = [first, first];
  for (let row = first; row <= last; row++) {
    most = tau1[row] < tau1[most] ? row : most;
  }
  while (end <= last && tau1[end] < 0) {
    end++;
  }
  if (end < most) {
    return null;
  }
  const rates = table.column("pitch_rate")[most] + (value("N") / value("M")) * table.column("roll_rate")[most];
  const time = table.column("time");
  return { time: time[most], tau1: tau1[most], tau2: table.column("tau2")[most], share: (-value("c3") / 2 / DEGREE) * rates / tau1[most], until: end > last ? to : time[end] };
}
/** @type {Part[]} */
const WHAT_BOTH = [
  "Now both motors turn by ", ANGLE, " together, and then against each other. The angles of the two discs at this moment make",
  { line: ({ value }) => `pitch = (${tenths(value("theta5"))} + ${term(value("theta6"))}) / 2 = ${tenths((value("theta5") + value("theta6")) / 2)}` },
  { line: ({ value }) => `roll = ${fraction(value("N"), 2 * value("M"))} (${tenths(value("theta5"))} \u2212 ${term(value("theta6"))}) = ${tenths((value("N") / 2 / value("M")) * (value("theta5") - value("theta6")))}` },
];
/** @type {Part[]} */
const WHY_BOTH = [
  ({ value }) => `Pitch is the mean of the two angles, and roll is ${fraction(value("N"), 2 * value("M"))} times their difference, eq. (1). Together, the difference is zero, and the wrist only pitches. Against each other, the mean is zero, and it only rolls, by ${degrees((value("N") / value("M")) * value("angle"))}. Any other motion is a mixture of these two.`,
];

/** @type {Part[]} */
const WHAT_COUPLING = [
  "Between a motor and its disc are two couplings: springs, each with a damper next to it. Both motors make a fast move of 20\u00b0, and the coupling next to the wrist twists. It pushes with two torques: the spring\u2019s is its stiffness times the twist, the damper\u2019s follows the rate of the twist. k\u2082\u00a0=\u00a0", SPRING, ".",
];
/** @type {Part[]} */
const WHY_COUPLING = [
  (facts) => {
    const peaks = forcePeaks(facts);
    if (!peaks) {
      return "";
    }
    const [spring, damper] = peaks;
    const first = damper.time < spring.time - 5e-4 ? `The damper: its torque is largest at ${damper.time.toFixed(3)}\u00a0s, ${newtonMetres(damper.torque)}, because then the twist grows fastest. The spring follows: ${newtonMetres(spring.torque)} at ${spring.time.toFixed(3)}\u00a0s, when the twist is largest.` : `The spring\u2019s torque is largest at ${spring.time.toFixed(3)}\u00a0s, ${newtonMetres(spring.torque)}, and the damper\u2019s at ${damper.time.toFixed(3)}\u00a0s, ${newtonMetres(damper.torque)}.`;
    return `${first} A spring gives back what it takes; a damper only takes. The next steps show what follows from that.`;
  },
];

/** The largest torques of spring and damper of the coupling next to the wrist, with their times. @param {Facts} facts */
function forcePeaks({ table, value }) {
  if (!table) {
    return null;
  }
  const [theta3, theta5, tau1, time] = ["theta3", "theta5", "tau1", "time"].map((name) => table.column(name));
  const peaks = [0, 1].map(() => ({ time: 0, torque: 0 }));
  for (let row = 0; row < table.count; row++) {
    const spring = (value("k2") / DEGREE) * (theta3[row] - theta5[row]);
    [spring, -tau1[row] - spring].forEach((torque, index) => {
      if (torque > peaks[index].torque) {
        peaks[index] = { time: time[row], torque };
      }
    });
  }
  return peaks;
}

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
    return peaks.now[1] >= 1.02 && Math.abs(value("frequency") - peaks.now[0]) < BAND[2] / 2 ? `${far}This is the peak: the resonance. ` : far;
  },
  "Search the frequency at which it swings farthest, here or by clicks in the plot. Then change the stiffness of the couplings next to the wrist: k\u2082\u00a0=\u00a0", SOFTNESS, ".",
];
/** @type {Part[]} */
const WHY_SHAKE = [
  ({ response }) => {
    const peaks = response?.peaks();
    if (!peaks) {
      return "";
    }
    if (peaks.now[1] < 1.02) {
      return "No frequency makes it swing noticeably farther than the motors. ";
    }
    const isOther = Math.abs(peaks.now[1] - peaks.preset[1]) > 0.005 || Math.abs(peaks.now[0] - peaks.preset[0]) > 0.01;
    return `At the peak the wrist swings ${peakAt(peaks.now)}${isOther ? `; with the FMU\u2019s own values ${peakAt(peaks.preset)}` : ""}. `;
  },
  "A wrist on springs has a rhythm of its own, like a child on a swing: pushes in that rhythm add up, so a machine should not be moved in it, or only with the trick of the next step. ",
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
    const move = `Both motors turn by ${degrees(FAST.angle)} in ${FAST.duration}\u00a0s and stop dead.`;
    const parts = `Then they make the same move in two parts, ${first} and, half a swing later, ${second}`;
    return `${move} ${parts}. `;
  },
  "Change the stiffness: k\u2082\u00a0=\u00a0", GIVE, ". ",
  (facts) => (["J2", "H3", "k1", "k2", "c1", "c2", "c3"].every((name) => isPreset(facts, name)) ? "The parts fit this stiffness." : "The parts stay those for the FMU\u2019s own values."),
];
/** @type {Part[]} */
const WHY_STOP = [
  ({ table }) => {
    if (!table) {
      return "";
    }
    const [[plain, under], [shaped]] = overshoots(table);
    const isSwinging = plain > 0.05 && under > 0.05;
    const runsOn = plain > 0.05 ? `In one go, the wrist runs on to ${degrees(FAST.angle + plain)}${isSwinging ? " and swings" : ""}.` : "In one go, the wrist does not run on.";
    const rest = shaped > 0.05 ? `the wrist runs on by ${degrees(shaped)} only` : "the wrist does not run on";
    const ends = shaped < 0.2 * plain ? `: ${rest}${isSwinging ? ", because the second part stops the swing that the first one began" : ""}. ` : shaped > 0.05 ? `: the wrist runs on to ${degrees(FAST.angle + shaped)}. ` : ": it does not run on. ";
    return `${runsOn} In two parts${ends}`;
  },
  `A robot must wait until its load has stopped swinging. With the FMU\u2019s own values a swing takes ${(2 * HALF_SWING).toFixed(2)}\u00a0s, so a second push after ${HALF_SWING.toFixed(2)}\u00a0s meets the swing on its way back and cancels it. The second push is smaller because the swing has become smaller meanwhile. Engineers call this input shaping; cranes stop their loads with it.`,
];
/** @type {Part[]} */
const WHAT_LOOP = [
  "A second FMU, a controller, measures the wrist and turns both motors to a pitch of ", PITCH_GOAL, " and, from 0.9\u00a0s on, a roll of ", ROLL_GOAL, ": ",
  (facts) => {
    const [theta1, theta2] = motorsFor(facts, facts.value("pitch_goal"), facts.value("roll_goal"));
    return `motor 1 to ${degrees(theta1)}, motor 2 to ${degrees(theta2)}. `;
  },
  "At 1.5\u00a0s motor 2 slips on its shaft by ", SLIP, ".",
];
/** @type {Part[]} */
const WHY_LOOP = [
  ({ value, table, other }) => {
    const errors = (/** @type {Table} */ run) => ["pitch", "roll"].map((name) => degrees(Math.abs(run.at(name, LATE) / DEGREE - value(`${name}_goal`))));
    if (!table || !other) {
      return "";
    }
    const [[pitch, roll], [openPitch, openRoll]] = [table, other].map(errors);
    return `At ${LATE}\u00a0s it misses its pitch by ${pitch} and its roll by ${roll}; without feedback (grey) by ${openPitch} and ${openRoll}. `;
  },
  "Because each motor acts on pitch and on roll, the controller first asks what pitch and roll need, and then adds and subtracts: the mean of the motors is the pitch, their difference makes the roll. Without measurements, it would never know of the slip. With them, it adds up what is missing until nothing is, and it moves the motors against the swing of the wrist.",
];

/** @type {Chapter[]} */
const GUIDE = [
  { title: "The cam", settings: { motion: "cam", look: "cam", speed: "0.5" }, parts: WHAT_CAM, question: "What becomes of the cam?", why: WHY_CAM },
  { title: "One motor", settings: { motion: "one" }, parts: WHAT_ONE, question: "Which way does the gripper turn?", why: WHY_ONE },
  { title: "Both motors", settings: { motion: "tour" }, parts: WHAT_BOTH, question: "What is the rule?", why: WHY_BOTH },
  { title: "A coupling", settings: { motion: "move", look: "coupling", speed: "0.2" }, parts: WHAT_COUPLING, question: "Which torque comes first?", why: WHY_COUPLING },
  { title: "Resonance", settings: { motion: "shake" }, parts: WHAT_SHAKE, question: "Why farther than the motors?", why: WHY_SHAKE },
  { title: "Stop dead", settings: { motion: "stop" }, parts: WHAT_STOP, question: "Does the wrist stop, too?", why: WHY_STOP },
  { title: "Controller", settings: { motion: "closed-loop" }, parts: WHAT_LOOP, question: "Does the wrist come back?", why: WHY_LOOP },
];
