// The FMU of this page, to be tried: motions, inputs by hand, parameters, what comes of them.

/**
 * Inputs over time, by name; `table` has what was so far. With the next row, a motion may write into it what it knows besides.
 * @typedef {{id: string, title: string, length: number, begin?(): void, inputs(time: number, inputs: Record<string, number>, table: Table): void}} Motion
 */

/**
 * What a model has beside sliders and courses. `word` is for its motions. Besides outputs, variables that are `recorded` are in the table, and columns that are
 * `written` by motions. `follow` leads inputs to where the sliders are; `move` of a view moves a slider.
 * `buttons` start motions; the parameters that are `near`, each with a short description, stand with the sliders.
 * @typedef {{
 *   word: string, start: Record<string, number>, sliders: {name: string, label: string, reach: number}[], recorded: string[], written: string[], motions: Motion[],
 *   lead: string, buttons: {label: string, motion: string}[], near: Record<string, string>, panels: Panel[], isMinor(name: string): boolean,
 *   follow(inputs: Record<string, number>, targets: Map<string, number>, size: number): void,
 *   view(move: (name: string, by: number) => void): View & {controls?: HTMLElement[], settings?: Map<string, HTMLInputElement | HTMLSelectElement>},
 * }} AddOn
 */

/** By the model's identifier. @type {Record<string, (description: Description, others: {description: Description, module: WebAssembly.Module}[]) => AddOn>} */
const addOns = {};

/** Seconds by hand, and rows, that are kept at most. */
const [MOST_BY_HAND, MOST_ROWS] = [120, 300000];
/** What is seen of a motion by hand, s; and how long a frame may calculate, ms. */
const [WINDOW, BUDGET] = [8, 10];
const BY_HAND = "hand";

/** A run of the FMU, calculated as far as it is asked for, and anew when something changes. */
class Session {
  /** @param {Description} description @param {WebAssembly.Module} module @param {AddOn} addOn */
  constructor(description, module, { recorded, written }) {
    this.description = description;
    this.module = module;
    this.inputs = description.numbers("input");
    const outputs = description.variables.filter((one) => (one.causality === "output" || recorded.includes(one.name)) && one.type !== "String");
    this.outputs = outputs.filter((one) => !this.inputs.includes(one));
    this.written = written;
    this.table = new Table([...[...this.inputs, ...this.outputs].map((one) => one.name), ...written]);
    /** The start values that are not the FMU's. @type {Map<Variable, number | string>} */
    this.start = new Map();
    /** @type {Motion | null} */
    this.motion = null;
    /** Where sliders are, by hand. @type {Map<string, number>} */
    this.targets = new Map();
    /** How many rows have their inputs already. */
    this.known = 0;
    this.error = "";
    /** Where the FMU has ended the run, s. */
    this.ended = Infinity;
    this.isBegun = false;
    /** The inputs at the last row. @type {Record<string, number>} */
    this.now = {};
    this.values = { inputs: new Float64Array(this.inputs.length), outputs: new Float64Array(this.outputs.length) };
    this.instance = this.connected();
  }

  /** An instance, and where its inputs and outputs are. */
  connected() {
    const fmu = new Fmu(this.description, this.module);
    return { fmu, inputs: fmu.group(this.inputs), outputs: fmu.group(this.outputs) };
  }

  /** Whether the FMU has rejected a value, unlike a run that the FMU has ended. */
  get isRejected() {
    return this.error !== "" && this.ended === Infinity;
  }

  /** From the start again; the first `known` rows have the inputs that they had. @param {number} known */
  restart(known) {
    this.known = Math.min(known, Math.max(this.table.count, this.known));
    this.table.count = 0;
    this.isBegun = false;
    this.error = "";
    this.ended = Infinity;
  }

  /** @param {number} row */
  timeOf(row) {
    return this.description.startTime + row * this.description.step;
  }

