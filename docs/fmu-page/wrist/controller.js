// The add-on of the controller: the loop with the testbed, which runs next to it.

/** Inputs of the controller that the testbed measures, motors that the controller turns, and angles that only the view shows. */
const [SENSED, TURNED, INNER] = [["pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2"], ["theta1", "theta2", "omega1", "omega2"], ["theta3", "theta4", "theta5", "theta6"]];
const WANTED = ["pitch_ref", "roll_ref"];

/** The testbed, connected to the controller: it moves with the motor angles of the last row, and the controller measures it. @param {Fmu} fmu @returns {Companion} */
function testbed(fmu) {
  const find = (/** @type {string} */ name) => /** @type {Variable} */ (fmu.description.byName.get(name));
  const [inputs, outputs] = [TURNED, [...SENSED, ...INNER]].map((names) => fmu.group(names.map(find)));
  const values = new Float64Array(SENSED.length + INNER.length);
  return {
    begin: (start) => {
      const shared = ["M", "N"].map((name) => /** @type {const} */ ([find(name), [...start].find(([one]) => one.name === name)?.[1]]));
      fmu.begin(new Map([[find("use_omega"), 1], ...shared.filter(([, value]) => value !== undefined).map(([one, value]) => /** @type {[Variable, number]} */ ([one, Number(value)]))]));
    },
    step: (time, now, table) => {
      const row = table.count;
      if (row > 0) {
        fmu.set(inputs, TURNED.map((name) => table.column(name)[row - 1]));
        fmu.stepTo(time);
      }
      fmu.get(outputs, values);
      SENSED.forEach((name, index) => (now[name] = values[index]));
      INNER.forEach((name, index) => (table.column(name)[row] = values[SENSED.length + index]));
    },
  };
}

/** A run in which the wrist is to go to a pitch and a roll angle, and back. @param {string} id @param {string} title @param {(time: number) => [number, number]} goals deg @returns {Motion} */
function goTo(id, title, goals) {
  return { id, title, length: 3, inputs: (time, inputs) => WANTED.forEach((name, axis) => (inputs[name] = DEGREE * goals(time)[axis])) };
}

addOns.prw_controller = (own, others) => {
  const wanted = WANTED.map((name, axis) => ({ name, label: `${["pitch", "roll"][axis]} wanted`, colour: `curve-${3 + axis}`, factor: 1 / DEGREE, isGoal: true, isStepwise: true }));
  return {
    lead: [
      (facts) => {
        const half = (facts.value("M") / facts.value("N")) * facts.value("roll_ref");
        const way = facts.motion ? "The controller measures the wrist, and turns the two motors until pitch and roll are as wanted (dotted). Drag the gripper to where the wrist is to go." : "The wrist goes where you drag the gripper or the sliders, as fast as the motors may turn.";
        return `${way} For a pitch of ${quantity(Math.round(10 * facts.value("pitch_ref")) / 10 || 0, "deg")} and a roll of ${quantity(Math.round(10 * facts.value("roll_ref")) / 10 || 0, "deg")}, motor 1 must be at ${quantity(Math.round(10 * (facts.value("pitch_ref") + half)) / 10 || 0, "deg")} and motor 2 at ${quantity(Math.round(10 * (facts.value("pitch_ref") - half)) / 10 || 0, "deg")}.`;
      },
    ],
    guide: [],
    numbers: {},
    near: { Kp: "proportional gain", Ki: "integral gain", Kd: "gain of the measured rates" },
    label: "Goals",
    start: {},
    sliders: [{ name: "pitch_ref", label: "Pitch wanted", reach: Math.PI / 4 }, { name: "roll_ref", label: "Roll wanted", reach: Math.PI / 2 }],
    recorded: [],
    written: INNER,
    isAtRest: false,
    companion: testbed(new Fmu(others[0])),
    motions: [
      goTo("both", "Pitch 25\u00b0, then roll 50\u00b0 as well, then back", (time) => (time < 1.9 ? [time < 0.1 ? 0 : 25, time < 0.9 ? 0 : 50] : [0, 0])),
      goTo("pitch", "Pitch 30\u00b0 and back", (time) => [time >= 0.1 && time < 1.5 ? 30 : 0, 0]),
      goTo("roll", "Roll 60\u00b0 and back", (time) => [0, time >= 0.1 && time < 1.5 ? 60 : 0]),
    ],
    panels: WRIST_PANELS.map((panel) => (panel.title === "Wrist" ? { ...panel, curves: [...panel.curves, ...wanted] } : panel)),
    isMinor: () => false,
    follow: (inputs, targets) => targets.forEach((value, name) => void (inputs[name] = value)),
    view: (turn, _, pace) => wristView(({ pitch = 0, roll = 0 }) => turn({ pitch_ref: pitch }, { roll_ref: roll }), ["gripper"], pace),
  };
};
