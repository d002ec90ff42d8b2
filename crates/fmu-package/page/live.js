// The section *Try it*: motions, inputs by hand, parameters and results of the FMU.

/**
 * What a model adds to the page. `label` is the label of the list of motions. The table contains the outputs, the variables `recorded` and the columns `written`
 * by motions. `follow` moves inputs towards the sliders; `move` of a view moves a slider. Motions read `numbers`, and paragraphs of the guide change them.
 * The parameters `near`, each with a short description, are next to the sliders. `response` is drawn above the plots.
 * @typedef {{
 *   label: string, start: Record<string, number>, sliders: {name: string, label: string, reach: number}[], recorded: string[], written: string[], motions: Motion[],
 *   lead: string, guide: Chapter[], numbers: Record<string, number>, near: Record<string, string>, panels: Panel[], isMinor(name: string): boolean,
 *   follow(inputs: Record<string, number>, targets: Map<string, number>, size: number): void,
 *   view(move: (name: string, by: number) => void): View & {controls?: HTMLElement[], settings?: Map<string, HTMLInputElement | HTMLSelectElement>},
 *   response?(change: (name: string, value: number) => void): {element: HTMLElement, draw(motion: Motion | null, time: number, start: Map<Variable, number | string>): void},
 * }} AddOn
 */

/** Add-ons by model identifier. @type {Record<string, (own: Package, others: Package[]) => AddOn>} */
const addOns = {};

/** Time span of the plots of a run by hand, s. */
const WINDOW = 8;
const BY_HAND = "hand";