  /** Calculates until a time, or until the budget (ms) is used up; how far that went. @param {number} time @param {(inputs: Record<string, number>) => void} follow */
  advance(time, follow) {
    const stop = performance.now() + BUDGET;
    try {
      while (!this.error && this.timeOf(this.table.count) <= time + 0.5 * this.description.step && this.table.count < MOST_ROWS) {
        if (this.table.count % 64 === 0 && performance.now() > stop) {
          break;
        }
        this.row(follow);
      }
    } catch (refusal) {
      if (refusal instanceof Ended) {
        [this.error, this.ended] = [refusal.message, this.table.end];
      } else {
        this.error = `The FMU rejects this: ${refusal instanceof Error ? refusal.message : refusal}`;
      }
      this.instance = this.connected();
      this.isBegun = false;
    }
    return this.error ? time : this.table.end;
  }

  /** One more row: inputs, what the FMU answers, and before it the step there. @param {(inputs: Record<string, number>) => void} follow */
  row(follow) {
    const { table, values, now } = this;
    const { fmu, inputs, outputs } = this.instance;
    const row = table.count;
    const time = this.timeOf(row);
    if (!this.isBegun) {
      fmu.begin(this.start);
      this.isBegun = true;
      this.motion?.begin?.();
      this.inputs.forEach((one) => (now[one.name] = startOf(one)));
    } else {
      fmu.stepTo(time);
    }
    table.grow();
    if (row < this.known) {
      for (const { name } of this.inputs) {
        now[name] = table.column(name)[row];
      }
    } else {
      this.written.forEach((name) => (table.column(name)[row] = NaN));
      if (this.motion) {
        this.motion.inputs(time - this.description.startTime, now, table);
      } else if (row > 0) {
        follow(now);
      }
    }
    this.inputs.forEach(({ name }, place) => (table.column(name)[row] = values.inputs[place] = now[name]));
    fmu.set(inputs, values.inputs);
    fmu.get(outputs, values.outputs);
    this.outputs.forEach(({ name }, place) => (table.column(name)[row] = values.outputs[place]));
    table.column("time")[row] = time;
    table.count = row + 1;
  }

  /** The value that a parameter has in this run. @param {Variable} one */
  parameter(one) {
    return this.start.get(one) ?? (one.type === "String" ? one.start || "" : startOf(one));
  }

