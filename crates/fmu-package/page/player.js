// Plays a run: a view, plots, and a bar with a button, a time slider and the speed.

/**
 * An image of the model at one time, next to the plots. `rest` returns the time that shows a run best in one image, s.
 * @typedef {{element: HTMLElement, draw(table: Table, time: number, caption?: string): void, set?(parameters: (name: string) => number): void, rest?(table: Table): number}} View
 */

/** Whether the user's system allows animations. */
const allowsMotion = () => !matchMedia("(prefers-reduced-motion: reduce)").matches;

/** The speeds of the list, with their labels. */
const SPEEDS = new Map([["2", "2 × real time"], ["1", "real time"], ["0.5", "1/2 × real time"], ["0.2", "1/5 × real time"], ["0.05", "1/20 × real time"], ["0.01", "1/100 × real time"], ["Infinity", "at once"]]);

class Player {
  /**
   * `span` returns the time span of the plots. `advance` calculates the run until a time and returns the time that it reached.
   * `recorded` returns the end of the time slider, `limit` the end of the run. `other` is a run for comparison. When the end of the run was
   * played, `goesOn` may start another one, and returns whether it has.
   * @param {{plots: (seek: (time: number) => void) => Plots, view: View | null, begin: number, isLooping?(): boolean, table: Table,
   *   span(now: number): [number, number], recorded(): number, limit(): number, advance?(now: number): number, other?(): Comparison | null,
   *   notes?(): Note[], goesOn?(): boolean}} options
   */
  constructor(options) {
    this.options = options;
    this.now = options.begin;
    this.speed = 1;
    this.isPlaying = false;
    this.last = 0;
    /** Seconds that passed and that were played since the pace was last checked. */
    this.paced = { passed: 0, played: 0 };
    this.isRequested = false;
    this.isVisible = true;
    this.plots = options.plots((time) => this.seek(time));
    this.play = element("button", { type: "button", class: "live-play" }, "Play");
    this.play.addEventListener("click", () => this.setPlaying(!this.isPlaying));
    this.slider = element("input", { type: "range", min: "0", max: "1000", step: "1", value: "0", "aria-label": "Time", class: "live-time" });
    this.slider.addEventListener("input", () => {
      this.seek(options.begin + ((options.recorded() - options.begin) * Number(this.slider.value)) / 1000);
    });
    this.clock = element("span", { class: "live-clock" });
    this.pace = element("select", { "aria-label": "Speed" });
    this.pace.append(...[...SPEEDS].map(([value, text]) => element("option", { value }, text)));
    this.pace.value = "1";
    this.pace.addEventListener("change", () => this.setSpeed(Number(this.pace.value)));
    this.late = element("span", { class: "live-late" });
    this.bar = element("div", { class: "live-bar" }, this.play, this.slider, this.clock, this.pace, this.late);
    this.stage = element("div", { class: "live-stage" }, ...(options.view ? [options.view.element] : []), this.bar);
    this.element = element("div", { class: "live-player" }, this.stage, this.plots.element);
    // A panel that appears changes the width of the others, but not of the player.
    const resized = new ResizeObserver(() => this.requestFrame());
    [this.element, ...this.plots.panels.map(({ canvas }) => canvas)].forEach((one) => resized.observe(one));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.requestFrame());
    new IntersectionObserver((entries) => {
      this.isVisible = entries[entries.length - 1].isIntersecting;
      this.requestFrame();
    }).observe(this.element);
    this.setPlaying(allowsMotion());
  }

  /** @param {number} speed */
  setSpeed(speed) {
    this.speed = speed;
    if (![...this.pace.options].some(({ value }) => value === String(speed))) {
      this.pace.append(element("option", { value: String(speed) }, `${Number(speed.toPrecision(2))} × real time`));
    }
    this.pace.value = String(speed);
    this.paced = { passed: 0, played: 0 };
    this.late.textContent = "";
    this.setPlaying(true);
  }

  /** @param {boolean} isPlaying */
  setPlaying(isPlaying) {
    if (isPlaying && !this.isPlaying && this.now >= this.options.limit() - 1e-9) {
      this.now = this.options.begin;
    }
    if (isPlaying === this.isPlaying) {
      // A slider that was moved must be drawn, even if the run was playing already.
      this.requestFrame();
      return;
    }
    this.isPlaying = isPlaying;
    this.paced = { passed: 0, played: 0 };
    this.late.textContent = "";
    this.play.textContent = isPlaying ? "Pause" : "Play";
    this.last = 0;
    this.requestFrame();
  }

  /** @param {number} time */
  seek(time) {
    this.setPlaying(false);
    this.now = time;
    this.requestFrame();
  }

  /** Draws in the next frame of the screen. */
  requestFrame() {
    if (!this.isRequested) {
      this.isRequested = true;
      requestAnimationFrame((stamp) => this.frame(stamp));
    }
  }

  /** @param {number} stamp ms */
  frame(stamp) {
    this.isRequested = false;
    if (!this.isVisible && this.isPlaying) {
      this.last = 0;
      return;
    }
    const waited = this.last ? (stamp - this.last) / 1000 : 0;
    const passed = Math.min(waited, 0.1);
    this.last = stamp;
    const { begin, table, view } = this.options;
    const [limit, before] = [this.options.limit(), this.now];
    if (this.isPlaying) {
      this.now = this.speed === Infinity ? limit : Math.min(this.now + passed * this.speed, limit);
    }
    const reached = this.options.advance?.(this.now) ?? limit;
    const isBehind = reached < this.now - 1e-9;
    // If the calculation is too slow, the time waits for it. While a run is recalculated, the last image stays.
    if (isBehind && this.isPlaying && this.speed !== Infinity) {
      this.now = Math.max(before, reached);
    }
    this.checkPace(waited, this.now - before);
    if (table.count && !(isBehind && reached < before - 1e-9)) {
      this.plots.draw(table, this.now, ...this.options.span(this.now), this.options.other?.() ?? null, this.options.notes?.());
      view?.draw(table, this.now);
    }
    this.slider.value = String(Math.round((1000 * (this.now - begin)) / (this.options.recorded() - begin || 1)));
    const text = `${this.now.toFixed(Math.max(0, Math.min(3, 5 - Math.floor(Math.log10(limit)))))} s`;
    this.clock.textContent = text;
    this.slider.setAttribute("aria-valuetext", text);
    if (this.isPlaying && this.now >= limit - 1e-9 && !isBehind) {
      if (this.options.isLooping?.()) {
        this.now = begin;
      } else if (!this.options.goesOn?.()) {
        this.setPlaying(false);
      }
    }
    if (this.isPlaying || isBehind) {
      this.requestFrame();
    }
  }

  /** Shows the actual speed if the browser cannot keep the chosen speed. @param {number} passed s @param {number} played s */
  checkPace(passed, played) {
    if (!this.isPlaying || this.speed === Infinity || played < 0) {
      return;
    }
    this.paced.passed += passed;
    this.paced.played += played;
    if (this.paced.passed >= 1) {
      const pace = this.paced.played / this.paced.passed;
      this.late.textContent = pace > 0.9 * this.speed ? "" : `slower here: ${Number(pace.toPrecision(2))} \u00d7 real time`;
      this.paced = { passed: 0, played: 0 };
    }
  }
}