/** The add-on of a model without its own: a step and a sine of each input, and plots of all outputs. @param {Package} own @returns {AddOn} */
function plain({ description }) {
  const real = description.numbers("input");
  const length = description.stopTime - description.startTime;
  /** @param {Variable} one */
  const reach = (one) => (Number.isFinite(one.max - one.min) ? (one.max - one.min) / 2 : Math.max(3 * Math.abs(startOf(one)), 3 * one.nominal));
  const motions = real.filter((one) => one.type === "Real").slice(0, 6).flatMap((one) => {
    const [start, size] = [startOf(one), reach(one) / 3];
    const end = start + size > one.max ? start - size : start + size;
    return [
      { id: `step-${one.name}`, title: `Step of ${one.name}`, length, inputs: (/** @type {number} */ time, /** @type {Record<string, number>} */ inputs) => void (inputs[one.name] = time < 0.1 * length ? start : end) },
      { id: `sine-${one.name}`, title: `Sine of ${one.name}`, length, inputs: (/** @type {number} */ time, /** @type {Record<string, number>} */ inputs) => void (inputs[one.name] = start + 0.5 * (end - start) * (1 - Math.cos((8 * Math.PI * time) / length))) },
    ];
  });
  /** @type {Panel[]} */
  const panels = [];
  for (const [title, causality] of [["Outputs", "output"], ["Inputs", "input"]]) {
    const numbers = description.numbers(causality);
    for (const unit of new Set(numbers.map((one) => one.unit))) {
      const curves = numbers.filter((one) => one.unit === unit).map(({ name, factor, offset, type }, index) => ({ name, label: name, colour: `curve-${(index % 6) + 1}`, factor, offset, isInteger: type !== "Real" }));
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
    label: "Inputs",
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

/** The section *Try it*: a run of the FMU and its controls. */
class Trial {
  /** @param {Package} own @param {Package[]} others FMUs that the add-on runs @param {string[]} missing resources that are not in the page */
  constructor(own, others, missing) {
    const { description } = own;
    this.description = description;
    this.missing = missing;
    this.addOn = (addOns[description.identifier] || plain)(own, others);
    this.session = new Session(own, this.addOn);
    this.motions = new Map(this.addOn.motions.map((motion) => [motion.id, motion]));
    /** The numbers that motions read, as the page opens. */
    this.numbers = { ...this.addOn.numbers };
    this.settable = description.variables.filter((one) => one.causality === "parameter" && one.variability !== "constant" && one.start !== null);
    /** The last change, which is undone if the FMU rejects it; `rows` and `targets` are those before a change by hand. @type {{fields: Fields, one: Variable, rows: number, targets: Map<string, number>} | null} */
    this.latest = null;
    /** The run before the last change, and the time of that change, ms. @type {Table | null} */
    this.earlier = null;
    this.changedAt = -Infinity;
    this.isTouched = false;
    this.shownError = "";
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
    this.response = this.addOn.response?.((name, value) => this.change(name, value));
    this.player = this.createPlayer();
    this.follow = (/** @type {Record<string, number>} */ inputs) => this.addOn.follow(inputs, this.session.targets, description.step);
  }

  /** @param {string} name */
  find(name) {
    return /** @type {Variable} */ (this.description.byName.get(name));
  }

  /** End of the run, s. */
  get end() {
    const { session, description } = this;
    return Math.min(session.ended, description.startTime + Math.min(session.motion ? session.motion.length : MAX_BY_HAND, MAX_ROWS * description.step));
  }

  /** Time up to which inputs are known, s. */
  get recorded() {
    return this.session.motion ? this.end : Math.max(this.session.table.end, this.session.timeOf(this.session.known - 1));
  }

  createPlayer() {
    const { session, addOn, description, view } = this;
    const begin = description.startTime;
    return new Player({
      plots: (seek) => new Plots(addOn.panels, seek),
      view: {
        element: view.element,
        draw: (table, time) => {
          view.draw(table, time);
          this.response?.draw(session.motion, time - begin, session.start);
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
        this.showError(session.error);
        if (session.motion) {
          addOn.sliders.forEach(({ name }) => session.table.count && this.sliders.show.get(name)?.(session.table.at(name, now)));
        }
        if (session.motion && reached < this.end - description.step) {
          // The rest of the run is calculated in the next frames and drawn pale.
          this.player.requestFrame();
        }
        return session.error ? now : reached;
      },
    });
  }

  /** Shows why a run has ended. A rejected run is grey and does not play until the user changes something. @param {string} error */
  showError(error) {
    const { isRejected } = this.session;
    if (isRejected) {
      this.player.setPlaying(false);
    }
    if (error === this.shownError) {
      return;
    }
    this.shownError = this.status.textContent = error;
    this.status.classList.toggle("live-error", isRejected);
    this.player.element.classList.toggle("live-rejected", isRejected);
    if (isRejected) {
      this.latest?.fields.mark.get(this.latest.one.name)?.(`The FMU rejects this value of ${this.latest.one.name}.`);
    } else {
      [this.sliders, this.parameters].forEach((fields) => fields.mark.forEach((mark) => mark("")));
    }
  }

  /** Continues the run by hand from the current time. @param {string} name @param {number} value */
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
    const current = session.motion ? session.table.at(name, this.player.now) : (session.targets.get(name) ?? 0);
    const reach = this.addOn.sliders.find((one) => one.name === name)?.reach ?? 1;
    const value = Math.max(-reach, Math.min(reach, current + by));
    this.sliders.show.get(name)?.(value);
    this.byHand(name, value);
  }

  /** Starts a run from the beginning. @param {Motion | null} motion */
  begin(motion) {
    this.session.motion = motion;
    this.session.known = 0;
    this.session.restart(0);
  }

  /** Plays a motion, or starts a run by hand. @param {string} id */
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

  /** Calculates the run again after a change. The run before the change stays in grey. */
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
    this.player.requestFrame();
  }

  /** Changes a parameter, or a number that motions read. @param {string} name @param {number} value in the unit of the page */
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

  /** Shows the values of the numbers in the guide. */
  showNumbers() {
    for (const [name, shown] of this.guide.show) {
      const one = this.description.byName.get(name);
      shown.forEach((show) => show(one ? Number(this.session.parameter(one)) * one.factor + one.offset : this.addOn.numbers[name]));
    }
  }

  /** Sets all parameters. @param {Record<string, number>} start values that differ from those of the FMU */
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

  /** The settings for a link: everything that differs from the page as it opens. */
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
    this.status.textContent = "The address of this page now contains these settings.";
    if (location.protocol === "file:") {
      this.status.textContent += " The link works only on this computer. To share it, put this file on a web server.";
    }
    navigator.clipboard?.writeText(location.href).then(() => (this.status.textContent += " The address is copied."), () => {});
  }

  /** Applies the settings of a link or a paragraph. All other settings are those of the page as it opens. @param {URLSearchParams} settings */
  apply(settings) {
    const { session, addOn, parameters } = this;
    Object.assign(addOn.numbers, this.numbers);
    this.reset(addOn.start);
    const wanted = settings.get("motion") || this.choice.value;
    for (const [name, value] of settings) {
      const one = this.description.byName.get(name);
      if (one?.causality === "parameter") {
        const given = one.type === "String" ? value : Number(value);
        const reason = problem(one, given);
        parameters.mark.get(name)?.(reason && `The link sets ${name} = ${value}; it ${reason}`);
        if (!reason) {
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
    const motion = element("div", { class: "live-row" }, element("label", { for: "live-motion" }, element("b", {}, addOn.label)), this.choice);
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

  /** The parameters that are not near the sliders. */
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
      this.button("Default parameters", () => this.reset({})),
    );
    fields.open = matchMedia("(min-width: 60rem)").matches;
    return fields;
  }

  /** The section at the top of the page. */
  section() {
    const { description, player, missing } = this;
    player.side.append(this.controls());
    player.plots.element.prepend(...(this.response ? [this.response.element] : []));
    player.plots.element.append(element("p", { class: "live-legend" }, "Pale: the rest of the run. Grey: the run before the last change."));
    const about = element(
      "p",
      {},
      `This is the FMU itself: ${description.identifier} ${description.version} calculates every number above in your browser. The page loads nothing and sends nothing. The FMU\u2019s guid is `,
      element("code", {}, description.guid),
      `.${missing.length ? ` This page does not contain ${missing.join(", ")} (too large). Results that depend on them differ from those of other tools.` : ""}`,
    );
    const section = element("section", { class: "live", "aria-labelledby": "try" }, element("h2", { id: "try" }, "Try it"), this.guide.element, player.element, ...(this.settable.length ? [this.fields()] : []), about);
    for (const kind of ["pointerdown", "keydown"]) {
      section.addEventListener(kind, () => (this.isTouched = true), { capture: true });
    }
    return section;
  }
}

/** Decompresses an FMU of the page. @param {{description: string, module: string}} packed @param {Record<string, string>} resources @returns {Promise<Package>} */
async function decompressPackage(packed, resources) {
  const [description, module, ...contents] = await Promise.all([packed.description, packed.module, ...Object.values(resources)].map(decompress));
  return {
    description: new Description(new TextDecoder().decode(description)),
    module: await WebAssembly.compile(module),
    files: new Map(Object.keys(resources).map((name, index) => [name, contents[index]])),
  };
}

/**
 * Adds the section at the top of the page.
 * @param {{description: string, module: string}[]} packed the FMU of this page, and those that its add-on runs
 * @param {Record<string, string>} resources of the FMU of this page @param {string[]} missing resources that are not in the page
 */
async function live(packed, resources, missing) {
  const [own, ...others] = await Promise.all(packed.map((one, index) => decompressPackage(one, index ? {} : resources)));
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
