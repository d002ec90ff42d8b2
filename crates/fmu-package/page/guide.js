// The guide: short paragraphs, each with a run. The reader can drag numbers in them.

/**
 * A number in a paragraph: a parameter of the FMU in the unit of the page, or a number that motions read.
 * @typedef {{name: string, label: string, low: number, high: number, step: number, unit: string}} Dial
 * A paragraph, and the settings of its run as in a link: `motion`, start values, and numbers that motions read.
 * @typedef {{title: string, parts: (string | Dial)[], settings: Record<string, string> & {motion: string}}} Chapter
 */

class Guide {
  /**
   * @param {string} lead the paragraph without a chapter @param {Chapter[]} chapters
   * @param {(chapter: Chapter) => void} choose @param {(name: string, value: number) => void} change
   */
  constructor(lead, chapters, choose, change) {
    this.chapters = chapters;
    this.change = change;
    /** Functions that show the value of a number. @type {Map<string, ((value: number) => void)[]>} */
    this.show = new Map();
    this.buttons = chapters.map((chapter, index) => {
      const button = element("button", { type: "button", "aria-pressed": "false" }, `${index + 1}. ${chapter.title}`);
      button.addEventListener("click", () => choose(chapter));
      return button;
    });
    this.texts = [[lead], ...chapters.map(({ parts }) => parts)].map((parts) =>
      element("p", {}, ...parts.map((part) => (typeof part === "string" ? part : this.dial(part)))),
    );
    const buttons = element("div", { class: "live-buttons", role: "group", "aria-label": "Guide" }, ...this.buttons);
    this.element = element("div", { class: "live-guide" }, ...(chapters.length ? [buttons] : []), element("div", { class: "live-texts", "aria-live": "polite" }, ...this.texts));
  }

  /** Shows the paragraph of a motion. @param {string} motion */
  read(motion) {
    const chosen = this.chapters.findIndex(({ settings }) => settings.motion === motion);
    this.buttons.forEach((button, index) => button.setAttribute("aria-pressed", String(index === chosen)));
    this.texts.forEach((text, index) => text.classList.toggle("live-chosen", index === chosen + 1));
  }

  /** A number that can be dragged. @param {Dial} dial */
  dial({ name, label, low, high, step, unit }) {
    const made = element("span", { class: "live-dial", role: "slider", tabindex: "0", "aria-label": label, "aria-valuemin": String(low), "aria-valuemax": String(high) });
    let [value, valueAtPress, pressedX] = [low, 0, 0];
    const digits = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
    const show = (/** @type {number} */ given) => {
      value = given;
      made.textContent = `${given.toFixed(digits)}${unit === "\u00b0" ? "" : "\u00a0"}${unit}`;
      made.setAttribute("aria-valuenow", given.toFixed(digits));
      made.setAttribute("aria-valuetext", made.textContent);
    };
    this.show.set(name, [...(this.show.get(name) || []), show]);
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
