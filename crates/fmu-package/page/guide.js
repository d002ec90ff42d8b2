// The guide: a story in steps, one below the other, next to the image of the model. The reader can drag numbers in them.

/**
 * A number in a paragraph: a parameter of the FMU in the unit of the page, or a number that motions read.
 * @typedef {{name: string, label: string, low: number, high: number, step: number, unit: string}} Dial
 * The values from which a sentence is written. `value` returns a parameter or a number that motions read, `preset` its value when the page opens.
 * `table` has all results of the chosen motion, and `other` those of the run for comparison; in a run by hand, `table` and `motion` are `null`.
 * @typedef {{value(name: string): number, preset(name: string): number, table: Table | null, other: Table | null, motion: Motion | null, response: ResponsePlot | null}} Facts
 * A part of a paragraph: plain text, a number to drag, text that depends on values, or such text in a line of its own.
 * @typedef {string | Dial | ((facts: Facts) => string) | {line(facts: Facts): string}} Part
 * A step: its title, what the reader sees and can move, a question and its answer, and the settings of its run as in a link.
 * @typedef {{title: string, parts: Part[], question: string, why: Part[], settings: Record<string, string> & {motion: string}}} Chapter
 */

class Guide {
  /**
   * @param {Part[]} lead the paragraph for runs outside of the steps @param {Chapter[]} chapters
   * @param {(chapter: Chapter) => void} choose called with the step whose button is pressed @param {(name: string, value: number) => void} change
   */
  constructor(lead, chapters, choose, change) {
    this.chapters = chapters;
    this.change = change;
    /** Functions that show the value of a number, by step and name. @type {Map<string, (value: number) => void>[]} */
    this.show = [];
    /** Texts that depend on values, by step; the first are those of the lead. @type {{target: HTMLElement, write(facts: Facts): string}[][]} */
    this.written = [];
    this.chosen = -1;
    /** Settings with which the reader has left a step. @type {Map<Chapter, string>} */
    this.left = new Map();
    this.buttons = chapters.map((chapter, index) => {
      const button = element("button", { type: "button", "aria-pressed": "false" }, `${index + 1}. ${chapter.title}`);
      button.addEventListener("click", () => choose(chapter));
      return button;
    });
    const paragraph = (/** @type {Part[]} */ parts, /** @type {number} */ step, /** @type {string} */ kind) => element("p", { class: kind }, ...parts.map((part) => this.part(part, step)));
    this.lead = paragraph(lead, 0, "live-what");
    /** The answer of each step. The reader opens it, or it opens when something is moved. */
    this.answers = chapters.map(({ question, why }, index) => element("details", { class: "live-why" }, element("summary", {}, question), paragraph(why, index + 1, "")));
    /** Why a value that the reader has set is impossible, below the sentences of the step. */
    this.warning = element("p", { class: "live-error live-warning", role: "status" });
    this.steps = chapters.map(({ title, parts }, index) =>
      element("article", { class: "live-step" }, element("h3", {}, `${index + 1}. ${title}`), paragraph(parts, index + 1, "live-what"), this.answers[index]),
    );
    this.navigation = element("div", { class: "live-buttons live-steps", role: "group", "aria-label": "Steps" }, ...this.buttons);
  }

  /** Marks the step with a motion. @param {string} motion */
  read(motion) {
    this.chosen = this.chapters.findIndex(({ settings }) => settings.motion === motion);
    this.buttons.forEach((button, index) => button.setAttribute("aria-pressed", String(index === this.chosen)));
    this.steps.forEach((step, index) => step.classList.toggle("live-chosen", index === this.chosen));
    this.warn("");
  }

  /** Shows why a value is impossible, in the step that is marked. @param {string} reason */
  warn(reason) {
    this.warning.textContent = reason && `${reason}. The sentences and the plots still belong to the value before.`;
    const step = this.steps[this.chosen];
    if (reason && step && this.warning.parentElement !== step) {
      step.insertBefore(this.warning, this.answers[this.chosen]);
    }
  }

  /** Opens the answer of a step, because the reader has moved something. @param {number} step */
  answer(step) {
    if (this.answers[step]) {
      this.answers[step].open = true;
    }
  }

  /** Whether the paragraphs have sentences that depend on values. */
  get isWritten() {
    return (this.written[this.chosen + 1] || []).length > 0;
  }

  /** Writes the sentences that depend on values. @param {Facts} facts */
  write(facts) {
    for (const { target, write } of this.written[this.chosen + 1] || []) {
      const text = write(facts);
      if (target.textContent !== text) {
        target.textContent = text;
      }
    }
  }

  /** @param {Part} part @param {number} step */
  part(part, step) {
    if (typeof part === "string") {
      return part;
    }
    if ("low" in part) {
      return this.dial(part, step);
    }
    const isInline = typeof part === "function";
    const target = element("span", isInline ? {} : { class: "live-line" });
    (this.written[step] ||= []).push({ target, write: isInline ? part : part.line });
    return target;
  }

  /** Returns the element of a number that can be dragged. @param {Dial} dial @param {number} chapter number of the step from 1 */
  dial({ name, label, low, high, step, unit }, chapter) {
    const made = element("span", { class: "live-dial", role: "slider", tabindex: "0", "aria-label": label, "aria-valuemin": String(low), "aria-valuemax": String(high) });
    let [value, valueAtPress, pressedX] = [low, 0, 0];
    const digits = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
    const show = (/** @type {number} */ given) => {
      value = given;
      made.textContent = `${given.toFixed(digits).replace("-", "\u2212")}${unit === "\u00b0" ? "" : "\u00a0"}${unit}`;
      made.setAttribute("aria-valuenow", given.toFixed(digits));
      made.setAttribute("aria-valuetext", made.textContent);
    };
    (this.show[chapter - 1] ||= new Map()).set(name, show);
    const change = (/** @type {number} */ wanted) => {
      const next = Number(Math.min(high, Math.max(low, low + step * Math.round((wanted - low) / step))).toFixed(digits));
      if (next !== Number(value.toFixed(digits))) {
        this.change(name, next);
      }
    };
    made.addEventListener("pointerdown", (event) => {
      [valueAtPress, pressedX] = [value, event.clientX];
      made.setPointerCapture(event.pointerId);
    });
    made.addEventListener("pointermove", (event) => made.hasPointerCapture(event.pointerId) && change(valueAtPress + ((event.clientX - pressedX) * (high - low)) / 250));
    made.addEventListener("keydown", (event) => {
      const increments = /** @type {Record<string, number>} */ ({ ArrowLeft: -step, ArrowDown: -step, ArrowRight: step, ArrowUp: step, PageDown: -10 * step, PageUp: 10 * step, Home: low - high, End: high - low });
      if (increments[event.key]) {
        event.preventDefault();
        change(value + increments[event.key]);
      }
    });
    return made;
  }
}