  /** All rows, in the units of the FMU, every digit; above them the FMU and its parameters, as comments. */
  csv() {
    const { identifier, version, guid, variables } = this.description;
    const parameters = variables.filter((one) => one.causality === "parameter").map((one) => `${one.name} = ${JSON.stringify(this.parameter(one))}`);
    const about = [`# ${identifier} ${version}, guid ${guid}`, `# ${parameters.join(", ")}`];
    const names = ["time", ...this.inputs.map((one) => one.name), ...this.outputs.map((one) => one.name), ...this.written.filter((name) => !Number.isNaN(this.table.column(name)[0]))];
    const columns = names.map((name) => this.table.column(name));
    const lines = [...about, names.map((name) => (/[",\s]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name)).join(",")];
    for (let row = 0; row < this.table.count; row++) {
      lines.push(columns.map((column) => String(column[row])).join(","));
    }
    return `${lines.join("\n")}\n`;
  }
}

/** For a model of which nothing more is known. @param {Description} description @returns {AddOn} */
function plain(description) {
  const real = description.numbers("input");
  const length = description.stopTime - description.startTime;
  /** @param {Variable} one */
  const reach = (one) => (Number.isFinite(one.max - one.min) ? (one.max - one.min) / 2 : Math.max(3 * Math.abs(startOf(one)), 3 * one.nominal));
  const motions = real.filter((one) => one.type === "Real").slice(0, 6).flatMap((one) => {
    const [from, size] = [startOf(one), reach(one) / 3];
    const to = from + size > one.max ? from - size : from + size;
    return [
      { id: `step-${one.name}`, title: `Step of ${one.name}`, length, inputs: (/** @type {number} */ time, /** @type {Record<string, number>} */ inputs) => void (inputs[one.name] = time < 0.1 * length ? from : to) },
      { id: `sine-${one.name}`, title: `Sine of ${one.name}`, length, inputs: (/** @type {number} */ time, /** @type {Record<string, number>} */ inputs) => void (inputs[one.name] = from + 0.5 * (to - from) * (1 - Math.cos((8 * Math.PI * time) / length))) },
    ];
  });
  /** @type {Panel[]} */
  const panels = [];
  for (const [title, causality] of [["Inputs", "input"], ["Outputs", "output"]]) {
    const numbers = description.numbers(causality);
    for (const unit of new Set(numbers.map((one) => one.unit))) {
      const curves = numbers.filter((one) => one.unit === unit).map(({ name, factor, offset, type }, place) => ({ name, label: name, colour: `curve-${(place % 6) + 1}`, factor, offset, isWhole: type !== "Real" }));
      for (let first = 0; first < curves.length; first += 6) {
        panels.push({ title, unit, curves: curves.slice(first, first + 6) });
      }
    }
  }
  const free = { id: "run", title: "At their start values", length, inputs: () => {} };
  return {
    lead: "This page runs the FMU: move its inputs, or change its parameters.",
    buttons: [],
    near: {},
    word: "Inputs",
    start: {},
    sliders: real.map((one) => ({ name: one.name, label: one.name, reach: reach(one) })),
    recorded: [],
    written: [],
    motions: [...motions, free],
    panels,
    isMinor: () => false,
    follow: (inputs, targets) => targets.forEach((value, name) => void (inputs[name] = value)),
    view: () => ({ element: element("div"), draw: () => {} }),
  };
}

/** Why a variable cannot have a value; "" if it can. @param {Variable} one @param {number | string} value */
function complaint(one, value) {
  if (one.type === "String") {
    return "";
  }
  if (value === "" || !Number.isFinite(Number(value))) {
    return "must be a number";
  }
  const isWhole = Number.isInteger(value) && Math.abs(Number(value)) < 2 ** 31;
  return one.type === "Real" || isWhole ? "" : "must be an integer below 2\u00b3\u00b9";
}

/** The rows of sliders and numbers for variables, in the units in which they are shown. */
class Fields {
  /** @param {(one: Variable, value: number | string) => void} changed called with values that are possible for the type */
  constructor(changed) {
    this.changed = changed;
    /** @type {Map<string, (value: number | string) => void>} */
    this.show = new Map();
    /** Marks the fields of variables as invalid, or as valid with "". @type {Map<string, (message: string) => void>} */
    this.mark = new Map();
  }

  /** Passes a value on, or marks its field. @param {Variable} one @param {number | string} value */
  change(one, value) {
    const why = complaint(one, value);
    this.mark.get(one.name)?.(why && `${one.name} ${why}`);
    if (!why) {
      this.changed(one, value);
    }
  }

  /** The place of a message below a field. @param {Variable} one @param {HTMLElement} field @returns {HTMLElement} */
  message(one, field) {
    const id = `${field.id}-message`;
    const message = element("span", { id, class: "live-message", role: "alert" });
    this.mark.set(one.name, (text) => {
      message.textContent = text;
      field.toggleAttribute("aria-invalid", text !== "");
      field.toggleAttribute("aria-describedby", text !== "");
      if (text) {
        field.setAttribute("aria-invalid", "true");
        field.setAttribute("aria-describedby", id);
      }
    });
    return message;
  }

  /** A row. @param {Variable} one @param {string} label @param {[number, number] | null} ends of the slider, if not by what the variable says @param {string} [about] */
  row(one, label, ends, about = one.description) {
    const id = `live-${one.name.replace(/\W/g, "-")}`;
    const name = element("label", { for: id }, element("b", {}, label), about ? ` ${about}` : "");
    if (one.type === "Real" || (one.type === "Integer" && !ends)) {
      return this.number(one, id, name, ends);
    }
    if (one.type === "Enumeration") {
      const list = element("select", { id }, ...one.items.map((item) => element("option", { value: String(item.value) }, item.name)));
      list.addEventListener("change", () => this.change(one, Number(list.value)));
      this.show.set(one.name, (value) => (list.value = String(value)));
      return element("div", { class: "live-row" }, name, list, this.message(one, list));
    }
    const kind = one.type === "Boolean" ? "checkbox" : one.type === "String" ? "text" : "number";
    const field = element("input", { id, type: kind });
    field.addEventListener("change", () => this.change(one, kind === "checkbox" ? Number(field.checked) : kind === "text" ? field.value : Number(field.value)));
    this.show.set(one.name, (value) => {
      field.checked = Number(value) !== 0;
      field.value = String(value);
    });
    return element("div", { class: "live-row" }, name, field, this.message(one, field));
  }

  /** @param {Variable} one @param {string} id @param {HTMLElement} name @param {[number, number] | null} ends */
  number(one, id, name, ends) {
    const { factor, offset, type } = one;
    const start = startOf(one) * factor + offset;
    const isWhole = type !== "Real";
    const [least, most] = [one.min * factor + offset, one.max * factor + offset];
    // What is positive has another magnitude, not another value, at the ends.
    const isLog = !ends && !isWhole && least >= 0 && start > 0;
    const size = Math.max(Math.abs(start), Math.abs(one.nominal * factor));
    const [low, high] = ends || (isLog ? [start / 10, start * 10] : [start - size, start + (isWhole ? 2 : 1) * size]);
    const [begin, end] = [Math.max(low, least), Math.min(high, most)];
    const digits = Math.max(0, 4 - Math.floor(Math.log10(end - begin)));
    const forth = (/** @type {number} */ value) => (isLog ? Math.log(Math.max(value, 1e-300) / begin) / Math.log(end / begin) : (value - begin) / (end - begin));
    const back = (/** @type {number} */ share) => (isLog ? begin * (end / begin) ** share : begin + share * (end - begin));
    const slider = element("input", { type: "range", min: "0", max: "1", step: isWhole ? String(1 / (end - begin)) : "0.001", "aria-labelledby": `${id}-label` });
    name.firstElementChild?.setAttribute("id", `${id}-label`);
    const field = element("input", { id, type: "number", step: isWhole ? "1" : "any" });
    const show = (/** @type {number} */ value) => {
      const text = String(ends ? Number(value.toFixed(digits)) : Number(value.toPrecision(6)));
      slider.value = String(forth(value));
      slider.setAttribute("aria-valuetext", `${text} ${one.unit}`);
      // Someone may be typing there.
      if (document.activeElement !== field) {
        field.value = text;
      }
    };
    const change = (/** @type {number} */ value) => this.change(one, Math.abs(value - start) <= 1e-12 * Math.abs(start) ? startOf(one) : (value - offset) / factor);
    slider.addEventListener("input", () => {
      const value = Number(slider.value) === Number(forth(start).toFixed(3)) ? start : back(Number(slider.value));
      const round = isWhole ? Math.round(value) : Number(value.toPrecision(3));
      last = round;
      show(round);
      change(round);
    });
    let last = start;
    field.addEventListener("change", () => {
      last = field.value === "" ? last : Number(field.value);
      field.value = String(last);
      show(last);
      change(last);
    });
    field.addEventListener("focus", () => field.select());
    field.addEventListener("blur", () => show(last));
    this.show.set(one.name, (value) => show((last = Number(value) * factor + offset)));
    const hint = Number.isFinite(most) ? `${least} to ${most}` : least > 0 && least < 1e-200 ? "> 0" : Number.isFinite(least) ? `\u2265 ${least}` : "";
    const unit = element("span", { class: "live-unit" }, one.unit, hint ? element("small", {}, ` ${hint}`) : "");
    return element("div", { class: "live-row" }, name, slider, field, unit, this.message(one, field));
  }
}

/** Why there is no section, at its place. @param {Error} error */
function withoutIt(error) {
  const text = `Here this page would run the FMU for you to try, but that is not possible: ${error.message}. The rest of the page is complete.`;
  (document.querySelector("main") || document.body).prepend(element("p", { class: "note" }, text));
}

/**
 * The section, put at the top of the page.
 * @param {{description: string, module: string}[]} packed the FMU of this page, and those that are beside it
 * @param {string[]} resources files of the FMU that are not in the page
 */
async function live(packed, resources) {
  const lacking = ["WebAssembly", "DecompressionStream"].find((name) => !(name in window));
  if (lacking) {
    throw new Error(`this browser has no ${lacking}`);
  }
  const [own, ...others] = await Promise.all(
    packed.map(async (one) => {
      const [description, module] = await Promise.all([unpacked(one.description), unpacked(one.module).then((bytes) => WebAssembly.compile(bytes))]);
      return { description: new Description(new TextDecoder().decode(description)), module };
    }),
  );
  const { description } = own;
  const addOn = (addOns[description.identifier] || plain)(description, others);
  const session = new Session(description, own.module, addOn);
  const find = (/** @type {string} */ name) => /** @type {Variable} */ (description.byName.get(name));
  const settable = description.variables.filter((one) => one.causality === "parameter" && one.variability !== "constant" && one.start !== null);
  const status = element("p", { class: "live-status", role: "status" });

  const motions = new Map(addOn.motions.map((motion) => [motion.id, motion]));
  const choice = element("select", { id: "live-motion" }, ...addOn.motions.map(({ id, title }) => element("option", { value: id }, title)));
  if (addOn.sliders.length) {
    choice.append(element("option", { value: BY_HAND }, "By hand"));
  }
  const begin = description.startTime;
  const follow = (/** @type {Record<string, number>} */ inputs) => addOn.follow(inputs, session.targets, description.step);
  const end = () => Math.min(session.ended, begin + (session.motion ? Math.min(session.motion.length, MOST_ROWS * description.step) : Math.min(MOST_BY_HAND, MOST_ROWS * description.step)));
  const recorded = () => Math.max(session.table.end, session.timeOf(session.known - 1));
  const isWide = () => session.motion || !(description.step < 0.1);

  /** The last change, to be undone if the FMU rejects it: its fields, and by hand the rows and targets before it. @type {{fields: Fields, one: Variable, rows: number, targets: Map<string, number>} | null} */
  let latest = null;
  /** The run before the parameters changed, and when they did, ms. @type {Table | null} */
  let earlier = null;
  let changedAt = -Infinity;
  let isTouched = false;

  const sliders = new Fields((one, value) => byHand(one.name, Number(value)));
  /** From here on by hand. @param {string} name @param {number} value */
  const byHand = (name, value) => {
    const { isRejected } = session;
    if (isRejected && latest && !session.motion) {
      session.targets = latest.targets;
      session.restart(latest.rows);
      player.now = Math.min(player.now, session.timeOf(latest.rows - 1));
    }
    const row = isRejected && session.table.count === 0 ? session.known - 1 : session.table.row(player.now);
    if (session.motion) {
      session.targets = new Map(addOn.sliders.map((slider) => [slider.name, session.table.at(slider.name, player.now)]));
    }
    if (session.motion || row < session.table.count - 1) {
      session.restart(row + 1);
    }
    session.motion = null;
    choice.value = BY_HAND;
    earlier = null;
    latest = { fields: sliders, one: find(name), rows: row + 1, targets: new Map(session.targets) };
    session.targets.set(name, value);
    player.setPlaying(true);
  };
  const view = addOn.view((name, by) => {
    isTouched = true;
    const from = session.motion ? session.table.at(name, player.now) : (session.targets.get(name) ?? 0);
    const slider = addOn.sliders.find((one) => one.name === name);
    const value = Math.max(-(slider?.reach ?? 1), Math.min(slider?.reach ?? 1, from + by));
    sliders.show.get(name)?.(value);
    byHand(name, value);
  });

  const player = new Player({
    plots: (seek) => new Plots(addOn.panels, seek),
    view,
    begin,
    isLooping: () => !isTouched && session.motion === addOn.motions[0],
    earlier: () => earlier,
    table: session.table,
    span: (now) => (isWide() ? [begin, end()] : [Math.max(begin, now - WINDOW), Math.max(begin + WINDOW, now)]),
    recorded: () => (session.motion ? end() : recorded()),
    limit: end,
    advance: (now) => {
      const until = session.motion ? end() : Math.max(now, session.timeOf(session.known - 1));
      const reached = session.advance(until, follow);
      say(session.error);
      if (session.motion) {
        addOn.sliders.forEach(({ name }) => session.table.count && sliders.show.get(name)?.(session.table.at(name, now)));
      }
      return session.error ? now : reached;
    },
  });

  let said = "";
  /** Shows why a run has ended. One that the FMU has rejected stands still and is grey until something else is tried. @param {string} error */
  const say = (error) => {
    const { isRejected } = session;
    if (isRejected) {
      player.setPlaying(false);
    }
    if (error === said) {
      return;
    }
    said = status.textContent = error;
    status.classList.toggle("live-error", isRejected);
    player.element.classList.toggle("live-rejected", isRejected);
    if (isRejected) {
      latest?.fields.mark.get(latest.one.name)?.(`The FMU rejects this value of ${latest.one.name}.`);
    } else {
      [sliders, parameters].forEach((fields) => fields.mark.forEach((mark) => mark("")));
    }
  };

  /** @param {string} id */
  const choose = (id) => {
    const motion = motions.get(id);
    session.motion = motion || null;
    if (!motion) {
      session.targets = new Map(addOn.sliders.map((slider) => [slider.name, startOf(find(slider.name))]));
      addOn.sliders.forEach((slider) => sliders.show.get(slider.name)?.(startOf(find(slider.name))));
    }
    choice.value = motion ? id : BY_HAND;
    earlier = null;
    session.known = 0;
    session.restart(0);
    player.setPlaying(false);
    player.now = begin;
    player.setPlaying(motion !== undefined && allowsMotion());
  };
  choice.addEventListener("change", () => choose(choice.value));

  /** Calculates the run again with other parameters, and keeps the one before for comparison. */
  const recalculate = () => {
    const now = performance.now();
    if (now - changedAt > 1000 && session.motion && !session.error && session.table.end >= end() - 0.5 * description.step) {
      earlier = session.table.copy();
    }
    changedAt = now;
    const { isRejected } = session;
    session.restart(session.motion ? 0 : Infinity);
    view.set?.((name) => Number(session.parameter(find(name))));
    if (isRejected && session.motion) {
      player.setPlaying(allowsMotion());
    }
    player.ask();
  };
  const parameters = new Fields((one, value) => {
    latest = { fields: parameters, one, rows: 0, targets: session.targets };
    session.start.set(one, value);
    recalculate();
  });
  /** @param {Record<string, number>} start the start values that are not the FMU's */
  const reset = (start) => {
    session.start = new Map(Object.entries(start).map(([name, value]) => [find(name), value]));
    settable.forEach((one) => parameters.show.get(one.name)?.(session.parameter(one)));
    parameters.mark.forEach((mark) => mark(""));
    recalculate();
  };
  const near = Object.entries(addOn.near).map(([name, about]) => parameters.row(find(name), name, null, about));
  const rows = (/** @type {boolean} */ isMinor) =>
    settable.filter((one) => addOn.isMinor(one.name) === isMinor && !(one.name in addOn.near)).map((one) => parameters.row(one, one.name, null));
  const minor = rows(true);

  const button = (/** @type {string} */ text, /** @type {() => void} */ action) => {
    const made = element("button", { type: "button" }, text);
    made.addEventListener("click", action);
    return made;
  };
  const save = () => {
    const until = session.motion ? end() : recorded();
    while (session.advance(until, follow) < until - description.step) {}
    const link = element("a", { href: URL.createObjectURL(new Blob([session.csv()], { type: "text/csv" })), download: `${description.identifier}.csv` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };
  const share = () => {
    const settings = new URLSearchParams({ motion: choice.value });
    if (player.speed !== 1) {
      settings.set("speed", String(player.speed));
    }
    for (const [one, value] of session.start) {
      if (value !== (addOn.start[one.name] ?? (one.type === "String" ? one.start : startOf(one)))) {
        settings.set(one.name, String(value));
      }
    }
    for (const name of Object.keys(addOn.start)) {
      if (!session.start.has(find(name))) {
        settings.set(name, String(startOf(find(name))));
      }
    }
    if (!session.motion) {
      session.targets.forEach((value, name) => settings.set(name, String(value)));
    }
    view.settings?.forEach(({ value }, name) => value !== "0" && settings.set(name, value));
    location.hash = `try&${settings}`;
    status.classList.remove("live-error");
    status.textContent = "The address of this page now carries these settings.";
    if (location.protocol === "file:") {
      status.textContent += " It leads here on this computer only: to share it, put this file on a web server.";
    }
    navigator.clipboard?.writeText(location.href).then(() => (status.textContent += " It is copied."), () => {});
  };
  /** What a link has set. */
  const settle = () => {
    const settings = new URLSearchParams(location.hash.replace(/^#try&?/, ""));
    reset(addOn.start);
    const wanted = settings.get("motion") || choice.value;
    choose(motions.has(wanted) || wanted === BY_HAND ? wanted : addOn.motions[0].id);
    for (const [name, value] of settings) {
      const one = description.byName.get(name);
      if (one?.causality === "parameter") {
        const given = one.type === "String" ? value : Number(value);
        const why = complaint(one, given);
        parameters.mark.get(name)?.(why && `The link asks for ${name} = ${value}; it ${why}`);
        if (!why) {
          latest = { fields: parameters, one, rows: 0, targets: session.targets };
          session.start.set(one, given);
          parameters.show.get(name)?.(given);
        }
      } else if (one?.causality === "input" && wanted === BY_HAND) {
        session.targets.set(name, Number(value));
        sliders.show.get(name)?.(Number(value));
      }
      const control = view.settings?.get(name);
      if (control) {
        control.value = value;
        control.dispatchEvent(new Event("change"));
      }
    }
    view.set?.((name) => Number(session.parameter(find(name))));
    isTouched ||= settings.size > 0;
    const speed = Number(settings.get("speed"));
    if (speed > 0) {
      player.setSpeed(speed);
    } else if (wanted === BY_HAND && settings.size > 1) {
      player.setPlaying(true);
    }
  };

  const inputs = addOn.sliders.map(({ name, label, reach }) => {
    const one = find(name);
    const [low, high] = [Math.max(one.min, startOf(one) - reach), Math.min(one.max, startOf(one) + reach)];
    return sliders.row(one, label, one.type === "Real" ? [low * one.factor + one.offset, high * one.factor + one.offset] : null, "");
  });
  const controls = element(
    "div",
    { class: "live-controls" },
    ...(choice.length > 1 ? [element("div", { class: "live-row" }, element("label", { for: "live-motion" }, element("b", {}, addOn.word)), choice)] : []),
    ...inputs,
    ...near,
    element("div", { class: "live-buttons" }, ...(view.controls || []), button("Start again", () => choose(choice.value)), button("Save as CSV", save), button("Link to this", share)),
    status,
  );
  if (addOn.buttons.length) {
    player.bar.before(element("div", { class: "live-buttons" }, ...addOn.buttons.map(({ label, motion }) => button(label, () => choose(motion)))));
  }
  player.side.append(controls);
  player.plots.element.append(element("p", { class: "live-legend" }, "Pale: the part of the run that is still to come. Grey: the run before the parameters changed."));
  const about = element(
    "p",
    {},
    `This is the FMU itself: every number below is what ${description.identifier} ${description.version} calculates, here, in your browser. Nothing is loaded and nothing leaves this page. The FMU\u2019s guid is `,
    element("code", {}, description.guid),
    `.${resources.length ? ` A page has no files: whatever the FMU reads from ${resources.join(", ")} is missing here, and what depends on it differs from what other tools show.` : ""}`,
  );
  const fields = element(
    "details",
    { class: "live-parameters" },
    element("summary", {}, "Parameters"),
    element("div", { class: "live-rows" }, ...rows(false)),
    ...(minor.length ? [element("details", {}, element("summary", {}, "Start values"), element("div", { class: "live-rows" }, ...minor))] : []),
    button("Parameters as built in", () => reset({})),
  );
  fields.open = matchMedia("(min-width: 60rem)").matches;
  const section = element("section", { class: "live", "aria-labelledby": "try" }, element("h2", { id: "try" }, "Try it"), element("p", {}, addOn.lead), player.element, ...(settable.length ? [fields] : []), about);
  for (const kind of ["pointerdown", "keydown"]) {
    section.addEventListener(kind, () => (isTouched = true), { capture: true });
  }
  (document.querySelector("main") || document.body).prepend(section);
  const contents = document.querySelector("header nav");
  if (contents) {
    section.append(contents);
  }
  document.querySelector("nav ul")?.prepend(element("li", {}, element("a", { href: "#try" }, "Try it")));
  const long = description.stopTime - begin;
  if (addOns[description.identifier] === undefined && !(long < 60 && long > 1)) {
    player.setSpeed(long / 10);
  }
  settle();
  addEventListener("hashchange", () => location.hash.startsWith("#try&") && settle());
  if (location.hash.startsWith("#try")) {
    section.scrollIntoView();
  }
}
