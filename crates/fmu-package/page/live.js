// The FMU of this page, to be tried: motions, inputs by hand, parameters, what comes of them.

/**
 * Inputs over time, by name; `table` has what was so far. With the next row, a motion may write into it what it knows besides.
 * The motion `before` is drawn in grey, for comparison. `frequency` (Hz) is for motions that shake.
 * @typedef {{id: string, title: string, length: number, before?: string, frequency?(time: number): number, begin?(): void, inputs(time: number, inputs: Record<string, number>, table: Table): void}} Motion
 */

/**
 * The view of a model besides sliders and plots. `word` is the label of its motions. Besides outputs, variables that are `recorded` are in the table, and columns
 * that are `written` by motions. `follow` leads inputs to the sliders; `move` of a view moves a slider. `numbers` are those that motions read and that paragraphs
 * of the guide change. The parameters that are `near`, each with a short description, are next to the sliders; `beside` is drawn above the plots.
 * @typedef {{
 *   word: string, start: Record<string, number>, sliders: {name: string, label: string, reach: number}[], recorded: string[], written: string[], motions: Motion[],
 *   lead: string, guide: Chapter[], numbers: Record<string, number>, near: Record<string, string>, panels: Panel[], isMinor(name: string): boolean,
 *   follow(inputs: Record<string, number>, targets: Map<string, number>, size: number): void,
 *   view(move: (name: string, by: number) => void): View & {controls?: HTMLElement[], settings?: Map<string, HTMLInputElement | HTMLSelectElement>},
 *   beside?(change: (name: string, value: number) => void): {element: HTMLElement, draw(motion: Motion | null, time: number, start: Map<Variable, number | string>): void},
 * }} AddOn
 */

/** By the model's identifier. @type {Record<string, (own: Package, others: Package[]) => AddOn>} */
const addOns = {};

/** Seconds by hand, and rows, that are kept at most. */
const [MOST_BY_HAND, MOST_ROWS] = [120, 300000];
/** What is seen of a motion by hand, s; and how long a frame may calculate, ms. */
const [WINDOW, BUDGET] = [8, 10];
const BY_HAND = "hand";

