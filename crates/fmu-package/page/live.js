// The section *Try it*: motions, inputs by hand, parameters and results of the FMU.

/**
 * What a model adds to the page. `label` is the label of the list of motions. The table contains the outputs, the variables `recorded` and the columns `written`
 * by motions. `follow` moves inputs towards the sliders; `move` of a view moves sliders by increments, those of one argument together. Motions read `numbers`, and paragraphs of the guide change
 * them within `limits`. The parameters `near`, each with a short description, are next to the sliders. `response` is drawn above the plots. If `isAtRest`, a run by
 * hand starts at rest with any inputs, so a new run can continue after its last row.
 * @typedef {{
 *   label: string, start: Record<string, number>, sliders: {name: string, label: string, reach: number}[], recorded: string[], written: string[], motions: Motion[],
 *   lead: Part[], guide: Chapter[], numbers: Record<string, number>, limits?: Dial[], near: Record<string, string>, panels: Panel[], isMinor(name: string): boolean,
 *   isAtRest?: boolean, companion?: Companion,
 *   follow(inputs: Record<string, number>, targets: Map<string, number>, size: number): void,
 *   view(move: (...increments: Record<string, number>[]) => void, value: (name: string) => number, pace: (speed: number) => void): View & {controls?: HTMLElement[], settings?: Map<string, Setting>},
 *   response?(change: (name: string, value: number) => void): ResponsePlot,
 * }} AddOn
 * A setting of the view in a link: its value, its value when the page opens, and a function that sets it and returns whether the value is possible.
 * @typedef {{value(): string, preset: string, set(value: string): boolean}} Setting
 * A plot above the others. `at` returns the value of its curve at a frequency, `peaks` the highest points of its curve with the current values and
 * with the values when the page opens.
 * @typedef {{element: HTMLElement, draw(motion: Motion | null, time: number, start: Map<Variable, number | string>): void,
 *   update(start: Map<Variable, number | string>): void, at(frequency: number): number, peaks(): {now: number[], preset: number[]} | null}} ResponsePlot
 */

/** Add-ons by model identifier. @type {Record<string, (own: Package, others: Package[]) => AddOn>} */
const addOns = {};

