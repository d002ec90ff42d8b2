// Short paragraphs, each of which shows a run. The numbers in them can be dragged.

/**
 * A number in a paragraph: a parameter of the FMU, in the unit in which it is shown, or a number of the motions.
 * @typedef {{name: string, label: string, low: number, high: number, step: number, unit: string}} Dial
 * A paragraph, and the settings that show its run, as a link has them: `motion`, start values, and numbers of the motions.
 * @typedef {{title: string, words: (string | Dial)[], settings: Record<string, string> & {motion: string}}} Chapter
 */

class Guide {
  /**
   * @param {string} lead the paragraph that is shown if no chapter is @param {Chapter[]} chapters
   * @param {(chapter: Chapter) => void} choose @param {(name: string, value: number) => void} change
   */
  constructor(lead, chapters, choose, change) {
    this.chapters = chapters;
    this.change = change;
    /** Shows the value of a number. @type {Map<string, ((value: number) => void)[]>} */
    this.show = new Map();
    this.buttons = chapters.map((chapter, place) => {
      const button = element("button", { type: "button", "aria-pressed": "false" }, `${place + 1}. ${chapter.title}`);
      button.addEventListener("click", () => choose(chapter));
      return button;
    });
    this.texts = [[lead], ...chapters.map(({ words }) => words)].map((words) =>
      element("p", {}, ...words.map((word) => (typeof word === "string" ? word : this.dial(word)))),
    );
    const buttons = element("div", { class: "live-buttons", role: "group", "aria-label": "Guide" }, ...this.buttons);
    this.element = element("div", { class: "live-guide" }, ...(chapters.length ? [buttons] : []), element("div", { class: "live-texts", "aria-live": "polite" }, ...this.texts));
  }

  /** Shows the paragraph of a motion. @param {string} motion */
  read(motion) {
    const chosen = this.chapters.findIndex(({ settings }) => settings.motion === motion);
    this.buttons.forEach((button, place) => button.setAttribute("aria-pressed", String(place === chosen)));
    this.texts.forEach((text, place) => text.classList.toggle("live-chosen", place === chosen + 1));
  }

  /** @param {Dial} dial */
  dial({ name, label, low, high, step, unit }) {
    const made = element("span", { class: "live-dial", role: "slider", tabindex: "0", "aria-label": label, "aria-valuemin": String(low), "aria-valuemax": String(high) });
    let [value, held, from] = [low, 0, 0];
    const digits = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
    const show = (/** @type {number} */ given) => {
      value = given;
      made.textContent = `${given.toFixed(digits)}${unit === "\u00b0" ? "" : "\u00a0"}${unit}`;
      made.setAttribute("aria-valuenow", given.toFixed(digits));
      made.setAttribute("aria-valuetext", made.textContent);
    };
    this.show.set(name, [...(this.show.get(name) || []), show]);
    const change = (/** @type {number} */ to) => {
      const next = Number(Math.min(high, Math.max(low, low + step * Math.round((to - low) / step))).toFixed(digits));
      if (next !== Number(value.toFixed(digits))) {
        this.change(name, next);
      }
    };
    made.addEventListener("pointerdown", (event) => {
      [held, from] = [value, event.clientX];
      made.setPointerCapture(event.pointerId);
    });
    made.addEventListener("pointermove", (event) => made.hasPointerCapture(event.pointerId) && change(held + ((event.clientX - from) * (high - low)) / 250));
    made.addEventListener("keydown", (event) => {
      const ways = /** @type {Record<string, number>} */ ({ ArrowLeft: -step, ArrowDown: -step, ArrowRight: step, ArrowUp: step, PageDown: -10 * step, PageUp: 10 * step, Home: low - high, End: high - low });
      if (ways[event.key]) {
        event.preventDefault();
        change(value + ways[event.key]);
      }
    });
    return made;
  }
}