/** A run of the FMU, calculated as far as it is asked for, and anew when something changes. */
class Session {
  /** @param {Package} own @param {AddOn} addOn */
  constructor(own, { recorded, written }) {
    const { description } = own;
    this.own = own;
    this.description = description;
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
    const fmu = new Fmu(this.own);
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

  /** Calculates until a time, however long that takes. @param {number} time @param {(inputs: Record<string, number>) => void} follow */
  finish(time, follow) {
    while (this.advance(time, follow) < time - this.description.step) {}
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

/** For a model of which nothing more is known. @param {Package} own @returns {AddOn} */
function plain({ description }) {
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
  for (const [title, causality] of [["Outputs", "output"], ["Inputs", "input"]]) {
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
    guide: [],
    numbers: {},
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

/** The section *Try it*: a run of the FMU, and all that changes it. */
class Trial {
  /** @param {Package} own @param {Package[]} others FMUs that the add-on runs @param {string[]} missing resources that are not in the page */
  constructor(own, others, missing) {
    const { description } = own;
    this.description = description;
    this.missing = missing;
    this.addOn = (addOns[description.identifier] || plain)(own, others);
    this.session = new Session(own, this.addOn);
    this.motions = new Map(this.addOn.motions.map((motion) => [motion.id, motion]));
    /** The numbers that motions read, at first. */
    this.numbers = { ...this.addOn.numbers };
    this.settable = description.variables.filter((one) => one.causality === "parameter" && one.variability !== "constant" && one.start !== null);
    /** The last change, to be undone if the FMU rejects it: its fields, and by hand the rows and targets before it. @type {{fields: Fields, one: Variable, rows: number, targets: Map<string, number>} | null} */
    this.latest = null;
    /** The run before the last change, and when that was, ms. @type {Table | null} */
    this.earlier = null;
    this.changedAt = -Infinity;
    this.isTouched = false;
    this.said = "";
    this.status = element("p", { class: "live-status", role: "status" });
    this.choice = element("select", { id: "live-motion" }, ...this.addOn.motions.map(({ id, title }) => element("option", { value: id }, title)));
    if (this.addOn.sliders.length) {
      this.choice.append(element("option", { value: BY_HAND }, "By hand"));
    }
    this.choice.addEventListener("change", () => this.choose(this.choice.value));
    this.sliders = new Fields((one, value) => this.byHand(one.name, Number(value)));
    this.parameters = new Fields((one, value) => {
      this.latest = { fields: this.parameters, one, rows: 0, targets: this.session.targets };
      this.session.start.set(one, value);
      this.recalculate();
    });
    this.guide = new Guide(this.addOn.lead, this.addOn.guide, ({ settings }) => this.apply(new URLSearchParams(settings)), (name, value) => this.change(name, value));
    this.view = this.addOn.view((name, by) => this.drag(name, by));
    this.beside = this.addOn.beside?.((name, value) => this.change(name, value));
    this.player = this.played();
    this.follow = (/** @type {Record<string, number>} */ inputs) => this.addOn.follow(inputs, this.session.targets, description.step);
  }

  /** @param {string} name */
  find(name) {
    return /** @type {Variable} */ (this.description.byName.get(name));
  }

  /** When the run ends, s. */
  get end() {
    const { session, description } = this;
    return Math.min(session.ended, description.startTime + Math.min(session.motion ? session.motion.length : MOST_BY_HAND, MOST_ROWS * description.step));
  }

  /** Until when there are inputs, s. */
  get recorded() {
    return this.session.motion ? this.end : Math.max(this.session.table.end, this.session.timeOf(this.session.known - 1));
  }

  played() {
    const { session, addOn, description, view } = this;
    const begin = description.startTime;
    return new Player({
      plots: (seek) => new Plots(addOn.panels, seek),
      view: {
        element: view.element,
        draw: (table, time) => {
          view.draw(table, time);
          this.beside?.draw(session.motion, time - begin, session.start);
        },
      },
      begin,
      isLooping: () => !this.isTouched && session.motion === addOn.motions[0],
      earlier: () => this.earlier,
      table: session.table,
      span: (now) => (session.motion || !(description.step < 0.1) ? [begin, this.end] : [Math.max(begin, now - WINDOW), Math.max(begin + WINDOW, now)]),
      recorded: () => this.recorded,
      limit: () => this.end,
      advance: (now) => {
        const reached = session.advance(session.motion ? this.end : Math.max(now, session.timeOf(session.known - 1)), this.follow);
        this.say(session.error);
        if (session.motion) {
          addOn.sliders.forEach(({ name }) => session.table.count && this.sliders.show.get(name)?.(session.table.at(name, now)));
        }
        if (session.motion && reached < this.end - description.step) {
          // The part that is still to come is drawn, too.
          this.player.ask();
        }
        return session.error ? now : reached;
      },
    });
  }

  /** Shows why a run has ended. One that the FMU has rejected stands still and is grey until something else is tried. @param {string} error */
  say(error) {
    const { isRejected } = this.session;
    if (isRejected) {
      this.player.setPlaying(false);
    }
    if (error === this.said) {
      return;
    }
    this.said = this.status.textContent = error;
    this.status.classList.toggle("live-error", isRejected);
    this.player.element.classList.toggle("live-rejected", isRejected);
    if (isRejected) {
      this.latest?.fields.mark.get(this.latest.one.name)?.(`The FMU rejects this value of ${this.latest.one.name}.`);
    } else {
      [this.sliders, this.parameters].forEach((fields) => fields.mark.forEach((mark) => mark("")));
    }
  }

  /** From here on by hand. @param {string} name @param {number} value */
  byHand(name, value) {
    const { session, latest, player } = this;
    const { isRejected } = session;
    if (isRejected && latest && !session.motion) {
      session.targets = latest.targets;
      session.restart(latest.rows);
      player.now = Math.min(player.now, session.timeOf(latest.rows - 1));
    }
    const row = isRejected && session.table.count === 0 ? session.known - 1 : session.table.row(player.now);
    if (session.motion) {
      session.targets = new Map(this.addOn.sliders.map((slider) => [slider.name, session.table.at(slider.name, player.now)]));
    }
    if (session.motion || row < session.table.count - 1) {
      session.restart(row + 1);
    }
    session.motion = null;
    this.choice.value = BY_HAND;
    this.guide.read(BY_HAND);
    this.earlier = null;
    this.latest = { fields: this.sliders, one: this.find(name), rows: row + 1, targets: new Map(session.targets) };
    session.targets.set(name, value);
    player.setPlaying(true);
  }

  /** Moves a slider from the view. @param {string} name @param {number} by */
  drag(name, by) {
    const { session } = this;
    this.isTouched = true;
    const from = session.motion ? session.table.at(name, this.player.now) : (session.targets.get(name) ?? 0);
    const reach = this.addOn.sliders.find((one) => one.name === name)?.reach ?? 1;
    const value = Math.max(-reach, Math.min(reach, from + by));
    this.sliders.show.get(name)?.(value);
    this.byHand(name, value);
  }

  /** @param {Motion | null} motion */
  begin(motion) {
    this.session.motion = motion;
    this.session.known = 0;
    this.session.restart(0);
  }

  /** Plays a motion, or begins a run by hand. @param {string} id */
  choose(id) {
    const { session, player } = this;
    const motion = this.motions.get(id);
    if (!motion) {
      const starts = this.addOn.sliders.map(({ name }) => /** @type {[string, number]} */ ([name, startOf(this.find(name))]));
      session.targets = new Map(starts);
      starts.forEach(([name, value]) => this.sliders.show.get(name)?.(value));
    }
    this.choice.value = motion ? id : BY_HAND;
    this.guide.read(this.choice.value);
    this.earlier = null;
    this.changedAt = -Infinity;
    const before = motion?.before && this.motions.get(motion.before);
    if (before) {
      this.begin(before);
      session.finish(this.end, this.follow);
      this.earlier = session.error ? null : session.table.copy();
    }
    this.begin(motion || null);
    player.setPlaying(false);
    player.now = this.description.startTime;
    player.setPlaying(motion !== undefined && allowsMotion());
  }

  /** Calculates the run again after a change, and keeps the one before for comparison. */
  recalculate() {
    const { session } = this;
    const now = performance.now();
    if (now - this.changedAt > 1000 && session.motion && !session.error && session.table.end >= this.end - 0.5 * this.description.step) {
      this.earlier = session.table.copy();
    }
    this.changedAt = now;
    const { isRejected } = session;
    session.restart(session.motion ? 0 : Infinity);
    this.view.set?.((name) => Number(session.parameter(this.find(name))));
    this.showNumbers();
    if (isRejected && session.motion) {
      this.player.setPlaying(allowsMotion());
    }
    this.player.ask();
  }

  /** Changes a number in a paragraph: one of the motions, or a parameter. @param {string} name @param {number} value as it is shown */
  change(name, value) {
    const one = this.description.byName.get(name);
    if (one) {
      this.parameters.show.get(name)?.((value - one.offset) / one.factor);
      this.parameters.change(one, (value - one.offset) / one.factor);
    } else {
      this.addOn.numbers[name] = value;
      this.recalculate();
    }
  }

  showNumbers() {
    for (const [name, shown] of this.guide.show) {
      const one = this.description.byName.get(name);
      shown.forEach((show) => show(one ? Number(this.session.parameter(one)) * one.factor + one.offset : this.addOn.numbers[name]));
    }
  }

  /** Sets all parameters. @param {Record<string, number>} start the start values that are not the FMU's */
  reset(start) {
    this.session.start = new Map(Object.entries(start).map(([name, value]) => [this.find(name), value]));
    this.settable.forEach((one) => this.parameters.show.get(one.name)?.(this.session.parameter(one)));
    this.parameters.mark.forEach((mark) => mark(""));
    this.recalculate();
  }

  save() {
    this.session.finish(this.recorded, this.follow);
    const link = element("a", { href: URL.createObjectURL(new Blob([this.session.csv()], { type: "text/csv" })), download: `${this.description.identifier}.csv` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  /** What differs from the page as it opens, for a link. */
  settings() {
    const { session, addOn, player } = this;
    const settings = new URLSearchParams({ motion: this.choice.value });
    if (player.speed !== 1) {
      settings.set("speed", String(player.speed));
    }
    for (const [one, value] of session.start) {
      if (value !== (addOn.start[one.name] ?? (one.type === "String" ? one.start : startOf(one)))) {
        settings.set(one.name, String(value));
      }
    }
    for (const name of Object.keys(addOn.start)) {
      if (!session.start.has(this.find(name))) {
        settings.set(name, String(startOf(this.find(name))));
      }
    }
    for (const [name, value] of Object.entries(addOn.numbers)) {
      if (value !== this.numbers[name]) {
        settings.set(name, String(value));
      }
    }
    if (!session.motion) {
      session.targets.forEach((value, name) => settings.set(name, String(value)));
    }
    this.view.settings?.forEach(({ value }, name) => value !== "0" && settings.set(name, value));
    return settings;
  }

  share() {
    location.hash = `try&${this.settings()}`;
    this.status.classList.remove("live-error");
    this.status.textContent = "The address of this page now carries these settings.";
    if (location.protocol === "file:") {
      this.status.textContent += " It leads here on this computer only: to share it, put this file on a web server.";
    }
    navigator.clipboard?.writeText(location.href).then(() => (this.status.textContent += " It is copied."), () => {});
  }

  /** Sets what a link or a paragraph asks for, and all else as the page opens. @param {URLSearchParams} settings */
  apply(settings) {
    const { session, addOn, parameters } = this;
    Object.assign(addOn.numbers, this.numbers);
    this.reset(addOn.start);
    const wanted = settings.get("motion") || this.choice.value;
    for (const [name, value] of settings) {
      const one = this.description.byName.get(name);
      if (one?.causality === "parameter") {
        const given = one.type === "String" ? value : Number(value);
        const why = complaint(one, given);
        parameters.mark.get(name)?.(why && `The link asks for ${name} = ${value}; it ${why}`);
        if (!why) {
          this.latest = { fields: parameters, one, rows: 0, targets: session.targets };
          session.start.set(one, given);
          parameters.show.get(name)?.(given);
        }
      } else if (name in addOn.numbers && Number.isFinite(Number(value))) {
        addOn.numbers[name] = Number(value);
      }
      const control = this.view.settings?.get(name);
      if (control) {
        control.value = value;
        control.dispatchEvent(new Event("change"));
      }
    }
    this.choose(this.motions.has(wanted) || wanted === BY_HAND ? wanted : addOn.motions[0].id);
    for (const { name } of wanted === BY_HAND ? addOn.sliders.filter((slider) => settings.has(slider.name)) : []) {
      session.targets.set(name, Number(settings.get(name)));
      this.sliders.show.get(name)?.(Number(settings.get(name)));
    }
    this.view.set?.((name) => Number(session.parameter(this.find(name))));
    this.showNumbers();
    this.isTouched ||= settings.size > 0;
    const speed = Number(settings.get("speed"));
    if (speed > 0) {
      this.player.setSpeed(speed);
    } else if (wanted === BY_HAND && settings.size > 1) {
      this.player.setPlaying(true);
    }
  }

  /** @param {string} text @param {() => void} action */
  button(text, action) {
    const made = element("button", { type: "button" }, text);
    made.addEventListener("click", action);
    return made;
  }

  /** Motions, sliders, parameters near them, and buttons. */
  controls() {
    const { addOn } = this;
    const motion = element("div", { class: "live-row" }, element("label", { for: "live-motion" }, element("b", {}, addOn.word)), this.choice);
    const sliders = addOn.sliders.map(({ name, label, reach }) => {
      const one = this.find(name);
      const [low, high] = [Math.max(one.min, startOf(one) - reach), Math.min(one.max, startOf(one) + reach)];
      return this.sliders.row(one, label, one.type === "Real" ? [low * one.factor + one.offset, high * one.factor + one.offset] : null, "");
    });
    const near = Object.entries(addOn.near).map(([name, about]) => this.parameters.row(this.find(name), name, null, about));
    const again = this.button("Start again", () => this.choose(this.choice.value));
    const buttons = [again, this.button("Save as CSV", () => this.save()), this.button("Link to this", () => this.share())];
    return element(
      "div",
      { class: "live-controls" },
      ...(this.choice.length > 1 ? [motion] : []),
      ...sliders,
      ...near,
      element("div", { class: "live-buttons" }, ...(this.view.controls || []), ...buttons),
      this.status,
    );
  }

  /** All other parameters. */
  fields() {
    const rows = (/** @type {boolean} */ isMinor) =>
      this.settable.filter(({ name }) => this.addOn.isMinor(name) === isMinor && !(name in this.addOn.near)).map((one) => this.parameters.row(one, one.name, null));
    const [major, minor] = [rows(false), rows(true)];
    const fields = element(
      "details",
      { class: "live-parameters" },
      element("summary", {}, "Parameters"),
      element("div", { class: "live-rows" }, ...major),
      ...(minor.length ? [element("details", {}, element("summary", {}, "Start values"), element("div", { class: "live-rows" }, ...minor))] : []),
      this.button("Parameters as built in", () => this.reset({})),
    );
    fields.open = matchMedia("(min-width: 60rem)").matches;
    return fields;
  }

  /** The section, for the top of the page. */
  section() {
    const { description, player, missing } = this;
    player.side.append(this.controls());
    player.plots.element.prepend(...(this.beside ? [this.beside.element] : []));
    player.plots.element.append(element("p", { class: "live-legend" }, "Pale: the part of the run that is still to come. Grey: the run before the last change."));
    const about = element(
      "p",
      {},
      `This is the FMU itself: every number above is what ${description.identifier} ${description.version} calculates, here, in your browser. Nothing is loaded and nothing leaves this page. The FMU\u2019s guid is `,
      element("code", {}, description.guid),
      `.${missing.length ? ` Too large for this page are ${missing.join(", ")}: what depends on them differs from what other tools show.` : ""}`,
    );
    const section = element("section", { class: "live", "aria-labelledby": "try" }, element("h2", { id: "try" }, "Try it"), this.guide.element, player.element, ...(this.settable.length ? [this.fields()] : []), about);
    for (const kind of ["pointerdown", "keydown"]) {
      section.addEventListener(kind, () => (this.isTouched = true), { capture: true });
    }
    return section;
  }
}

/** An FMU from the page. @param {{description: string, module: string}} packed @param {Record<string, string>} resources @returns {Promise<Package>} */
async function opened(packed, resources) {
  const [description, module, ...contents] = await Promise.all([packed.description, packed.module, ...Object.values(resources)].map(unpacked));
  return {
    description: new Description(new TextDecoder().decode(description)),
    module: await WebAssembly.compile(module),
    files: new Map(Object.keys(resources).map((name, place) => [name, contents[place]])),
  };
}

/**
 * Puts the section at the top of the page.
 * @param {{description: string, module: string}[]} packed the FMU of this page, and those that its add-on runs
 * @param {Record<string, string>} resources of the FMU of this page @param {string[]} missing resources that are not in the page
 */
async function live(packed, resources, missing) {
  const [own, ...others] = await Promise.all(packed.map((one, place) => opened(one, place ? {} : resources)));
  const trial = new Trial(own, others, missing);
  const section = trial.section();
  (document.querySelector("main") || document.body).prepend(section);
  const contents = document.querySelector("header nav");
  if (contents) {
    section.append(contents);
  }
  document.querySelector("nav ul")?.prepend(element("li", {}, element("a", { href: "#try" }, "Try it")));
  const { stopTime, startTime, identifier } = own.description;
  if (addOns[identifier] === undefined && !(stopTime - startTime < 60 && stopTime - startTime > 1)) {
    trial.player.setSpeed((stopTime - startTime) / 10);
  }
  const settle = () => trial.apply(new URLSearchParams(location.hash.replace(/^#try&?/, "")));
  settle();
  addEventListener("hashchange", () => location.hash.startsWith("#try&") && settle());
  if (location.hash.startsWith("#try")) {
    section.scrollIntoView();
  }
}