/** Time span of the plots of a run by hand, s. */
const WINDOW = 8;
const BY_HAND = "hand";
/** Largest value in the number field of a slider, as a multiple of the slider's reach. */
const FARTHEST = 400;

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
    /** The numbers that motions read, with their values when the page opens. */
    this.numbers = { ...this.addOn.numbers };
    this.settable = description.variables.filter((one) => one.causality === "parameter" && one.variability !== "constant" && one.start !== null);
    /** The last change, which is undone if the FMU rejects it. For a change by hand, `rows` and `targets` are the run's before the change. @type {{fields: Fields, one: Variable, rows: number, targets: Map<string, number>} | null} */
    this.latest = null;
    /** A run for comparison, and the time of the last change, ms. @type {Comparison | null} */
    this.other = null;
    this.changedAt = -Infinity;
    this.isTouched = false;
    this.shownError = "";
    /** The settings in the address of the page that were applied last. @type {string | null} */
    this.applied = null;
    /** The speed when the page opens. */
    this.pace = 1;
    this.status = element("p", { class: "live-status", role: "status" });
    this.choice = element("select", { id: "live-motion" }, ...this.addOn.motions.map(({ id, title }) => element("option", { value: id }, title)));
    if (this.addOn.sliders.length) {
      this.choice.append(element("option", { value: BY_HAND }, "By hand"));
    }
    this.choice.addEventListener("change", () => this.visit(this.choice.value));
    this.sliders = new Fields((one, value) => this.byHand({ [one.name]: Number(value) }));
    this.parameters = new Fields((one, value) => {
      this.guide.warn("");
      this.guide.answer(this.guide.chosen);
      this.latest = { fields: this.parameters, one, rows: 0, targets: this.session.targets };
      this.session.start.set(one, value);
      this.recalculate();
    }, (reason) => this.guide.warn(reason));
    this.guide = new Guide(this.addOn.lead, this.addOn.guide, (chapter) => this.turnTo(chapter), (name, value) => this.change(name, value));
    /** The step to which the reader has scrolled; after the last step, its number is the number of steps. */
    this.reached = 0;
    /** The image and its plots, which stay in the window while the reader scrolls through the steps, and the part below the steps. */
    this.pane = element("div", { class: "live-pane" });
    this.own = element("article", { class: "live-step live-own" });
    this.view = this.addOn.view((...increments) => this.drag(...increments), (name) => this.value(name), (speed) => this.player.setSpeed(speed));
    this.response = this.addOn.response?.((name, value) => this.change(name, value));
    this.player = this.createPlayer();
  }

  /** @param {string} name */
  find(name) {
    return /** @type {Variable} */ (this.description.byName.get(name));
  }

  /** Returns a parameter, the position of a slider, or a number that motions read, in the unit of the page. @param {string} name */
  value(name) {
    const one = this.description.byName.get(name);
    if (!one) {
      return this.addOn.numbers[name];
    }
    const { session } = this;
    const own = one.causality === "parameter" ? Number(session.parameter(one)) : session.motion ? session.table.at(name, this.player.now) : (session.targets.get(name) ?? startOf(one));
    return own * one.factor + one.offset;
  }

  /** End of the run, s. */
  get end() {
    const { session, description } = this;
    const byHand = Math.max(MAX_BY_HAND, description.stopTime - description.startTime);
    return Math.min(session.ended, description.startTime + Math.min(session.motion ? session.motion.length : byHand, MAX_ROWS * description.step));
  }

  /** Time up to which inputs are known, s. */
  get recorded() {
    return this.session.motion ? this.end : Math.max(this.session.table.end, this.session.timeOf(this.session.known - 1));
  }

  /** Whether all rows of a motion are calculated. */
  get isWhole() {
    const { session } = this;
    return session.motion !== null && !session.error && session.table.end >= this.end - 0.5 * this.description.step;
  }

  /** Sets the inputs of the next row of a run by hand. @param {Record<string, number>} inputs */
  move = (inputs) => this.addOn.follow(inputs, this.session.targets, this.description.step);

  /** @returns {Player} */
  createPlayer() {
    const { session, addOn, description, view } = this;
    const begin = description.startTime;
    return new Player({
      plots: (seek) => new Plots(addOn.panels, seek),
      view: {
        element: view.element,
        draw: (table, time) => {
          view.draw(table, time, captionAt(session.motion, time - begin));
          this.response?.draw(session.motion, time - begin, session.start);
        },
      },
      begin,
      isLooping: () => !this.isTouched && !session.error && this.player.speed !== Infinity && session.motion !== null && (this.guide.chosen >= 0 || session.motion === addOn.motions[0]),
      goesOn: () => this.goesOn(),
      other: () => this.other,
      notes: () => session.motion?.notes ?? [],
      table: session.table,
      span: (now) => (session.motion || !(description.step < 0.1) ? [begin, this.end] : [Math.max(begin, now - WINDOW), Math.max(begin + WINDOW, now)]),
      recorded: () => this.recorded,
      limit: () => this.end,
      advance: (now) => {
        const reached = session.advance(session.motion ? this.end : Math.max(now, session.timeOf(session.known - 1)), this.move);
        this.showError(session.error);
        if (session.motion) {
          addOn.sliders.forEach(({ name }) => session.table.count && this.sliders.show.get(name)?.(session.table.at(name, now)));
        }
        if (session.motion && reached < this.end - description.step) {
          // The rest of the run is calculated in the next frames and drawn pale.
          this.player.requestFrame();
        }
        this.write();
        return session.error ? now : reached;
      },
    });
  }

  /** Writes the sentences of the guide that depend on values. While a run is calculated, the sentences of the last run stay. */
  write() {
    const { session, addOn } = this;
    if (session.error || (session.motion && !this.isWhole)) {
      return;
    }
    if (session.motion?.frequency) {
      this.response?.update(session.start);
    }
    this.guide.write({
      value: (name) => this.value(name),
      preset: (name) => {
        const one = this.description.byName.get(name);
        return one ? (addOn.start[name] ?? startOf(one)) * one.factor + one.offset : this.numbers[name];
      },
      table: session.motion ? session.table : null,
      other: this.other?.table ?? null,
      motion: session.motion,
      response: this.response ?? null,
    });
  }

  /** Continues a run by hand after its last row, if the add-on is `isAtRest`; otherwise shows why the run stops. Returns whether it continues. */
  goesOn() {
    const { session, addOn, player, description } = this;
    if (session.motion || session.error) {
      return false;
    }
    const length = `${quantity(this.end - description.startTime, "s")}`;
    this.status.classList.remove("live-error");
    if (!addOn.isAtRest) {
      this.status.textContent = `A run by hand ends after ${length}. \u201cStart again\u201d begins a new one.`;
      return false;
    }
    session.renew();
    player.now = description.startTime;
    this.status.textContent = `A run by hand has ${length}; a new one has begun where the last one ended.`;
    return true;
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
    this.shownError = error;
    const { latest } = this;
    const label = latest && (latest.fields.labels.get(latest.one.name) || latest.one.name);
    this.status.textContent = isRejected ? `The FMU rejects ${label ? `this value of ${label}` : "this"}: ${error}` : error;
    this.status.classList.toggle("live-error", isRejected);
    this.player.element.classList.toggle("live-rejected", isRejected);
    if (isRejected) {
      latest?.fields.mark.get(latest.one.name)?.(`The FMU rejects this value of ${label}.`);
    } else {
      [this.sliders, this.parameters].forEach((fields) => fields.mark.forEach((mark) => mark("")));
    }
  }

  /** Continues the run by hand from the current time. @param {Record<string, number>} values of the sliders */
  byHand(values) {
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
    this.other = null;
    this.latest = { fields: this.sliders, one: this.find(Object.keys(values)[0]), rows: row + 1, targets: new Map(session.targets) };
    Object.entries(values).forEach(([name, value]) => session.targets.set(name, value));
    player.setPlaying(true);
  }

  /** Moves sliders from the view. The sliders of one argument move together, until one of them is at its end. @param {...Record<string, number>} increments */
  drag(...increments) {
    const { session } = this;
    this.isTouched = true;
    this.guide.answer(this.reached);
    /** @type {Record<string, number>} */
    const values = {};
    const current = (/** @type {string} */ name) => values[name] ?? (session.motion ? session.table.at(name, this.player.now) : (session.targets.get(name) ?? 0));
    for (const together of increments) {
      const shares = Object.entries(together).map(([name, by]) => {
        const reach = this.addOn.sliders.find((one) => one.name === name)?.reach ?? 1;
        return by ? Math.max(0, reach - Math.sign(by) * current(name)) / Math.abs(by) : 1;
      });
      const share = Math.min(1, ...shares);
      Object.entries(together).forEach(([name, by]) => (values[name] = current(name) + share * by));
    }
    Object.entries(values).forEach(([name, value]) => this.sliders.show.get(name)?.(value));
    this.byHand(values);
  }

  /** Starts a run from the beginning. @param {Motion | null} motion */
  begin(motion) {
    this.session.motion = motion;
    this.session.known = 0;
    this.session.restart(0);
  }

  /** Calculates the motion that the chosen one is compared with, with the same parameters. */
  compare() {
    const { session } = this;
    const { motion } = session;
    const other = motion?.other && this.motions.get(motion.other.id);
    if (motion?.other && other) {
      this.begin(other);
      session.finish(this.end, this.move);
      this.other = session.error ? null : { table: session.table.copy(), label: motion.other.label };
      this.begin(motion);
    }
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
    this.other = null;
    this.changedAt = -Infinity;
    this.begin(motion || null);
    this.compare();
    player.setPlaying(false);
    player.now = this.description.startTime;
    if (motion && this.guide.isWritten) {
      // The whole run is calculated now, so that the sentences have their numbers from the first moment.
      session.finish(this.end, this.move);
    }
    this.write();
    player.setPlaying(motion !== undefined && allowsMotion());
    this.rest();
  }

  /** Shows one image of the run if the user's system does not allow animations: the one that the view chooses, or the last one. */
  rest() {
    const { session, player } = this;
    if (session.motion && !player.isPlaying && !allowsMotion()) {
      session.finish(this.end, this.move);
      player.now = this.view.rest?.(session.table) ?? this.end;
      this.write();
      player.requestFrame();
    }
  }

  /** Chooses a motion with the current parameters. The browser's Back returns to the motion before. @param {string} id */
  visit(id) {
    this.choose(id);
    this.remember(false);
  }

  /** Shows a step of the guide with the settings with which the reader has left it. Scrolling leaves the address as it is. @param {Chapter} chapter */
  follow(chapter) {
    const last = this.guide.chapters[this.guide.chosen];
    if (last) {
      this.guide.left.set(last, String(this.settings()));
    }
    this.apply(new URLSearchParams(this.guide.left.get(chapter) ?? chapter.settings));
    this.isTouched = false;
  }

  /** Scrolls to a step and shows it. @param {Chapter} chapter */
  turnTo(chapter) {
    this.follow(chapter);
    this.remember(false);
    this.scrollTo(this.guide.chapters.indexOf(chapter));
  }

  /** Scrolls to a step, or to the controls after the last one. @param {number} step */
  scrollTo(step) {
    this.reached = step;
    const part = this.parts()[step].getBoundingClientRect();
    scrollTo(0, scrollY + part.top - (this.isStacked ? this.pane.offsetHeight : 0) - 8);
  }

  /** Whether the steps are below the image, as in a narrow window. */
  get isStacked() {
    return this.pane.getBoundingClientRect().left < this.own.getBoundingClientRect().right;
  }

  /** The steps and, after them, the controls. */
  parts() {
    return [...this.guide.steps, this.own];
  }

  /** Shows the step that the reader has scrolled to: the last one that begins in the upper part of the space for text. */
  scrolled() {
    const top = this.isStacked ? Math.max(0, this.pane.getBoundingClientRect().bottom) : 0;
    const line = top + 0.5 * (innerHeight - top);
    // A reader who uses the controls keeps their run as long as they are in the window.
    const step = this.parts().filter((part) => part.getBoundingClientRect().top < (part === this.own && this.reached === this.guide.chapters.length ? innerHeight : line)).length - 1;
    if (step >= 0) {
      this.arrive(step);
    }
  }

  /** Shows the step to which a reader comes. The controls keep the run of the step before, but show the whole image. @param {number} step */
  arrive(step) {
    if (step === this.reached) {
      return;
    }
    this.reached = step;
    const chapter = this.guide.chapters[step];
    if (chapter) {
      this.follow(chapter);
    } else {
      this.view.settings?.forEach(({ set, preset }) => set(preset));
    }
  }

  /** Calculates the runs of all steps, so that their sentences have their numbers before a reader gets there. */
  rehearse() {
    for (const { settings } of [...this.guide.chapters].reverse()) {
      this.apply(new URLSearchParams(settings));
      this.session.finish(this.end, this.move);
      this.write();
    }
  }

  /** Puts the settings into the address of the page. @param {boolean} isSame whether the address is changed without a new entry in the browser's history */
  remember(isSame) {
    const settings = String(this.settings());
    if (settings !== this.applied) {
      this.applied = settings;
      history[isSame ? "replaceState" : "pushState"](null, "", `#try&${settings}`);
    }
  }

  /** Calculates the run again after a change. The run before the change stays in grey, unless the motion is compared with another one. */
  recalculate() {
    const { session } = this;
    const now = performance.now();
    if (now - this.changedAt > 1000 && this.isWhole && !session.motion?.other) {
      this.other = { table: session.table.copy(), label: "before the change" };
    }
    this.changedAt = now;
    const { isRejected } = session;
    session.restart(session.motion ? 0 : Infinity);
    this.compare();
    this.view.set?.((name) => Number(session.parameter(this.find(name))));
    this.showNumbers();
    if (isRejected && session.motion) {
      this.player.setPlaying(allowsMotion());
    }
    this.player.requestFrame();
  }

  /** Changes a parameter, or a number that motions read. @param {string} name @param {number} value in the unit of the page */
  change(name, value) {
    this.guide.answer(this.guide.chosen);
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
    this.guide.show[this.guide.chosen]?.forEach((show, name) => show(this.value(name)));
  }

  /** Sets all parameters. @param {Record<string, number>} start values that differ from those of the FMU */
  reset(start) {
    this.session.start = new Map(Object.entries(start).map(([name, value]) => [this.find(name), value]));
    this.settable.forEach((one) => this.parameters.show.get(one.name)?.(this.session.parameter(one)));
    this.parameters.mark.forEach((mark) => mark(""));
    this.recalculate();
  }

  save() {
    this.session.finish(this.recorded, this.move);
    const link = element("a", { href: URL.createObjectURL(new Blob([this.session.csv()], { type: "text/csv" })), download: `${this.description.identifier}.csv` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  /** Returns the settings for a link: the motion, the sliders of a run by hand, and everything else that differs from the page when it opens. */
  settings() {
    const { session, addOn, player } = this;
    const settings = new URLSearchParams({ motion: this.choice.value });
    if (player.speed !== this.pace) {
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
    this.view.settings?.forEach(({ value, preset }, name) => value() !== preset && settings.set(name, value()));
    return settings;
  }

  /** Puts the settings into the address of the page, and copies the address. The run continues. */
  share() {
    this.remember(true);
    this.status.classList.remove("live-error");
    this.status.textContent = "The address of this page now contains these settings.";
    if (location.protocol === "file:") {
      this.status.textContent += " The link works only on this computer. To share it, put this file on a web server.";
    }
    navigator.clipboard?.writeText(location.href).then(() => (this.status.textContent += " The address is copied."), () => {});
  }

  /** Applies the settings in the address of the page if they differ from the last ones. The address of another section has none. */
  settle() {
    const settings = /^#try&?(.*)$/.exec(location.hash)?.[1] ?? (location.hash ? null : "");
    if (settings !== null && settings !== this.applied) {
      const isOpening = this.applied === null;
      this.applied = settings;
      const { chapters } = this.guide;
      this.apply(new URLSearchParams(settings || chapters[0]?.settings));
      if (chapters.length && (settings || !isOpening)) {
        const { chosen } = this.guide;
        this.scrollTo(chosen < 0 ? chapters.length : chosen);
      }
    }
  }

  /** Applies the settings of a link or a step. All other settings get the values that they had when the page opened. @param {URLSearchParams} settings */
  apply(settings) {
    const { session, addOn, player } = this;
    // The numbers of the step before stay as they are.
    this.guide.read(BY_HAND);
    Object.assign(addOn.numbers, this.numbers);
    this.reset(addOn.start);
    this.view.settings?.forEach(({ set, preset }) => set(preset));
    const wanted = settings.get("motion") || addOn.motions[0].id;
    const isByHand = wanted === BY_HAND && addOn.sliders.length > 0;
    const problems = [...settings].map(([name, value]) => this.applyOne(name, value, isByHand)).filter((reason) => reason);
    this.choose(this.motions.has(wanted) || isByHand ? wanted : addOn.motions[0].id);
    for (const { name } of isByHand ? addOn.sliders.filter((slider) => settings.has(slider.name)) : []) {
      const value = Number(settings.get(name));
      if (!this.sliders.problem(this.find(name), value)) {
        session.targets.set(name, value);
        this.sliders.show.get(name)?.(value);
      }
    }
    this.view.set?.((name) => Number(session.parameter(this.find(name))));
    this.showNumbers();
    const speed = settings.get("speed");
    if (speed !== null && this.isSpeed(Number(speed))) {
      player.setSpeed(Number(speed));
      player.setPlaying(player.isPlaying && allowsMotion());
      this.rest();
    } else {
      const { isPlaying } = player;
      player.setSpeed(this.pace);
      player.setPlaying(isPlaying || (isByHand && settings.size > 1));
      this.rest();
    }
    this.isTouched = false;
    this.status.classList.toggle("live-error", problems.length > 0);
    this.status.textContent = problems.length ? `The link is applied without these values: ${problems.join("; ")}.` : "";
    this.shownError = "";
  }

  /** Whether a link may set this speed. @param {number} speed */
  isSpeed(speed) {
    return speed === Infinity || (speed >= 1e-3 * this.pace && speed <= 100 * this.pace);
  }

  /** Applies a setting, but only checks motion, speed and sliders. Returns why the setting is impossible, or "". @param {string} name @param {string} value @param {boolean} isByHand */
  applyOne(name, value, isByHand) {
    const { session, addOn, parameters, description } = this;
    const one = description.byName.get(name);
    if (name === "motion") {
      return this.motions.has(value) || isByHand ? "" : `motion must be one of the list below, but it is ${value}`;
    }
    if (name === "speed") {
      return this.isSpeed(Number(value)) ? "" : `speed must be from ${quantity(1e-3 * this.pace, "")} to ${quantity(100 * this.pace, "")}, but it is ${value}`;
    }
    if (one?.causality === "parameter") {
      const given = one.type === "String" ? value : value === "" ? NaN : Number(value);
      const reason = parameters.problem(one, given);
      parameters.mark.get(name)?.(reason && `The link is applied without this value: ${reason}.`);
      if (!reason) {
        this.latest = { fields: parameters, one, rows: 0, targets: session.targets };
        session.start.set(one, given);
        parameters.show.get(name)?.(given);
      }
      return reason;
    }
    if (name in addOn.numbers) {
      const { label = name, low = -Infinity, high = Infinity, unit = "" } = addOn.limits?.find((dial) => dial.name === name) ?? {};
      const number = value === "" ? NaN : Number(value);
      if (!(number >= low && number <= high)) {
        return `${label} must be from ${quantity(low, "")} to ${quantity(high, unit)}, but it is ${value.replace("-", "\u2212")}`;
      }
      addOn.numbers[name] = number;
      return "";
    }
    if (addOn.sliders.some((slider) => slider.name === name)) {
      return one ? this.sliders.problem(one, value === "" ? NaN : Number(value)) : "";
    }
    const setting = this.view.settings?.get(name);
    return setting?.set(value) ? "" : setting ? `${name} cannot be ${value}` : `there is no ${name}`;
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
      this.sliders.reaches.set(name, FARTHEST * reach);
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
      element("div", { class: "live-buttons" }, ...buttons),
      this.status,
      ...(this.isShort && this.settable.length ? [element("b", {}, "Parameters"), ...this.settable.map((one) => this.parameters.row(one, one.name, null)), this.button("Default parameters", () => this.reset({}))] : []),
    );
  }

  /** Whether all parameters are in one grid with the inputs, as for a small model without its own add-on. */
  get isShort() {
    return addOns[this.description.identifier] === undefined && this.settable.length <= 12;
  }

  /** The parameters that are not near the sliders. */
  fields() {
    const rows = (/** @type {boolean} */ isMinor) =>
      this.settable.filter(({ name }) => this.addOn.isMinor(name) === isMinor && !(name in this.addOn.near)).map((one) => this.parameters.row(one, one.name, null));
    const [major, minor] = [rows(false), rows(true)];
    const fields = element(
      "details",
      { class: "live-parameters" },
      element("summary", {}, Object.keys(this.addOn.near).length ? "All other parameters" : "Parameters"),
      element("div", { class: "live-rows" }, ...major),
      ...(minor.length ? [element("details", {}, element("summary", {}, "Start values"), element("div", { class: "live-rows" }, ...minor))] : []),
      this.button("Default parameters", () => this.reset({})),
    );
    fields.open = matchMedia("(min-width: 60rem)").matches;
    return fields;
  }

  /** The section at the top of the page. */
  section() {
    const { description, player, missing, guide, pane, own } = this;
    const controls = element("div", { class: "live-buttons live-view" }, ...(this.view.controls ?? []));
    player.plots.element.prepend(...(this.response ? [this.response.element] : []));
    const isTold = guide.chapters.length > 0;
    const about = element(
      "p",
      { class: "live-about" },
      `This is the FMU itself: ${description.identifier} ${description.version} calculates every number above in your browser. The page loads nothing and sends nothing. The FMU\u2019s guid is `,
      element("code", {}, description.guid),
      `.${missing.length ? ` This page does not contain ${missing.join(", ")} (too large). Results that depend on them differ from those of other tools.` : ""}`,
    );
    const isPlain = addOns[description.identifier] === undefined;
    const section = element("section", { class: "live", "aria-labelledby": "try" }, element("h2", { id: "try" }, "Try it"), player.element);
    const more = [...(this.settable.length && !this.isShort ? [this.fields()] : []), ...(isPlain ? [tableOfVariables(description)] : []), about];
    if (isTold) {
      player.element.classList.add("live-told");
      player.plots.isRow = true;
      const all = this.button("All plots", () => pane.classList.toggle("live-all"));
      all.classList.add("live-narrow");
      controls.append(all);
      pane.append(player.stage, player.plots.element);
      own.append(element("h3", {}, "Your turn"), guide.lead, controls, this.controls(), ...more);
      player.element.append(guide.navigation, pane, element("div", { class: "live-story" }, ...guide.steps, own));
      for (const kind of ["pointerdown", "keydown", "input", "change"]) {
        own.addEventListener(kind, () => this.arrive(guide.chapters.length), { capture: true });
      }
      // Back returns to the step of the address.
      history.scrollRestoration = "manual";
      // A control that gets the focus is not scrolled below the image.
      new ResizeObserver(() => (document.documentElement.style.scrollPaddingTop = this.isStacked ? `${pane.offsetHeight + 8}px` : "")).observe(pane);
      addEventListener("scroll", () => requestAnimationFrame(() => this.scrolled()), { passive: true });
    } else {
      player.stage.append(...(this.view.controls ? [controls] : []));
      player.element.prepend(...(this.addOn.lead.length ? [guide.lead] : []));
      player.element.append(this.controls());
      section.append(...more);
    }
    for (const kind of ["pointerdown", "keydown"]) {
      // A finger on a paragraph only scrolls.
      section.addEventListener(kind, ({ target }) => (this.isTouched ||= target instanceof Element && target.closest(".live-pane, .live-stage, .live-plots, .live-dial, button, input, select, summary") !== null), { capture: true });
    }
    return section;
  }
}

/** Returns the note of a motion that is nearest to a time, s. @param {Motion | null} motion @param {number} time */
function captionAt(motion, time) {
  const notes = motion?.notes ?? [];
  return notes.reduce((best, note) => (Math.abs(note[0] - time) < Math.abs(best[0] - time) ? note : best), notes[0] ?? [0, ""])[1];
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
 * Replaces the placeholder in the page with the section.
 * @param {{description: string, module: string}[]} packed the FMU of this page, and those that its add-on runs
 * @param {Record<string, string>} resources of the FMU of this page @param {string[]} missing resources that are not in the page
 */
async function live(packed, resources, missing) {
  const [own, ...others] = await Promise.all(packed.map((one, index) => decompressPackage(one, index ? {} : resources)));
  const trial = new Trial(own, others, missing);
  const section = trial.section();
  trial.rehearse();
  const { stopTime, startTime, identifier } = own.description;
  if (addOns[identifier] === undefined && !(stopTime - startTime < 60 && stopTime - startTime > 1)) {
    trial.pace = (stopTime - startTime) / 10;
  }
  space().replaceWith(section);
  document.querySelector("nav ul")?.prepend(element("li", {}, element("a", { href: "#try" }, "Try it")));
  trial.settle();
  addEventListener("popstate", () => trial.settle());
  addEventListener("hashchange", () => trial.settle());
}
