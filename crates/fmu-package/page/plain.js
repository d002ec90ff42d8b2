// The add-on of models without their own, and the table of their variables.

/** The add-on of a model without its own: a step and a sine of at most six Real inputs, and plots of the outputs and inputs. @param {Package} own @returns {AddOn} */
function plain({ description }) {
  const real = description.numbers("input");
  const length = description.stopTime - description.startTime;
  /** @param {Variable} one */
  const reach = (one) => {
    const [below, above] = [startOf(one) - one.min, one.max - startOf(one)];
    return Number.isFinite(below + above) ? Math.max(below, above) : roundAbove(Math.max(3 * Math.abs(startOf(one)), 3 * one.nominal) * one.factor) / one.factor;
  };
  const motions = real.filter((one) => one.type === "Real").slice(0, 6).flatMap((one) => {
    // About a fifth of the largest change that the slider allows, as a round number.
    const [start, size] = [startOf(one), roundAbove((reach(one) * one.factor) / 5) / one.factor];
    const end = start + size > one.max ? start - size : start + size;
    return [
      { id: `step-${one.name}`, title: `Step of ${one.name}`, length, inputs: (/** @type {number} */ time, /** @type {Record<string, number>} */ inputs) => void (inputs[one.name] = time < 0.1 * length ? start : end) },
      { id: `sine-${one.name}`, title: `Sine of ${one.name}`, length, inputs: (/** @type {number} */ time, /** @type {Record<string, number>} */ inputs) => void (inputs[one.name] = start + 0.5 * (end - start) * (1 - Math.cos((8 * Math.PI * time) / length))) },
    ];
  });
  const free = { id: "run", title: "At their start values", length, inputs: () => {} };
  return {
    lead: ["This page runs the FMU (a simulation model in a zip file): move its inputs, or change its parameters."],
    guide: [],
    numbers: {},
    near: {},
    label: "Inputs",
    start: {},
    sliders: real.map((one) => ({ name: one.name, label: one.name, reach: reach(one) })),
    recorded: [],
    written: [],
    motions: [...motions, free],
    panels: plainPanels(description),
    isMinor: () => false,
    follow: (inputs, targets) => targets.forEach((value, name) => void (inputs[name] = value)),
    view: () => ({ element: element("div"), draw: () => {} }),
  };
}

/** Plots of outputs and inputs: at most six curves of one unit each. @param {Description} description */
function plainPanels(description) {
  /** @type {Panel[]} */
  const panels = [];
  for (const [title, causality] of [["Outputs", "output"], ["Inputs", "input"]]) {
    const numbers = description.numbers(causality);
    for (const unit of new Set(numbers.map((one) => one.unit))) {
      const curves = numbers.filter((one) => one.unit === unit).map(({ name, factor, offset, type, variability }, index) => ({
        // A variable that changes only at events is constant in between.
        name, label: name, colour: `curve-${(index % 6) + 1}`, factor, offset, isInteger: type !== "Real", isStepwise: type !== "Real" || variability === "discrete",
      }));
      for (let first = 0; first < curves.length; first += 6) {
        panels.push({ title, unit: printed(unit), curves: curves.slice(first, first + 6) });
      }
    }
  }
  return panels;
}

/** Returns the table of variables, for a model whose page does not describe them. @param {Description} description */
function tableOfVariables({ variables }) {
  const cells = (/** @type {"th" | "td"} */ tag, /** @type {string[]} */ texts) => element("tr", {}, ...texts.map((text) => element(tag, {}, text)));
  const start = (/** @type {Variable} */ one) =>
    one.start === null ? "" : one.type === "String" ? one.start : one.type === "Boolean" ? String(startOf(one) === 1) : quantity(startOf(one) * one.factor + one.offset, "");
  const rows = variables.map((one) => cells("td", [one.name, one.causality, start(one), printed(one.unit), one.description]));
  const table = element("table", {}, element("thead", {}, cells("th", ["name", "kind", "start", "unit", "meaning"])), element("tbody", {}, ...rows));
  return element("details", { class: "live-variables", open: "" }, element("summary", {}, "Variables"), element("div", { class: "live-scroll", tabindex: "0", role: "region", "aria-label": "Variables" }, table));
}
